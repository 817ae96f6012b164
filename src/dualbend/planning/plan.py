"""The plan of an assembly: bend, lower the middle holes, unfold onto the outer ones.

The pins stand where the holes of the flat sheet belong. Bent, a pair of middle holes is a little
closer than its pins, by 2 (s₀ − X(s₀)) ≈ κ² s₀³ / 3, which must be less than the free play of the
tilted holes, and the outer holes hang above the tips of their pins. Unfolding with the middle kept
on the bed lowers them along arcs that come from inside: the tips guide them, and the arms comply
along x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from dualbend.beam import elastica
from dualbend.beam._check import Real, like, within
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.planning.layout import Layout
from dualbend.planning.range import AngleRange, highest_angle
from dualbend.planning.refusal import angle_range
from dualbend.planning.shape import LOWEST_RAD, HangingSheet
from dualbend.scene.bed.config import HolesConfig, PinsConfig

LOAD_POINTS: Final = 49
"""At equal steps of the bending angle, from the flat sheet to the top of the range."""


@dataclass(frozen=True, kw_only=True)
class AssemblyPlan:
    """A layout with its bending angles.

    bend_rad is the recommended angle, taut_rad the one below which the hanging sheet's weight
    would pull the grips together (0 without weight).
    """

    layout: Layout
    range: AngleRange
    bend_rad: float
    taut_rad: float

    def shape(self, alpha: float) -> HangingSheet:
        """Return the sheet at α [rad]."""
        return self.layout.hang(alpha)

    def spacing_m(self, alpha: float) -> float:
        """Return the distance along x of the outermost middle holes at α, 2 X(s₀) of a pair [m]."""
        shape, middle = self.shape(alpha), self.layout.middle
        left, right = (math.copysign(shape.at(abs(s)).x_m, s) for s in (min(middle), max(middle)))
        return right - left

    def uneven_m(self, alpha: float) -> float:
        """Return the height of the highest middle hole above the lowest one at α [m]."""
        shape = self.shape(alpha)
        heights = [shape.at(abs(s)).z_m for s in self.layout.middle]
        return max(heights) - min(heights)

    def middle_slack_m(self, alpha: float) -> float:
        """Return the play ± along x of the sheet on its middle pins [m]; negative: it has none.

        Of a pair: half the free play of a tilted middle hole, less its approach.
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
    min_half_distance_m: float = 0.0,
    share: float = 0.25,
    weight: bool = True,
) -> AssemblyPlan:
    """Return the plan of a layout, in under 0.1 s; another of the same sheet takes a third of it.

    margin_m [m] is kept between the outer holes and the tips of their pins, yield_strain and
    min_half_distance_m [m] (of the grips, where the grippers touch) end the range. The angle
    recommended lies at ``share`` of the range: its lower part, because the lift above the pins
    grows as α while the free play of the middle pair is lost as α². Raises InputError where the
    layout has no range, with what is missing and what would do.
    """
    for name, value, top in (
        ("margin_m", margin_m, math.inf),
        ("share", share, 1.0),
        ("min_half_distance_m", min_half_distance_m, sheet.length_m / 2.0),
    ):
        if not (math.isfinite(value) and 0.0 <= value <= top):
            raise InputError(f"{name} must lie in [0, {top:.6g}], got {value!r}")
    layout = Layout(
        sheet=sheet,
        holes=holes,
        pins=pins,
        margin_m=margin_m,
        yield_strain=yield_strain,
        min_half_distance_m=min_half_distance_m,
        weight=weight,
    )
    found = angle_range(layout)
    return AssemblyPlan(
        layout=layout,
        range=found,
        bend_rad=found.clear_rad + share * (found.highest_rad - found.clear_rad),
        taut_rad=_taut(layout, found.highest_rad),
    )


def plan_summary(plan: AssemblyPlan, alpha: float) -> dict[str, tuple[float, str]]:
    """Return the main numbers of a plan at a bending angle α [rad], each with its unit.

    end_force (compressive P) and end_moment (on the gripper) are what the hanging sheet exerts
    with its weight; below pull_below P is a pull, unless the bed carries the sheet.
    """
    layout, reached = plan.layout, plan.shape(plan.range.reach_rad)
    first = min(layout.outer, key=lambda s: layout.guide_slack_m(reached, s))
    angles = plan.range.highest_rad * np.linspace(0.0, 1.0, LOAD_POINTS)
    loads = [(h.end_force_n, h.end_moment_nm) for h in map(plan.shape, angles.tolist())]
    force, moment = (float(np.interp(alpha, angles, column)) for column in np.transpose(loads))
    distance, height = plan.grip(alpha)
    return {
        "bending_angle": (alpha, "rad"),
        "lowest_angle": (plan.range.clear_rad, "rad"),
        "highest_angle": (plan.range.highest_rad, "rad"),
        "recommended_angle": (plan.bend_rad, "rad"),
        "middle_spacing": (plan.spacing_m(alpha), "m"),
        "middle_slack": (plan.middle_slack_m(alpha), "m"),
        "middle_place": (layout.place_m(plan.shape(alpha)), "m"),
        "outer_lift_above_tips": (plan.outer_lift_m(alpha), "m"),
        "grip_half_distance": (distance, "m"),
        "grip_height_above_middle": (height, "m"),
        "end_force": (force, "N"),
        "end_moment": (moment, "N m"),
        "pull_below": (plan.taut_rad, "rad"),
        "outer_reach_tips_at": (plan.range.reach_rad, "rad"),
        "outer_offset_there": (layout.offset_m(reached, first), "m"),
        "tip_guides_up_to": (layout.guide_m(reached.at(abs(first))), "m"),
    }


def _taut(layout: Layout, top: float) -> float:
    """Return the angle at which the end force is zero; top where the sheet pulls throughout."""
    if not layout.weight:
        return 0.0
    return highest_angle(layout, lambda shape: -shape.end_force_n, LOWEST_RAD, top)
