"""MuJoCo model of the sheet's holes: metal to their edges, which pins cannot pass.

A hole is a ring of boxes around its circle. Strips without a hole touch pins with their plates;
what a strip with one has outside a square in the ring is filled with boxes as thick as the sheet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise

import mujoco
import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.scene.bed.config import LayoutConfig, hole_places
from dualbend.scene.bed.mjcf import RUBBED
from dualbend.scene.contacts import GRIPPING, PINNING, RESTING
from dualbend.scene.mjcf import BOX, DRAWN, about_z
from dualbend.scene.sheet.strips import StripConfig, strip_body
from dualbend.types import Vector

_RING_SIDES = 32
"""Sides of the polygon around a hole's circle; eight would give 0.2 mm more towards corners."""

_RING_DEPTH_M = 8e-3
"""How far a hole's ring reaches into the sheet, so that few boxes fill the rest; at most up to the
next hole."""

_OVERLAP_M = 2e-5
"""Of ring and filling: no seam for a pin to stand in."""

_HOLE_RGBA, _HOLE_PROUD_M = [0.05, 0.06, 0.08, 1.0], 5e-5

_OF_SHEET = {"mass": 0.0, "conaffinity": 0, "friction": [0.0, 0.005, 0.0001], "group": 3, **RUBBED}
"""What touches bed and pins; theirs is the friction."""

Rectangle = tuple[float, float, float, float]
"""From x, to x, from y, to y [m]."""


def add_holes(spec: mujoco.MjSpec, sheet: Sheet, strips: StripConfig, layout: LayoutConfig) -> None:
    """Add the sheet's holes, and feet to lie on, and let its ends be gripped."""
    h, half_n = sheet.length_m / strips.hinges, strips.hinges // 2
    places = hole_places(layout.holes) + layout.holes.offsets_m
    radius = (layout.pins.diameter_m + layout.holes.clearance_m) / 2
    nearest = min(math.dist(p, q) for p, q in combinations(places, 2))
    depth = min(_RING_DEPTH_M, 0.95 * (nearest - 2.0 * radius))
    for name, (along, across) in zip(layout.holes.names, places, strict=True):
        number = round(along / h)
        body = spec.body(strip_body(half_n + number))
        centre = np.array([along - _origin(number, h), across])
        _add_ring(body, name, radius, depth, sheet.thickness_m, centre)
    half = (radius + depth) * math.cos(math.pi / _RING_SIDES) / math.sqrt(2) - _OVERLAP_M
    squares = [(x - half, x + half, y - half, y + half) for x, y in places.tolist()]
    for end in (0, strips.hinges):
        spec.geom(f"{strip_body(end)}_plate").contype |= GRIPPING
    for number in range(-half_n, half_n + 1):
        i, origin = half_n + number, _origin(number, h)
        body = spec.body(strip_body(i))
        from_m, to_m = np.clip([number - 0.5, number + 0.5], -half_n, half_n) * h
        plate = (float(from_m), float(to_m), -sheet.width_m / 2, sheet.width_m / 2)
        filling = list(without(plate, squares))
        if filling == [plate]:
            spec.geom(f"{strip_body(i)}_plate").contype |= PINNING
        else:
            for part, (x0, x1, y0, y1) in enumerate(filling):
                body.add_geom(
                    name=f"filling_{i:02d}_{part}",
                    type=BOX,
                    size=[(x1 - x0) / 2, (y1 - y0) / 2, sheet.thickness_m / 2],
                    pos=[(x0 + x1) / 2 - origin, (y0 + y1) / 2, 0.0],
                    contype=PINNING,
                    **_OF_SHEET,
                )
        if abs(number) < half_n:
            _add_feet(body, i, sheet, number * h - origin)


def _origin(number: int, h: float) -> float:
    """Return where along the sheet the frame of a strip is: at the hinge towards the middle.

    That of the middle strip, number 0, is at its centre.
    """
    return float(number - 0.5 * np.sign(number)) * h


def without(plate: Rectangle, cut: Sequence[Rectangle]) -> Iterator[Rectangle]:
    """Yield rectangles that fill a plate but for what is cut out, slice by slice along x."""
    from_x, to_x, from_y, to_y = plate
    cut = [
        one
        for one in cut
        if one[0] < to_x and one[1] > from_x and one[2] < to_y and one[3] > from_y
    ]
    edges = {x for one in cut for x in one[:2] if from_x < x < to_x}
    for x0, x1 in pairwise(sorted({from_x, to_x, *edges})):
        y = from_y
        for one in sorted(cut, key=lambda one: one[2]):
            if one[0] >= x1 or one[1] <= x0:
                continue
            if one[2] > y:
                yield x0, x1, y, min(one[2], to_y)
            y = max(y, one[3])
        if y < to_y:
            yield x0, x1, y, to_y


def _add_feet(body: mujoco.MjsBody, strip: int, sheet: Sheet, centre_m: float) -> None:
    for side, sign in (("front", -1.0), ("back", 1.0)):
        body.add_geom(
            name=f"foot_{strip:02d}_{side}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[sheet.thickness_m / 2, 0.0, 0.0],
            pos=[centre_m, sign * 0.4 * sheet.width_m, 0.0],
            contype=RESTING,
            **_OF_SHEET,
        )


def _add_ring(
    body: mujoco.MjsBody,
    name: str,
    radius: float,
    depth_m: float,
    thickness_m: float,
    centre_m: Vector,
) -> None:
    """Add a hole as a ring of boxes."""
    half_side = (radius + depth_m) * math.tan(math.pi / _RING_SIDES)
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
        middle = radius + depth_m / 2
        body.add_geom(
            name=f"hole_{name}_{i:02d}",
            type=BOX,
            size=[depth_m / 2, half_side, thickness_m / 2],
            pos=[*(centre_m + middle * np.array([math.cos(turn), math.sin(turn)])), 0.0],
            quat=about_z(turn),
            contype=PINNING,
            **_OF_SHEET,
        )
