"""Free play of a tilted hole over a pin, and guidance of a hole by the pin's tip.

Planar, on the outer side: x from the middle outward, z upward, slope θ ≥ 0 rising outward. The
middle's lower face rests on the bed, so a point of the mid-surface stands t/2 + z above it.
"""

from __future__ import annotations

import math
from typing import Final

from dualbend.planning.shape import HolePose
from dualbend.scene.bed.config import PinsConfig

BLUNT: Final = 1.0 / 3.0
"""Radius of the flat end of a tapered tip, over that of the pin (as scene.bed builds it)."""


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
