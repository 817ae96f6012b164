"""MuJoCo model of assembly bed, alignment pins and pick-up stand."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import mujoco
import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.scene.bed.config import (
    BedConfig,
    LayoutConfig,
    PinsConfig,
    StandConfig,
    hole_places,
)
from dualbend.scene.contacts import ARM, LAID, PINNING, RESTING
from dualbend.scene.mjcf import BOX, DRAWN
from dualbend.scene.sheet.strips import StripConfig
from dualbend.types import Vector

_BELOW_FLOOR_M, _LAID_DEPTH_M = -1.0, 5e-3

_PLATE_M, _COLUMN = 0.02, 0.7
"""Bed and stand are drawn as a plate this thick, on a column of this share of its sides."""

_PLATE_RGBA, _COLUMN_RGBA = [0.62, 0.64, 0.67, 1.0], [0.24, 0.26, 0.30, 1.0]

RUBBED = {"condim": 3, "solref": [0.0035, 1.0]}
"""A contact with dry friction, two steps of 1.75 ms long: the stiffest that a step resolves."""

_PIN_CONTACT = {
    **RUBBED,
    "solref": [0.0015, 1.0],
    "solimp": [0.98, 0.999, 2e-5, 0.5, 2.0],
    "priority": 1,
}
"""Whatever touches a pin: softer defaults of what touches it must not mix in.

Stiffer than a whole step resolves, for which MuJoCo takes two steps; those at a tip are divided. An
impact of v is v τ/e deep: at 190 mm/s 0.1 mm.
"""

_LEAST_IMPEDANCE = 1e-4
"""MuJoCo's."""

_WEDGED_PER_S2, _WEDGED_DAMPING = 6e7, 0.5
"""Stiffness over mass of a hole's contact with the tip that it is wedged on, and its damping ratio.

The limits of force and depth, 40 N and 0.05 mm, are 0.8 N/µm; this is 1 N/µm for a sheet of 0.5 mm,
of a ring of 48 contacts 46 N/µm. A hole in a plate widens with 4π G t, 166 N/µm of aluminium, and
its edge yields to a line load by the hardness 3 σ_y with some 20 N/µm.
"""


def wedged_contact(friction: float) -> tuple[Vector, Vector]:
    """Return ``solref`` and ``solimp`` of a tip on which a hole is wedged from all sides.

    A contact adds mass to what it stops, 2 m d / μ² (1 − d) for the mass m that it moves, with the
    impedance d and a pyramid of friction μ: the usual contact with a pin 2 × 10³ to 5 × 10⁴ m. All
    around a tip that stops a hole as slowly as one contact does, v τ/e deep, but there friction
    holds it against the stiffness of that mass: kilonewtons, by an energy that nobody put in. With
    d such that it is m, a wedge stores less than what came down on it. Steps of 0.11 ms resolve it.
    """
    ratio = 0.5 * friction**2
    d = max(ratio / (1.0 + ratio), _LEAST_IMPEDANCE)
    stiffness, damping = _WEDGED_PER_S2, 2.0 * _WEDGED_DAMPING * math.sqrt(_WEDGED_PER_S2)
    return np.array([-stiffness * d, -damping * d]), np.array([d, d, 2e-5, 0.5, 2.0])


def add_workplace(
    spec: mujoco.MjSpec, layout: LayoutConfig, sheet: Sheet, strips: StripConfig, laid: int
) -> None:
    """Add bed, pins, stand, and room for ``laid`` sheets that rest on the pins."""
    bed, stand = layout.bed, layout.stand
    for name, block, y_m in (("bed", bed, 0.0), ("stand", stand, stand.y_m)):
        spec.worldbody.add_geom(
            name=name,
            type=BOX,
            size=[block.half_length_m, block.half_width_m, block.top_m / 2],
            pos=[0.0, y_m, block.top_m / 2],
            **_touched(RESTING | ARM, bed.friction),
        )
        _show_block(spec, block, y_m)
    _add_bed_camera(spec, bed, sheet)
    diameters = (layout.pins.diameter_m + layout.thicker_m).tolist()
    names, places = layout.holes.names, hole_places(layout.holes)
    for name, diameter_m, (along, across) in zip(names, diameters, places, strict=True):
        pin = msgspec.structs.replace(layout.pins, diameter_m=diameter_m)
        _add_pin(spec, name, pin, np.array([along, across, bed.top_m]))
        _add_contact_sensors(spec, name)
    for number in range(laid):
        _add_laid(spec, number, sheet, strips, bed.friction)


def _touched(by: int, friction: float) -> dict[str, Any]:
    """Return what makes a geom stop what has these collision bits, and invisible."""
    return {"contype": 0, "conaffinity": by, "friction": [friction, 0.005, 0.0001], "group": 3}


