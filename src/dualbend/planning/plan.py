"""The plan of an assembly on four pins: bend, lower the middle pair, unfold onto the outer pair.

The pins stand where the holes of the flat sheet belong. Bent, the middle pair is a little closer
than its pins, by 2 (s₀ − X(s₀)) ≈ κ² s₀³ / 3, which must be less than the free play of the tilted
holes, and the outer holes hang above the tips of their pins. Unfolding with the middle kept on the
bed lowers them along arcs that come from inside: the tips guide them, and the arms comply along x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar

from dualbend.beam import elastica
from dualbend.beam._check import FloatArray, Real, like, within
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.planning.geometry import interference, tip_guides
from dualbend.planning.layout import Layout
from dualbend.planning.range import AngleRange, highest_angle
from dualbend.planning.refusal import angle_range
from dualbend.planning.shape import LOWEST_RAD, HangingSheet
from dualbend.scene.bed.config import HolesConfig, PinsConfig

PATH_POINTS: Final = 49
"""At equal steps of the bending angle, from the flat sheet to the top of the range."""
INTERFERENCE_SAMPLES: Final = 33


@dataclass(frozen=True, kw_only=True)
class GripPath:
    """Poses of the grips and loads on them over the bending angle.

    half_distance_m is on the zero-moment path, rise_m the height of the grips above the middle,
    which stays where it is. end_force_n (compressive P) and end_moment_nm (M, on the gripper) are
    what the hanging sheet exerts with its weight; below AssemblyPlan.taut_rad P is a pull, unless
    the bed carries the sheet.
    """

    alpha_rad: FloatArray
    half_distance_m: FloatArray
    rise_m: FloatArray
    end_force_n: FloatArray
    end_moment_nm: FloatArray


@dataclass(frozen=True, kw_only=True)
class Unfolding:
    """Descent of the outer holes on their pins.

    From reach_rad, where their rims are level with the tips, each hole is offset_m inside of its
    pin and slides that much outward while the sheet flattens. The tip guides up to guide_m.
    interference_m is the largest overlap of pin and hole on the nominal path, at
    interference_rad: the compliance along x has to take it at the hole, and grip_shift_m at each
    grip if the sheet flattens on its zero-moment path: interference_m (dx/dα) / (dX(s₁)/dα).
    """

    reach_rad: float
    offset_m: float
    guide_m: float
    interference_m: float
    interference_rad: float
    grip_shift_m: float


@dataclass(frozen=True, kw_only=True)
class AssemblyPlan:
    """A layout with its bending angles, the path of the grips, and the outer holes' descent.

    bend_rad is the recommended angle, taut_rad the one below which the hanging sheet's weight
    would pull the grips together (0 without weight).
    """

    layout: Layout
    range: AngleRange
    bend_rad: float
    taut_rad: float
    unfolding: Unfolding
    path: GripPath = field(repr=False)

    def shape(self, alpha: float) -> HangingSheet:
        """Return the sheet at α [rad]."""
        return self.layout.hang(alpha)

    def spacing_m(self, alpha: float) -> float:
        """Return the distance along x of the two middle holes at α, 2 X(s₀) [m]."""
        return 2.0 * self.shape(alpha).at(self.layout.holes.middle.along_m).x_m

    def middle_slack_m(self, alpha: float) -> float:
        """Return the largest offset of the sheet along x at which the middle pair still fits [m].

        Half the free play of a tilted middle hole, less its approach; negative: it does not fit.
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
        unfolding=_unfolding(layout, found.reach_rad),
        path=_path(layout, found.highest_rad),
    )


def plan_summary(plan: AssemblyPlan, alpha: float) -> dict[str, tuple[float, str]]:
    """Return the main numbers of a plan at a bending angle α [rad], each with its unit."""
    path, unfolding = plan.path, plan.unfolding
    force, moment = (
        float(np.interp(alpha, path.alpha_rad, values))
        for values in (path.end_force_n, path.end_moment_nm)
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
    """Return the angle at which the end force is zero; top where the sheet pulls throughout."""
    if not layout.weight:
        return 0.0
    return highest_angle(layout, lambda shape: -shape.end_force_n, LOWEST_RAD, top)


def _path(layout: Layout, top: float) -> GripPath:
    shapes = [layout.hang(float(a)) for a in top * np.linspace(0.0, 1.0, PATH_POINTS)]
    names = [item.name for item in fields(GripPath)]
    return GripPath(**{name: np.array([getattr(h, name) for h in shapes]) for name in names})


def _unfolding(layout: Layout, reach: float) -> Unfolding:
    pins, s, t = layout.pins, layout.holes.outer.along_m, layout.sheet.thickness_m
    pose = layout.hang(reach).at(s)

    def overlap(alpha: float) -> float:
        return interference(layout.hang(alpha).at(s), s, layout.hole_m, t, pins)

    alphas = np.linspace(0.0, reach, INTERFERENCE_SAMPLES)
    values = [overlap(float(a)) for a in alphas]
    best = int(np.argmax(values))
    near = (float(alphas[max(best - 1, 0)]), float(alphas[min(best + 1, alphas.size - 1)]))
    peak = minimize_scalar(
        lambda a: -overlap(float(a)), bounds=near, method="bounded", options={"xatol": 1e-4}
    )
    largest, at = max((values[best], float(alphas[best])), (-float(peak.fun), float(peak.x)))
    return Unfolding(
        reach_rad=reach,
        offset_m=layout.approach_m(pose, s),
        guide_m=tip_guides(pins, layout.hole_m, t, pose.slope_rad),
        interference_m=max(largest, 0.0),
        interference_rad=at,
        grip_shift_m=max(largest, 0.0) * _leverage(layout, at),
    )


def _leverage(layout: Layout, alpha: float) -> float:
    """Return the motion of a grip over that of its outer hole, both along x, on the path."""
    s, L = layout.holes.outer.along_m, layout.sheet.length_m
    low, high = max(0.95 * alpha, LOWEST_RAD), max(1.05 * alpha, 1.1 * LOWEST_RAD)
    grips = elastica.half_distance(high, L) - elastica.half_distance(low, L)
    return grips / (layout.hang(high).at(s).x_m - layout.hang(low).at(s).x_m)
