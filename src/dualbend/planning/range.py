"""Range of the bending angles at which a sheet goes on its pins, or the condition that fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal

from scipy.optimize import brentq

from dualbend.beam import elastica
from dualbend.errors import InputError
from dualbend.planning.layout import Layout
from dualbend.planning.shape import HIGHEST_RAD, LOWEST_RAD, HangingSheet

Limit = Literal["middle pair", "pin height", "yield", "grippers", "upright ends"]
Reason = Literal["too high", "no room", "above tips", "not guided"]
ANGLE_TOLERANCE_RAD: Final = 1e-10


@dataclass(frozen=True, kw_only=True)
class AngleRange:
    """Bending angles [rad]: the range is [clear_rad, highest_rad], limit says what ends it.

    reach_rad: unfolding, the rim of the first outer hole comes level with its tip. clear_rad: they
    are margin_m above. fit_rad: the middle holes have no free play left; HIGHEST_RAD where nothing
    binds.
    """

    reach_rad: float
    clear_rad: float
    fit_rad: float
    highest_rad: float
    limit: Limit


@dataclass(frozen=True, kw_only=True)
class Failure:
    """The condition that leaves no range, the shape at which it fails, and the highest angle.

    outer_m: place of the outer hole that is guided worst.
    """

    reason: Reason
    shape: HangingSheet
    outer_m: float
    top_rad: float
    limit: Limit


def solve_range(layout: Layout) -> AngleRange | Failure:
    """Return the range of a layout that check_layout passes, or the first condition that fails."""
    met = elastica.end_slope_from_half_distance(layout.min_half_distance_m, layout.sheet.length_m)
    tops: list[tuple[float, Limit]] = [
        (HIGHEST_RAD, "upright ends"),
        (met, "grippers"),
        (_yield_angle(layout), "yield"),
    ]
    top, limit = min(tops, key=lambda end: end[0])
    fails = partial(Failure, top_rad=top, limit=limit)
    at_top = layout.hang(top)
    if layout.lift_m(at_top) < layout.margin_m:
        return fails(reason="too high", shape=at_top, outer_m=layout.outer[0])
    clear = _lifted(layout, layout.margin_m, top)
    # Each outer hole meets its tip where its own rim is as low.
    tips = {s: _lifted(layout, 0.0, clear, s) for s in layout.outer}
    at_tip = {s: layout.hang(alpha) for s, alpha in tips.items()}
    worst = min(at_tip, key=lambda s: layout.guide_slack_m(at_tip[s], s))
    at_clear = layout.hang(clear)
    checks: list[tuple[Reason, HangingSheet, float]] = [
        ("no room", at_clear, layout.fit_slack_m(at_clear)),
        ("above tips", at_clear, layout.seat_slack_m(at_clear)),
        ("not guided", at_tip[worst], layout.guide_slack_m(at_tip[worst], worst)),
    ]
    for reason, shape, slack in checks:
        if slack < 0.0:
            return fails(reason=reason, shape=shape, outer_m=worst)
    fit = highest_angle(layout, layout.fit_slack_m, clear, HIGHEST_RAD)
    seat = highest_angle(layout, layout.seat_slack_m, clear, HIGHEST_RAD)
    ends: list[tuple[float, Limit]] = [(top, limit), (fit, "middle pair"), (seat, "pin height")]
    highest, limit = min(ends, key=lambda end: end[0])
    return AngleRange(
        reach_rad=max(tips.values()),
        clear_rad=clear,
        fit_rad=fit,
        highest_rad=highest,
        limit=limit,
    )


def falls_to_zero(slack: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a falling function, cut off at the ends of [low, high]."""
    if slack(high) >= 0.0:
        return high
    return float(brentq(slack, low, high, xtol=ANGLE_TOLERANCE_RAD)) if slack(low) > 0.0 else low


def highest_angle(
    layout: Layout, slack: Callable[[HangingSheet], float], low: float, high: float
) -> float:
    """Return the angle in [low, high] up to which a slack is left that falls with the angle."""
    return falls_to_zero(lambda alpha: slack(layout.hang(alpha)), low, high)


def _yield_angle(layout: Layout) -> float:
    """Return the angle at which the sheet yields, or HIGHEST_RAD where it does not."""
    strain = layout.yield_strain
    if strain is None:
        return HIGHEST_RAD
    if not strain > 0.0:
        raise InputError(f"yield_strain must be above 0, got {strain!r}")
    return highest_angle(layout, lambda shape: strain - shape.strain, LOWEST_RAD, HIGHEST_RAD)


def _lifted(layout: Layout, lift_m: float, top: float, *along_m: float) -> float:
    """Return the lowest angle with the given lift of outer holes, which is reached at top."""
    low = min(LOWEST_RAD, top)
    return highest_angle(layout, lambda shape: lift_m - layout.lift_m(shape, *along_m), low, top)
