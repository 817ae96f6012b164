"""Free play of a tilted hole over a pin, guidance by the pin's tip, and play of holes that turn.

Planar, on the outer side: x from the middle outward, z upward, slope θ ≥ 0 rising outward. The
middle's lower face rests on the bed, so a point of the mid-surface stands t/2 + z above it.
"""

from __future__ import annotations

import itertools
import math
from typing import Final, NamedTuple

import numpy as np

from dualbend.planning.shape import HolePose
from dualbend.scene.bed.config import GROUPS, HolesConfig, PinsConfig
from dualbend.types import Vector

BLUNT: Final = 1.0 / 3.0
"""Radius of the flat end of a tapered tip, over that of the pin (as scene.bed builds it)."""


class Circle(NamedTuple):
    """Centre (2,) and radius [m]."""

    centre_m: Vector
    radius_m: float


def smallest_circle(points: Vector) -> Circle:
    """Return the smallest circle around points (k, 2) [m].

    A plate whose holes at these points have the clearance c on pins turns by ± c / (2 R) at most, R
    the circle's radius: turned by ψ about the centre its holes move by ψ times their distance from
    it, each at most by c/2, and about no other place less. So it has c/R from contact to contact;
    two holes 2 s apart have c/s. The circle is that of two of the points or through three of them.
    """
    best = Circle(points[0], math.inf if len(points) > 1 else 0.0)
    for few in (*itertools.combinations(points, 2), *itertools.combinations(points, 3)):
        around = _circle_of(*few)
        away = np.hypot(*(points - around.centre_m).T)
        # Those that it goes through may be off it by rounding.
        if around.radius_m < best.radius_m and (away <= around.radius_m * (1.0 + 1e-9)).all():
            best = around
    return best


def circles(holes: HolesConfig) -> tuple[Circle, Circle]:
    """Return the circles around the middle holes and around the outer ones."""
    middle, outer = (smallest_circle(holes.places_of(group)) for group in GROUPS)
    return middle, outer


def overhangs(holes: HolesConfig, length_m: float) -> tuple[Vector, Vector]:
    """Return how long the sheet is beyond outer holes at its left and right end (2,) [m].

    Beyond the farthest one on that side of its middle, and beyond the nearest.
    """
    along = holes.places_of("outer")[:, 0]
    sides = -along[along < 0.0], along[along > 0.0]
    farthest, nearest = (np.array([of(side) for side in sides]) for of in (np.max, np.min))
    return 0.5 * length_m - farthest, 0.5 * length_m - nearest


def _circle_of(a: Vector, b: Vector, c: Vector | None = None) -> Circle:
    """Return the circle whose diameter is a b, or the one through three points."""
    if c is None:
        return Circle(0.5 * (a + b), 0.5 * math.hypot(*(b - a)))
    p, q = b - a, c - a
    twice = 2.0 * (p[0] * q[1] - p[1] * q[0])
    if not twice:
        return Circle(a, math.inf)
    pp, qq = p @ p, q @ q
    from_a = np.array([q[1] * pp - p[1] * qq, p[0] * qq - q[0] * pp]) / twice
    return Circle(a + from_a, math.hypot(*from_a))


def hole_play(hole_m: float, pin_m: float, thickness_m: float, slope_rad: float) -> float:
    """Return the free play along x of a tilted hole over an upright cylinder [m].

        play = D cos θ − t |sin θ| − d,   negative where the pin does not fit.

    Hole D in a flat plate t, tilted by |θ| < π/2 about the across axis; cylinder d through both
    faces, on the hole's centre line. It is exact. Along the cylinder the two rims appear as
    ellipses, D cos θ / 2 along x by D/2 across, their centres ± t sin θ / 2 apart from the
    hole's: an upright line passes inside the bore (convex) where it passes inside both. Seen from
    a point of the short axis the nearest point of an ellipse is the vertex of that axis, since
    the radius of curvature there, D / (2 cos θ), is longer than the semi-axis. So a disc d fits
    while its centre stays D cos θ / 2 − d/2 from both centres, and it is free to move by
    ± (D cos θ − t |sin θ| − d) / 2 about the hole's centre. For small θ the play is
    D − d − t |θ| − D θ²/2. A pin off the centre line, across, has less.
    """
    return hole_m * math.cos(slope_rad) - thickness_m * abs(math.sin(slope_rad)) - pin_m


def lowest_rim(pose: HolePose, hole_m: float, thickness_m: float) -> float:
    """Return the height above the bed of the lowest point of a hole's rim [m].

    It is the inner edge of the lower face: z + t/2 − (t/2) cos θ − (D/2) sin θ.
    """
    half_t = thickness_m / 2.0
    slope = pose.slope_rad
    return pose.z_m + half_t * (1.0 - math.cos(slope)) - hole_m / 2.0 * math.sin(slope)


def tip_guides(pins: PinsConfig, hole_m: float, thickness_m: float, slope_rad: float) -> float:
    """Return the largest offset of hole to pin [m] from which the tip still guides the hole in.

    With R = (D cos θ − t |sin θ|)/2, half of the hole's opening seen from above, an offset e
    touches the tip at the distance R − e from its axis; beyond R the tip would stand under the
    plate. The hole slides down where the tip is there steeper than the friction angle:

        round:  R − e ≥ r sin(atan μ)     so  e ≤ R − r μ / √(1 + μ²)
        taper:  R − e ≥ r/3 (the flat end), and length / (2 r/3) ≥ μ     so  e ≤ R − r/3;
                a blunter cone guides nothing, e ≤ R − r
    """
    r = pins.diameter_m / 2.0
    half_open = r + hole_play(hole_m, pins.diameter_m, thickness_m, slope_rad) / 2.0
    if pins.tip == "round":
        return half_open - r * math.sin(math.atan(pins.friction))
    steep = pins.taper_length_m >= pins.friction * (1.0 - BLUNT) * r
    return half_open - (BLUNT * r if steep else r)
