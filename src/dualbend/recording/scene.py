"""The recording's scene in 3D: arms and tools, the sheet and its moment, grips and wrenches.

Shapes are logged once a body; a frame adds only the poses of what moves against its parent body.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dualbend.evaluation.permanent_set import hinge_moments
from dualbend.recording.geometry import (
    DECIMALS,
    Motion,
    carry,
    forward,
    in_world,
    log_axes,
    rows_of_pose,
    shapes_of,
)
from dualbend.recording.layers import layers_of
from dualbend.recording.log import RecordingLog
from dualbend.recording.plots import NOMINAL_COLOUR
from dualbend.recording.scales import Scales, diverging_colours
from dualbend.run.record import RunRecord
from dualbend.scene.sheet.shell import ShellConfig, vertex_body
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, strip_body
from dualbend.types import SIDES, Vector

_FORCE_COLOUR, _MOMENT_COLOUR, _COMMAND_COLOUR = [255, 193, 7], [224, 64, 251], [0, 230, 118]

_STILL = 1e-6
"""What moves less than this against its parent [m, 1] in the whole run is logged once."""

_SHEET_DECIMALS = 5
"""Places of the sheet are rounded to 10 µm."""

CLEAR_OF_JAWS_M = (0.025, 0.0, 0.015)
"""From the grip to the force's arrow, towards the other arm and up: jaws and sheet hide less."""


