"""Which bending angles put a sheet on its pins, or what fails where none does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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

    reach_rad: unfolding, the rims of the outer holes come level with the tips. clear_rad: they
    are margin_m above. fit_rad: the middle pair has no room left. seat_rad: the middle holes are
    level with their tips. yield_rad (None: not given, or beyond the rest) and grippers_rad: the
    sheet yields, the grippers meet. fit_rad and seat_rad are HIGHEST_RAD where nothing binds.
    """

    reach_rad: float
    clear_rad: float
    fit_rad: float
    seat_rad: float
    yield_rad: float | None
    grippers_rad: float
    highest_rad: float
    limit: Limit


@dataclass(frozen=True, kw_only=True)
class Failure:
    """Why there is no range: the angle it fails at, the shape there, the top of the search."""

    reason: Reason
    shape: HangingSheet
    top_rad: float
    limit: Limit


def solve_range(layout: Layout) -> AngleRange | Failure:
    """Return the range of a layout that check_layout passes, or the first thing that fails."""
    strained = _yield_angle(layout)
    met = elastica.end_slope_from_half_distance(layout.least_half_distance_m, layout.sheet.length_m)
    top, limit = _top(strained, met)
    at_top = layout.hang(top)
    if layout.lift_m(at_top) < layout.margin_m:
        return Failure(reason="too high", shape=at_top, top_rad=top, limit=limit)
    clear = _rises_to(layout, layout.margin_m, top)
    reach = _rises_to(layout, 0.0, clear)
    at_clear, at_reach = layout.hang(clear), layout.hang(reach)
    slacks: tuple[tuple[Reason, float, HangingSheet], ...] = (
        ("no room", layout.fit_slack_m(at_clear), at_clear),
        ("above tips", layout.seat_slack_m(at_clear), at_clear),
        ("not guided", layout.guide_slack_m(at_reach), at_reach),
    )
    for reason, slack, shape in slacks:
        if slack < 0.0:
            return Failure(reason=reason, shape=shape, top_rad=top, limit=limit)
    fit = falls_to_zero(lambda a: layout.fit_slack_m(layout.hang(a)), clear, HIGHEST_RAD)
    seat = falls_to_zero(lambda a: layout.seat_slack_m(layout.hang(a)), clear, HIGHEST_RAD)
    ends: list[tuple[float, Limit]] = [(top, limit), (fit, "middle pair"), (seat, "pin height")]
    highest, limit = min(ends, key=lambda end: end[0])
    return AngleRange(
        reach_rad=reach,
        clear_rad=clear,
        fit_rad=fit,
        seat_rad=seat,
        yield_rad=strained,
        grippers_rad=met,
        highest_rad=highest,
        limit=limit,
    )


def falls_to_zero(slack: Callable[[float], float], low: float, high: float) -> float:
    """Return the root in [low, high] of a falling function: high if none is left, low if below."""
    if slack(high) >= 0.0:
        return high
    return float(brentq(slack, low, high, xtol=ANGLE_TOLERANCE_RAD)) if slack(low) > 0.0 else low


def _yield_angle(layout: Layout) -> float | None:
    strain = layout.yield_strain
    if strain is None:
        return None
    if not strain > 0.0:
        raise InputError(f"yield_strain must be above 0, got {strain!r}")
    found = falls_to_zero(lambda a: strain - layout.hang(a).strain, LOWEST_RAD, HIGHEST_RAD)
    return found if found < HIGHEST_RAD else None


def _top(strained: float | None, met: float) -> tuple[float, Limit]:
    """Return the largest bending angle that the sheet and the grippers allow, and its reason."""
    candidates: list[tuple[float, Limit]] = [(HIGHEST_RAD, "upright ends"), (met, "grippers")]
    if strained is not None:
        candidates.append((strained, "yield"))
    return min(candidates, key=lambda end: end[0])


def _rises_to(layout: Layout, lift_m: float, top: float) -> float:
    """Return the smallest α with the given lift, which is reached at top."""
    low = min(LOWEST_RAD, top)
    return falls_to_zero(lambda a: lift_m - layout.lift_m(layout.hang(a)), low, top)
