"""The plan of an assembly on four pins: bend, lower the middle pair, unfold onto the outer pair.

The pins stand where the holes of the flat sheet belong. Bent, the middle pair is a little closer
than its pins, by 2 (s₀ − X(s₀)) ≈ κ² s₀³ / 3, which the tilted holes' play has to take, and the
outer holes hang above the tips of theirs. Unfolding with the middle kept on the bed lowers them
along arcs that come from inside: the tips guide them, and the arms' compliance along x gives way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar

from dualbend.beam import elastica
from dualbend.beam._check import FloatArray, Real, like, within
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.planning.geometry import pressed_by, tip_guides
from dualbend.planning.layout import Layout
from dualbend.planning.range import AngleRange, falls_to_zero
from dualbend.planning.refusal import angle_range
from dualbend.planning.shape import LOWEST_RAD, HangingSheet
from dualbend.scene.bed.config import HolesConfig, PinsConfig

WAY_POINTS: Final = 49
"""Equal steps of the bending angle, from the flat sheet to the top of the range."""
PRESS_SAMPLES: Final = 33


@dataclass(frozen=True, kw_only=True)
class AssemblyWay:
    """Grips and loads over the bending angle, upward for bending and downward for unfolding.

    half_distance_m is on the zero-moment path, height_m that of the grips above the middle, which
    stays where it is. end_force_n (compressive P) and end_moment_nm (M, on the gripper) are what
    the hanging sheet exerts with its weight; below AssemblyPlan.taut_rad P is a pull, unless the
    bed carries the sheet.
    """

    alpha_rad: FloatArray
    half_distance_m: FloatArray
    height_m: FloatArray
    end_force_n: FloatArray
    end_moment_nm: FloatArray


@dataclass(frozen=True, kw_only=True)
class Unfolding:
    """How the outer holes come down on their pins.

    From reach_rad, where their rims are level with the tips, each hole is offset_m inside of its
    pin and slides that much outward on the way to the flat sheet. The tip guides up to guide_m.
    pressed_m is the most that the pin is ahead of the hole's wall on the nominal path, at
    pressed_rad: the x compliance has to take it at the hole, and grip_shift_m at each grip if the
    sheet flattens on its zero-moment path: pressed_m (dx/dα) / (dX(s₁)/dα).
    """

    reach_rad: float
    offset_m: float
    guide_m: float
    pressed_m: float
    pressed_rad: float
    grip_shift_m: float


@dataclass(frozen=True, kw_only=True)
class AssemblyPlan:
    """A layout with its bending angles, the way of the grips, and the outer holes' descent.

    bend_rad is the recommended angle, taut_rad the one below which the hanging sheet's weight
    would pull the grips together (0 without weight).
    """

    layout: Layout
    range: AngleRange
    bend_rad: float
    taut_rad: float
    unfolding: Unfolding
    way: AssemblyWay = field(repr=False)

    def shape(self, alpha: float) -> HangingSheet:
        """Return the sheet at α [rad]."""
        return self.layout.hang(alpha)

    def spacing_m(self, alpha: float) -> float:
        """Return the distance along x of the two middle holes at α, 2 X(s₀) [m]."""
        return 2.0 * self.shape(alpha).at(self.layout.holes.middle.along_m).x_m

    def middle_slack_m(self, alpha: float) -> float:
        """Return how far the sheet may stand off along x when the middle pair goes on [m].

        Half the free play of a tilted middle hole less its approach; negative: it does not fit.
        """
        return self.layout.fit_slack_m(self.shape(alpha))

    def outer_lift_m(self, alpha: float) -> float:
        """Return how far the rims of the outer holes are above the tips of their pins [m]."""
        return self.layout.lift_m(self.shape(alpha))

    def grip(self, alpha: Real) -> tuple[Real, Real]:
        """Return half distance and height above the middle [m] of the grips at α [rad].

        The middle stays where it is. Takes a float or an array; InputError beyond the range.
        """
        slopes = within("bending angle α [rad]", alpha, 0.0, self.range.highest_rad)
        x = elastica.half_distance(slopes, self.layout.sheet.length_m)
        rises = [self.shape(float(slope)).rise_m for slope in slopes.flat]
        return like(alpha, x), like(alpha, np.reshape(rises, slopes.shape))


def plan_assembly(
    sheet: Sheet,
    holes: HolesConfig,
    pins: PinsConfig,
    *,
    margin_m: float = 1e-3,
    yield_strain: float | None = None,
    least_half_distance_m: float = 0.0,
    share: float = 0.25,
    weight: bool = True,
) -> AssemblyPlan:
    """Return the plan of a layout, in under 0.1 s; another of the same sheet takes a third of it.

    margin_m [m] is kept between the outer holes and the tips of their pins, yield_strain and
    least_half_distance_m [m] (of the grips, where the grippers touch) end the range. The angle
    recommended lies at ``share`` of the range: its lower part, because the lift above the pins
    grows as α while the room of the middle pair is lost as α².
    Raises InputError for a layout without a range, saying what is missing and what would do.
    """
    for name, value, top in (
        ("margin_m", margin_m, math.inf),
        ("share", share, 1.0),
        ("least_half_distance_m", least_half_distance_m, sheet.length_m / 2.0),
    ):
        if not (math.isfinite(value) and 0.0 <= value <= top):
            raise InputError(f"{name} must lie in [0, {top:.6g}], got {value!r}")
    layout = Layout(
        sheet=sheet,
        holes=holes,
        pins=pins,
        margin_m=margin_m,
        yield_strain=yield_strain,
        least_half_distance_m=least_half_distance_m,
        weight=weight,
    )
    found = angle_range(layout)
    return AssemblyPlan(
        layout=layout,
        range=found,
        bend_rad=found.clear_rad + share * (found.highest_rad - found.clear_rad),
        taut_rad=_taut(layout, found.highest_rad),
        unfolding=_unfolding(layout, found.reach_rad),
        way=_way(layout, found.highest_rad),
    )


def plan_summary(plan: AssemblyPlan, alpha: float) -> dict[str, tuple[float, str]]:
    """Return what matters of a plan for a bending angle α [rad], each with its unit."""
    way, unfolding = plan.way, plan.unfolding
    force, moment = (
        float(np.interp(alpha, way.alpha_rad, values))
        for values in (way.end_force_n, way.end_moment_nm)
    )
    distance, height = plan.grip(alpha)
    return {
        "bending_angle": (alpha, "rad"),
        "lowest_angle": (plan.range.clear_rad, "rad"),
        "highest_angle": (plan.range.highest_rad, "rad"),
        "recommended_angle": (plan.bend_rad, "rad"),
        "middle_spacing": (plan.spacing_m(alpha), "m"),
        "middle_slack": (plan.middle_slack_m(alpha), "m"),
        "outer_lift_above_tips": (plan.outer_lift_m(alpha), "m"),
        "grip_half_distance": (distance, "m"),
        "grip_height_above_middle": (height, "m"),
        "end_force": (force, "N"),
        "end_moment": (moment, "N m"),
        "pull_below": (plan.taut_rad, "rad"),
        "outer_reach_tips_at": (unfolding.reach_rad, "rad"),
        "outer_offset_there": (unfolding.offset_m, "m"),
        "tip_guides_up_to": (unfolding.guide_m, "m"),
    }


def _taut(layout: Layout, top: float) -> float:
    """Return the α at which the end force is none; top where the sheet pulls throughout."""
    if not layout.weight:
        return 0.0
    return falls_to_zero(lambda a: -layout.hang(a).end_force_n, LOWEST_RAD, top)


def _way(layout: Layout, top: float) -> AssemblyWay:
    alpha = top * np.linspace(0.0, 1.0, WAY_POINTS)
    shapes = [layout.hang(float(a)) for a in alpha]
    return AssemblyWay(
        alpha_rad=alpha,
        half_distance_m=np.array([shape.half_distance_m for shape in shapes]),
        height_m=np.array([shape.rise_m for shape in shapes]),
        end_force_n=np.array([shape.end_force_n for shape in shapes]),
        end_moment_nm=np.array([shape.end_moment_nm for shape in shapes]),
    )


def _unfolding(layout: Layout, reach: float) -> Unfolding:
    pins, s, t = layout.pins, layout.holes.outer.along_m, layout.sheet.thickness_m
    pose = layout.hang(reach).at(s)

    def pressed(alpha: float) -> float:
        return pressed_by(layout.hang(alpha).at(s), s, layout.hole_m, t, pins)

    alphas = np.linspace(0.0, reach, PRESS_SAMPLES)
    values = [pressed(float(a)) for a in alphas]
    best = int(np.argmax(values))
    near = (float(alphas[max(best - 1, 0)]), float(alphas[min(best + 1, alphas.size - 1)]))
    peak = minimize_scalar(
        lambda a: -pressed(float(a)), bounds=near, method="bounded", options={"xatol": 1e-4}
    )
    most, at = max((values[best], float(alphas[best])), (-float(peak.fun), float(peak.x)))
    return Unfolding(
        reach_rad=reach,
        offset_m=layout.approach_m(pose, s),
        guide_m=tip_guides(pins, layout.hole_m, t, pose.slope_rad),
        pressed_m=max(most, 0.0),
        pressed_rad=at,
        grip_shift_m=max(most, 0.0) * _leverage(layout, at),
    )


def _leverage(layout: Layout, alpha: float) -> float:
    """Return how far a grip moves for a move of its outer hole, both along x, on the path."""
    s, L = layout.holes.outer.along_m, layout.sheet.length_m
    low, high = max(0.95 * alpha, LOWEST_RAD), max(1.05 * alpha, 1.1 * LOWEST_RAD)
    grips = elastica.half_distance(high, L) - elastica.half_distance(low, L)
    return grips / (layout.hang(high).at(s).x_m - layout.hang(low).at(s).x_m)
