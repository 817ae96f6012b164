"""A picture of one arm by itself, with the gripper of the cell at its flange."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from dualbend.arm.mjcf import with_gripper
from dualbend.arm.model import ArmModel
from dualbend.errors import InputError, writing
from dualbend.files import whole_file
from dualbend.recording.pictures.render import drawing_options, open_renderer
from dualbend.scene.mjcf import add_floor_and_sky
from dualbend.types import Vector

_SIZE_PX = (720, 540)


def draw_arm(arm: ArmModel, q: Vector, path: Path) -> None:
    """Draw an arm at joint angles (n,) into a .png; InputError where that cannot be."""
    if path.suffix.lower() != ".png":
        raise InputError(f"--out {path}: a .png can be written")
    spec = with_gripper(arm.spec(looks=True))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = (2 * n for n in _SIZE_PX)
    spec.visual.headlight.ambient[:] = spec.visual.headlight.diffuse[:] = 0.45
    spec.worldbody.add_light(pos=[1.0, -2.0, 3.0], dir=[-0.3, 0.55, -0.8])
    add_floor_and_sky(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    places = data.xpos[1:]
    # Below what hangs under the base.
    model.geom("floor").pos[2] = min(float(places[:, 2].min()) - 0.15, 0.0)
    mujoco.mj_forward(model, data)
    camera.lookat[:] = 0.5 * (places.min(axis=0) + places.max(axis=0))
    camera.distance = 0.5 + 1.3 * float(np.ptp(places, axis=0).max())
    camera.azimuth, camera.elevation = 130.0, -15.0
    with open_renderer(model, *(2 * n for n in _SIZE_PX)) as renderer:
        renderer.update_scene(data, camera=camera, scene_option=drawing_options())
        picture = Image.fromarray(renderer.render()).resize(_SIZE_PX, Image.Resampling.BOX)
    with writing(path, "--out"), whole_file(path) as part:
        picture.save(part, format="png")
