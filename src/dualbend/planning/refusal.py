"""Refusal of a layout without a range of bending angles: what is missing, and what would do."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, Literal

import msgspec

from dualbend.errors import InputError
from dualbend.planning.geometry import lowest_rim
from dualbend.planning.layout import Layout, check_layout
from dualbend.planning.range import AngleRange, Failure, falls_to_zero, highest_angle, solve_range
from dualbend.planning.shape import LOWEST_RAD, HangingSheet
from dualbend.scene.bed.config import HolesConfig, PinsConfig

LENGTH_STEP_M: Final = 1e-5
CLEARANCE_STEP_M: Final = 1e-6
"""Proposed values are rounded to multiples of these, towards more clearance."""


def angle_range(layout: Layout) -> AngleRange:
    """Return the range of bending angles of a layout.

    Raises InputError where there is none, with what is missing [mm] and which number would do.
    """
    check_layout(layout)
    found = solve_range(layout)
    if isinstance(found, Failure):
        fixes = [fix for fix, changed in _proposals(layout, found) if _accepted(changed)]
        none = "no single change" if layout.holes.each is None else "no change but of places alone"
        remedy = f"{' or '.join(fixes) or none} would do"
        raise InputError(f"{_missing(layout, found)}; {remedy}")
    return found


def _missing(layout: Layout, failure: Failure) -> str:
    """Say what is missing, in mm."""
    holes, pins, shape = layout.holes, layout.pins, failure.shape
    at, mm = f"{shape.alpha_rad:.3f} rad", 1e3
    middle, outer = (
        ("holes.each", "holes.each")
        if holes.each is not None
        else tuple(f"{key}.along_m = {pair.along_m:g}" for key, pair in holes.listed)
    )
    clears = f"where the outer holes clear their pins by {layout.margin_m * mm:.2f} mm"
    if failure.reason == "too high":
        lift, margin = layout.lift_m(shape) * mm, layout.margin_m * mm
        return (
            f"pins.height_m = {pins.height_m:g}: the outer holes are {lift:.2f} mm above the tips "
            f"at {at}, the largest bending angle ({failure.limit}), and need {margin:.2f} mm: "
            f"{margin - lift:.2f} mm missing"
        )
    if failure.reason == "no room":
        slack = 2.0 * layout.fit_slack_m(shape) * mm
        shifts = [layout.shift_m(shape.at(abs(s)), s) for s in layout.middle]
        nearer = (max(shifts) - min(shifts)) * mm
        return (
            f"{middle}: the middle holes come {nearer:.3f} "
            f"mm closer at {at}, {clears}, but have {nearer + slack:.3f} mm of room: "
            f"{-slack:.3f} mm missing"
        )
    if failure.reason == "above tips":
        return (
            f"{middle}: at {at}, {clears}, the middle holes "
            f"are still above the tips of theirs: {-layout.seat_slack_m(shape) * mm:.2f} mm missing"
        )
    slack = layout.guide_slack_m(shape, failure.outer_m)
    offset = layout.offset_m(shape, failure.outer_m)
    return (
        f"{outer}: the outer holes are {offset * mm:.2f} mm "
        f"off their pins where they reach the tips, at {at}, and a {pins.tip} tip guides "
        f"{(offset + slack) * mm:.2f} mm: {-slack * mm:.2f} mm missing"
    )


def _accepted(layout: Layout) -> bool:
    """Say whether a scenario could have this layout, and has a range then."""
    try:
        msgspec.convert(msgspec.to_builtins(layout.holes), HolesConfig)
        msgspec.convert(msgspec.to_builtins(layout.pins), PinsConfig)
        check_layout(layout)
        return isinstance(solve_range(layout), AngleRange)
    except (InputError, msgspec.ValidationError):
        return False


def _proposals(layout: Layout, failure: Failure) -> Iterator[tuple[str, Layout]]:
    """Yield each change of one number that makes the failed inequality an equality.

    The bound is the nearest value that does; much beyond it another inequality may bind.
    """
    pins, reason, top = layout.pins, failure.reason, failure.top_rad
    pairs = layout.holes.each is None
    if pairs and reason in ("no room", "above tips"):
        s = _middle_along(layout, failure.shape)
        yield _proposal(layout, "holes.middle.along_m", "<=", s, LENGTH_STEP_M)
    if reason == "no room":
        c = _clearance(layout, failure.shape.alpha_rad, top)
        if c is not None:
            yield _proposal(layout, "holes.clearance_m", ">=", c, CLEARANCE_STEP_M)
    best = highest_angle(layout, layout.fit_slack_m, LOWEST_RAD, top)
    shape = layout.hang(best)
    if pairs and reason != "not guided":
        far = _outer_along(layout, shape)
        if far is not None:
            yield _proposal(layout, "holes.outer.along_m", ">=", far, LENGTH_STEP_M)
    guided = layout.hang(highest_angle(layout, layout.guide_slack_m, LOWEST_RAD, best))
    height = pins.height_m + min(layout.lift_m(shape) - layout.margin_m, layout.lift_m(guided))
    # Where the middle holes are above their tips, lower pins make it worse.
    if LENGTH_STEP_M < height < pins.height_m:
        yield _proposal(layout, "pins.height_m", "<=", height, LENGTH_STEP_M)


def _proposal(
    layout: Layout, key: str, bound: Literal["<=", ">="], value: float, step: float
) -> tuple[str, Layout]:
    """Round a bound to whole steps, towards more clearance; return it in words and applied."""
    count = math.floor(value / step) if bound == "<=" else math.ceil(value / step)
    rounded = float(f"{count * step:.9g}")
    return f"{key} {bound} {rounded:g}", _with_value(layout, key, rounded)


def _with_value(layout: Layout, key: str, value: float) -> Layout:
    """Return a layout with the number changed that a key names, holes.middle.along_m say."""
    part, *inner, name = key.split(".")
    struct, changed = getattr(layout, part), {name: value}
    for pair in inner:
        changed = {pair: msgspec.structs.replace(getattr(struct, pair), **changed)}
    given: dict[str, Any] = {part: msgspec.structs.replace(struct, **changed)}
    return replace(layout, **given)


def _middle_along(layout: Layout, shape: HangingSheet) -> float:
    """Return the largest arc length at which the middle pair fits over its pins in a shape."""

    def slack(s: float) -> float:
        moved = _with_value(layout, "holes.middle.along_m", s)
        return min(moved.fit_slack_m(shape), moved.seat_slack_m(shape))

    return falls_to_zero(slack, 0.0, layout.holes.middle.along_m)


def _outer_along(layout: Layout, shape: HangingSheet) -> float | None:
    """Return the arc length at which the outer holes just clear their pins in a shape."""
    wanted, t = layout.pins.height_m + layout.margin_m, layout.sheet.thickness_m

    def low(s: float) -> float:
        return wanted - lowest_rim(shape.at(s), layout.hole_m, t)

    end = layout.sheet.length_m / 2.0
    return falls_to_zero(low, layout.holes.outer.along_m, end) if low(end) < 0.0 else None


def _clearance(layout: Layout, low: float, top: float) -> float | None:
    """Return the clearance with which the middle holes just fit where the outer ones just clear.

    At an angle α a pair fits with D = (d + t sin θ + 2 (s₀ − X))/cos θ, two others with the means
    of sin θ and cos θ and what their shifts differ by; larger holes also have lower rims, so α is
    where the outer holes of that D are a margin above their pins.
    """
    d, t = layout.pins.diameter_m, layout.sheet.thickness_m
    wanted = layout.pins.height_m + layout.margin_m

    def diameter(shape: HangingSheet) -> float:
        poses = [shape.at(abs(s)) for s in layout.middle]
        shifts = map(layout.shift_m, poses, layout.middle)
        holes = [(p.slope_rad, shift) for p, shift in zip(poses, shifts, strict=True)]
        return max(
            (2.0 * d + t * (math.sin(a) + math.sin(b)) + 2.0 * abs(p - q))
            / (math.cos(a) + math.cos(b))
            for (a, p), (b, q) in itertools.combinations_with_replacement(holes, 2)
        )

    def missing(shape: HangingSheet) -> float:
        rims = (lowest_rim(shape.at(abs(s)), diameter(shape), t) for s in layout.outer)
        return wanted - min(rims)

    if missing(layout.hang(top)) > 0.0:
        return None
    return diameter(layout.hang(highest_angle(layout, missing, low, top))) - d