def _show_block(spec: mujoco.MjSpec, block: BedConfig | StandConfig, y_m: float) -> None:
    """Show a block as a plate on a column; these touch nothing."""
    plate = min(_PLATE_M, 0.5 * block.top_m)
    column = block.top_m - plate
    for share, height, middle, rgba in (
        (1.0, plate, block.top_m - plate / 2, _PLATE_RGBA),
        (_COLUMN, column, column / 2, _COLUMN_RGBA),
    ):
        spec.worldbody.add_geom(
            type=BOX,
            size=[share * block.half_length_m, share * block.half_width_m, height / 2],
            pos=[0.0, y_m, middle],
            rgba=rgba,
            **DRAWN,
        )


def _add_bed_camera(spec: mujoco.MjSpec, bed: BedConfig, sheet: Sheet) -> None:
    """Add the camera ``bed``: from the front and above, by the sheet's length."""
    away, down = 1.6 * sheet.length_m, math.radians(38.0)
    above = -0.07 * sheet.length_m + away * math.sin(down)
    spec.worldbody.add_camera(
        name="bed",
        pos=[0.0, -away * math.cos(down), bed.top_m + above],
        xyaxes=[1.0, 0.0, 0.0, 0.0, math.sin(down), math.cos(down)],
        fovy=42.0,
    )


def _add_contact_sensors(spec: mujoco.MjSpec, name: str) -> None:
    """Measure the force on a pin, the largest one of a single contact, and the deepest contact."""
    data, least, largest, net = mujoco.mjtConDataField, 1, 2, 3
    for kind, field, reduce in (
        ("net", data.mjCONDATA_FORCE, net),
        ("edge", data.mjCONDATA_FORCE, largest),
        ("distance", data.mjCONDATA_DIST, least),
    ):
        sensor = spec.add_sensor(
            name=f"{kind}_{name}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=f"pin_{name}",
        )
        # What is told; how many contacts are reduced, and to one.
        sensor.intprm[:3] = [1 << int(field), reduce, 1]


def _add_pin(spec: mujoco.MjSpec, name: str, pins: PinsConfig, foot_m: Vector) -> None:
    """Add one pin: for contact a capsule, or a cylinder with a truncated cone.

    One that is missing stays in the model, where its sensors tell nothing, but is not to be seen
    and touches nothing.
    """
    body = spec.worldbody.add_body(name=f"pin_{name}", pos=foot_m)
    radius = pins.diameter_m / 2
    missing = name in pins.missing
    shape = {
        **_touched(0 if missing else PINNING | ARM, pins.friction),
        **_PIN_CONTACT,
        "name": f"pin_{name}",
        "rgba": [0.80, 0.65, 0.25, 1.0],
        "group": 3 if missing else 2,
    }
    if pins.tip == "round":
        # The foot's hemisphere is inside the bed.
        half = (pins.height_m - radius) / 2
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[radius, half, 0.0],
            pos=[0.0, 0.0, half],
            **shape,
        )
        return
    shaft = pins.height_m - pins.taper_length_m
    rim = np.array([(math.cos(a), math.sin(a)) for a in np.arange(24) * math.pi / 12])
    rings = [(0.0, radius), (shaft, radius), (pins.height_m, radius / 3)]
    vertices = np.array([(*(r * xy), z) for z, r in rings for xy in rim])
    spec.add_mesh(name=f"pin_{name}", uservert=vertices.ravel())
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"pin_{name}", **shape)


def laid_body(number: int, strip: int) -> str:
    """Name of the body that stands for one strip of a sheet that was laid before."""
    return f"laid_{number}_{strip:02d}"


def _add_laid(
    spec: mujoco.MjSpec, number: int, sheet: Sheet, strips: StripConfig, friction: float
) -> None:
    """Add a laid sheet, strip by strip, to be put where the simulated one came to rest.

    A laid sheet stays fixed, and the next one touches its upper face. The plates reach into the
    bed, since a time step could miss a contact half a millimetre thick.
    """
    h = sheet.length_m / strips.hinges
    for i in range(strips.hinges + 1):
        length = h / 2 if i in (0, strips.hinges) else h
        body = spec.worldbody.add_body(
            name=laid_body(number, i), mocap=True, pos=[0.0, 0.0, _BELOW_FLOOR_M]
        )
        half = sheet.thickness_m / 2
        size = [length / 2, sheet.width_m / 2, half]
        body.add_geom(type=BOX, size=size, rgba=[0.45, 0.60, 0.80, 1.0], **DRAWN)
        body.add_geom(
            type=BOX,
            size=[*size[:2], _LAID_DEPTH_M / 2],
            pos=[0.0, 0.0, half - _LAID_DEPTH_M / 2],
            **_touched(RESTING | LAID, friction),
        )