def log_scene(log: RecordingLog, result: RunRecord, scales: Scales) -> None:
    """Log everything under ``/cell``, in the world frame and metres.

    NotImplementedError where a visual geom is of a type that the recording has no shape for.
    """
    motion = forward(result)
    log.once("cell", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_robots(log, result.model, motion)
    ribbon = _ribbon(result, motion).round(_SHEET_DECIMALS)
    triangles = _triangles(ribbon.shape[1] // 2)
    _log_sheet(log, result, ribbon, triangles, scales)
    layers = layers_of(result)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        _log_wrench(log, result, side, sign, scales)
        layers.log_grip(log, result, motion, side, sign)
        _, (path, turned) = _paths(result, side, sign)
        log_axes(log, f"cell/grip/{side}_commanded", 0.045, path, turned)
    layers.log_scene(log, result, motion, ribbon, triangles)


def _log_robots(log: RecordingLog, model: mujoco.MjModel, motion: Motion) -> None:
    """Log floor, arms and tools; entities nest as bodies do, so that most poses never change."""
    floor = rr.Boxes3D(
        half_sizes=[1.5, 0.9, 0.01], centers=[0, 0, -0.011], colors=[74, 78, 84], fill_mode="solid"
    )
    log.once("cell/floor", floor)
    entity, carrier = {0: "cell"}, _carriers(log, model, motion)
    for body in np.flatnonzero(carrier == np.arange(model.nbody)).tolist():
        name, parent = model.body(body).name, int(carrier[model.body_parentid[body]])
        fixed = [i for i in np.flatnonzero(carrier == body).tolist() if i != body]
        shapes = shapes_of(model, body, {i: _fixed_pose(model, motion, i, body) for i in fixed})
        if shapes and body and name.startswith(SIDES):
            # Below its base a body is called link1, not left_link1: paths are most of an index.
            short = name.removeprefix("left_").removeprefix("right_")
            entity[body] = f"{entity[parent]}/{name if parent == 0 else short}"
            _log_body(log, entity[body], shapes, *rows_of_pose(motion, body, parent))


def _carriers(log: RecordingLog, model: mujoco.MjModel, motion: Motion) -> NDArray[np.intp]:
    """Return the body whose entity shows each body (bodies,): fewer entities, a smaller file.

    What is screwed to a robot's link, or rests on it in the whole run, is shown with it; a body
    with a mesh, and what stands on the floor, is its own.
    """
    meshes = model.geom_bodyid[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    carrier: NDArray[np.intp] = np.arange(model.nbody)
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        if parent == 0 or body in meshes or not model.body(body).name.startswith(SIDES):
            continue
        screwed = not model.body_dofnum[body]
        if screwed or (not log.live and _rests(*rows_of_pose(motion, body, parent))):
            carrier[body] = carrier[parent]
    return carrier


def _rests(place: Vector, quaternion: Vector) -> bool:
    both = np.concatenate((place, quaternion), axis=1)
    return len(both) > 0 and bool(np.ptp(both, axis=0).max() <= _STILL)


def _fixed_pose(
    model: mujoco.MjModel, motion: Motion, body: int, carrier: int
) -> tuple[Vector, Rotation]:
    """Return place (3,) and orientation of a body that rests on its carrier."""
    if len(motion.place):
        place, quaternion = rows_of_pose(motion, body, carrier)
        return place[0], Rotation.from_quat(quaternion[0])
    place, turn = np.zeros(3), Rotation.identity()
    while body != carrier:
        own = Rotation.from_quat(model.body_quat[body], scalar_first=True)
        place, turn = model.body_pos[body] + own.apply(place), own * turn
        body = int(model.body_parentid[body])
    return place, turn


def _log_body(
    log: RecordingLog, entity: str, shapes: list[Any], place: Vector, quaternion: Vector
) -> None:
    """Log a body's shapes and its pose in its parent body, the pose only once where it rests."""
    if not log.live and _rests(place, quaternion):
        turned = rr.Quaternion(xyzw=quaternion[0])
        log.once(entity, *shapes, rr.Transform3D(translation=place[0], quaternion=turned))
    else:
        log.once(entity, *shapes)
        log.frames(entity, rr.Transform3D, translation=place, quaternion=quaternion)


def _log_sheet(
    log: RecordingLog,
    result: RunRecord,
    ribbon: Vector,
    triangles: NDArray[np.intp],
    scales: Scales,
) -> None:
    """Log the sheet as one ribbon through the hinge lines, coloured by the bending moment there."""
    moment = hinge_moments(result)
    # Half a strip beyond the last hinges.
    ends = 1.5 * moment[:, [0, -1]] - 0.5 * moment[:, [1, -2]]
    moment = np.concatenate((ends[:, :1], moment, ends[:, 1:]), axis=1)
    colours = np.tile(diverging_colours(moment / scales.moment_range_n_m), (1, 2, 1))
    log.once("cell/sheet", rr.Mesh3D.from_fields(triangle_indices=triangles))
    log.frames("cell/sheet", rr.Mesh3D, vertex_positions=ribbon, vertex_colors=colours)


def _triangles(lines: int) -> NDArray[np.intp]:
    """Return the triangles (n, 3) between two edges of ``lines`` vertices each."""
    cell = np.array([[0, 1, lines], [1, lines + 1, lines]])
    each: NDArray[np.intp] = np.arange(lines - 1)[:, None, None] + cell
    return each.reshape(-1, 3)


def _ribbon(result: RunRecord, motion: Motion) -> Vector:
    """Return the sheet's two long edges, one after the other (rows, 2 (hinges + 2), 3)."""
    config = result.scenario.sheet.model
    if isinstance(config, ShellConfig):
        return _shell_ribbon(result, config, motion)
    hinges = result.trace.bends.shape[1]
    strips = [result.model.body(strip_body(i)).id for i in range(hinges + 1)]
    # The middle strip's frame is at its centre, that of every other at its hinge.
    hinged = strips[: hinges // 2] + strips[hinges // 2 + 1 :]
    left, right = motion.ends[:, :1], motion.ends[:, 1:]
    places = np.concatenate((left, motion.place[:, hinged], right), axis=1)
    along = [hinged[0], *hinged, hinged[-1]]
    across = 0.5 * result.scenario.sheet.width_m * _y_axes(motion.quaternion[:, along])
    return np.concatenate((places - across, places + across), axis=1)


def _shell_ribbon(result: RunRecord, shell: ShellConfig, motion: Motion) -> Vector:
    """Return the same of a plate; the columns that the grips hold are on the way to the next."""
    sites = [result.model.site(name).id for name in (LEFT_END, RIGHT_END)]
    across = _y_axes(motion.quaternion[:, result.model.site_bodyid[sites]])
    across *= 0.5 * result.scenario.sheet.width_m * np.array([1.0, -1.0])[:, None]
    edges = []
    for row, sign in ((0, -1.0), (shell.cells_across + 1, 1.0)):
        free = [result.model.body(vertex_body(i, row)).id for i in range(2, shell.cells_along)]
        inner = motion.place[:, free]
        ends = motion.ends + sign * across
        left, right = ends[:, :1], ends[:, 1:]
        held = (2 * left + inner[:, :1]) / 3, (2 * right + inner[:, -1:]) / 3
        edges.append(np.concatenate((left, held[0], inner, held[1], right), axis=1))
    return np.concatenate(edges, axis=1)


def _y_axes(quaternion: Vector) -> Vector:
    """Return the y axes (..., 3) of frames turned by quaternions (..., 4; w first)."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    return np.stack((2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)), -1)


def _log_wrench(
    log: RecordingLog, result: RunRecord, side: str, sign: float, scales: Scales
) -> None:
    """Log force and moment of the sheet on a grip, the force on the sheet's side of the gripper.

    A push ends before the grip and a pull starts there: behind it, the gripper would hide both.
    """
    grip = in_world(result, f"{side}_grip", sign)
    force = scales.force_m_per_n * in_world(result, f"{side}_true_force", sign)
    moment = scales.torque_m_per_n_m * in_world(result, f"{side}_true_moment", sign)
    beside = grip + np.array([sign, sign, 1.0]) * CLEAR_OF_JAWS_M
    start = np.where(sign * force[:, :1] < 0.0, beside - force, beside)
    origins = np.stack((start, grip), axis=1).round(DECIMALS)
    look = rr.Arrows3D.from_fields(colors=[_FORCE_COLOUR, _MOMENT_COLOUR], radii=0.004)
    log.once(f"cell/wrench/{side}", look)
    vectors = np.stack((force, moment), axis=1)
    log.frames(f"cell/wrench/{side}", rr.Arrows3D, origins=origins, vectors=vectors)


def log_paths(log: RecordingLog, result: RunRecord) -> None:
    """Log the nominal and commanded paths of the grips as they are so far, a point a frame."""
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        (nominal, _), (commanded, _) = _paths(result, side, sign)
        lines = [line[:: log.frame] for line in (nominal, commanded)]
        strips = [line[np.isfinite(line).all(axis=1)] for line in lines]
        drawn = rr.LineStrips3D(strips, colors=[NOMINAL_COLOUR, _COMMAND_COLOUR], radii=0.001)
        log.replace(f"cell/path/{side}", drawn)


def _paths(
    result: RunRecord, side: str, sign: float
) -> tuple[tuple[Vector, Vector], tuple[Vector, Vector]]:
    """Return places (rows, 3) and orientations (rows, 4) of a grip, nominal and as commanded."""
    trace = result.trace
    x, z, alpha = (trace[f"{side}_command_{axis}"] for axis in ("x", "z", "alpha"))
    there, sent = layers_of(result).places(result)
    height = trace["nominal_z"] - there[:, 2]
    nominal = (-trace["nominal_half_distance"], height, trace["nominal_alpha"])
    return carry(there, nominal, sign), carry(sent, (x, z, alpha), sign)
