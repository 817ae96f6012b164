"""MuJoCo model of assembly bed, alignment pins and pick-up stand, and of the sheet's holes."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.scene.bed.config import (
    HOLES,
    BedConfig,
    LayoutConfig,
    PinsConfig,
    StandConfig,
    hole_places,
)
from dualbend.scene.contacts import ARM, GRIPPING, LAID, PINNING, RESTING
from dualbend.scene.mjcf import BOX, DRAWN, about_z
from dualbend.scene.sheet.strips import StripConfig, strip_body
from dualbend.types import Vector

_RING_SIDES = 32
"""Sides of the polygon around a hole's circle; eight would give 0.2 mm more towards corners."""

_RING_DEPTH_M = 8e-3
"""How far the hole's ring reaches into the sheet: a hole that far off its pin still rests on it."""

_BELOW_FLOOR_M, _LAID_DEPTH_M = -1.0, 5e-3

_PLATE_M, _COLUMN = 0.02, 0.7
"""Bed and stand are drawn as a plate this thick, on a column of this share of its sides."""

_PLATE_RGBA, _COLUMN_RGBA = [0.62, 0.64, 0.67, 1.0], [0.24, 0.26, 0.30, 1.0]
_HOLE_RGBA, _HOLE_PROUD_M = [0.05, 0.06, 0.08, 1.0], 5e-5

_PIN_SOLIMP = [0.98, 0.999, 2e-5, 0.5, 2.0]

_RUBBED = {"condim": 3, "solref": [0.0035, 1.0]}
"""A contact with dry friction, two steps of 1.75 ms long: the stiffest that a step resolves."""

_OF_SHEET = {"mass": 0.0, "conaffinity": 0, "friction": [0.0, 0.005, 0.0001], "group": 3, **_RUBBED}
"""What touches bed and pins; of two coefficients of friction the larger counts: theirs."""


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
    for name, (along, across) in zip(HOLES, hole_places(layout.holes), strict=True):
        _add_pin(spec, name, layout.pins, np.array([along, across, bed.top_m]))
        _add_force_sensors(spec, name)
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


def _add_force_sensors(spec: mujoco.MjSpec, name: str) -> None:
    """Measure the force on a pin, and the largest one of a single contact, at the hole's edge."""
    for kind, reduce in (("net", 3), ("edge", 2)):
        sensor = spec.add_sensor(
            name=f"{kind}_{name}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=f"pin_{name}",
        )
        # Data: force; how many contacts are reduced, and to one.
        sensor.intprm[:3] = [1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), reduce, 1]


def _add_pin(spec: mujoco.MjSpec, name: str, pins: PinsConfig, foot_m: Vector) -> None:
    """Add one pin: for contact a capsule, or a cylinder with a truncated cone."""
    body = spec.worldbody.add_body(name=f"pin_{name}", pos=foot_m)
    radius = pins.diameter_m / 2
    shape = {
        **_touched(PINNING | ARM, pins.friction),
        **_RUBBED,
        "name": f"pin_{name}",
        "solimp": _PIN_SOLIMP,
        "rgba": [0.80, 0.65, 0.25, 1.0],
        "group": 2,
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


def add_holes(spec: mujoco.MjSpec, sheet: Sheet, strips: StripConfig, layout: LayoutConfig) -> None:
    """Add the sheet's holes, and feet to lie on, and let its ends be gripped."""
    h = sheet.length_m / strips.hinges
    places = hole_places(layout.holes) + np.array(layout.holes.errors_m)
    for name, (along, across) in zip(HOLES, places, strict=True):
        number = round(along / h)
        body = spec.body(strip_body(strips.hinges // 2 + number))
        # A strip's frame is at the hinge towards the middle, the middle strip's at its centre.
        offset = along - (number - 0.5 * np.sign(number)) * h
        _add_ring(body, name, layout, sheet.thickness_m, np.array([offset, across]))
    for end in (0, strips.hinges):
        spec.geom(f"{strip_body(end)}_plate").contype |= GRIPPING
    for i in range(1, strips.hinges):
        body = spec.body(strip_body(i))
        centre = 0.5 * h * np.sign(i - strips.hinges // 2)
        for side, sign in (("front", -1.0), ("back", 1.0)):
            body.add_geom(
                name=f"foot_{i:02d}_{side}",
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[sheet.thickness_m / 2, 0.0, 0.0],
                pos=[centre, sign * 0.4 * sheet.width_m, 0.0],
                contype=RESTING,
                **_OF_SHEET,
            )


def _add_ring(
    body: mujoco.MjsBody, name: str, layout: LayoutConfig, thickness_m: float, centre_m: Vector
) -> None:
    """Add a hole as a ring of boxes."""
    radius = (layout.pins.diameter_m + layout.holes.clearance_m) / 2
    half_side = (radius + _RING_DEPTH_M) * math.tan(math.pi / _RING_SIDES)
    body.add_site(name=f"hole_{name}", pos=[*centre_m, 0.0], group=4, size=[radius] * 3)
    # The hole is drawn as a dark disc, hardly proud of the sheet's faces.
    body.add_geom(
        name=f"hole_{name}_disc",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, thickness_m / 2 + _HOLE_PROUD_M, 0.0],
        pos=[*centre_m, 0.0],
        mass=0.0,
        rgba=_HOLE_RGBA,
        **DRAWN,
    )
    for i in range(_RING_SIDES):
        turn = 2.0 * math.pi * i / _RING_SIDES
        middle = radius + _RING_DEPTH_M / 2
        body.add_geom(
            name=f"hole_{name}_{i:02d}",
            type=BOX,
            size=[_RING_DEPTH_M / 2, half_side, thickness_m / 2],
            pos=[*(centre_m + middle * np.array([math.cos(turn), math.sin(turn)])), 0.0],
            quat=about_z(turn),
            contype=PINNING,
            solimp=_PIN_SOLIMP,
            **_OF_SHEET,
        )
