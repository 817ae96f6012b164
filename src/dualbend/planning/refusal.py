"""The range of bending angles, or a refusal that says what is missing and what would do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import msgspec

from dualbend.errors import InputError
from dualbend.planning.geometry import lowest_rim
from dualbend.planning.layout import Layout, check_layout
from dualbend.planning.range import AngleRange, Failure, falls_to_zero, solve_range
from dualbend.planning.shape import LOWEST_RAD, HangingSheet
from dualbend.scene.bed.config import HolesConfig, PinsConfig

LENGTH_STEP_M: Final = 1e-5
CLEARANCE_STEP_M: Final = 1e-6
"""What is proposed is rounded to these, towards more room."""


def angle_range(layout: Layout) -> AngleRange:
    """Return the range of bending angles of a layout.

    Raises InputError with what is missing in mm and which single number would do instead.
    """
    check_layout(layout)
    found = solve_range(layout)
    if isinstance(found, Failure):
        fixes = [fix for fix, changed in _fixes(layout, found) if _accepted(changed)]
        remedy = f"{' or '.join(fixes)} would do" if fixes else "no single change would do"
        raise InputError(f"{_describe(layout, found)}; {remedy}")
    return found


def _describe(layout: Layout, failure: Failure) -> str:
    """Say what is missing, in mm."""
    holes, pins, shape = layout.holes, layout.pins, failure.shape
    at, mm = f"{shape.alpha_rad:.3f} rad", 1e3
    middle, outer = shape.at(holes.middle.along_m), shape.at(holes.outer.along_m)
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
        nearer = 2.0 * layout.approach_m(middle, holes.middle.along_m) * mm
        return (
            f"holes.middle.along_m = {holes.middle.along_m:g}: the middle holes come {nearer:.3f} "
            f"mm closer at {at}, {clears}, but have {nearer + slack:.3f} mm of room: "
            f"{-slack:.3f} mm missing"
        )
    if failure.reason == "above tips":
        return (
            f"holes.middle.along_m = {holes.middle.along_m:g}: at {at}, {clears}, the middle holes "
            f"are still above the tips of theirs: {-layout.seat_slack_m(shape) * mm:.2f} mm missing"
        )
    offset, slack = layout.approach_m(outer, holes.outer.along_m), layout.guide_slack_m(shape)
    return (
        f"holes.outer.along_m = {holes.outer.along_m:g}: the outer holes are {offset * mm:.2f} mm "
        f"inside of their pins where they reach the tips, at {at}, and a {pins.tip} tip guides "
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


def _fixes(layout: Layout, failure: Failure) -> Iterator[tuple[str, Layout]]:
    """Yield each change of one number that makes the failed inequality an equality.

    The bound is the nearest value that does; much beyond it another inequality may bind.
    """
    holes, pins = layout.holes, layout.pins
    if failure.reason in ("no room", "above tips"):
        s = _rounded(_middle_along(layout, failure.shape), LENGTH_STEP_M, down=True)
        nearer = msgspec.structs.replace(holes.middle, along_m=s)
        changed = msgspec.structs.replace(holes, middle=nearer)
        yield f"holes.middle.along_m <= {s:g}", replace(layout, holes=changed)
    if failure.reason == "no room":
        c = _clearance(layout, failure.shape.alpha_rad, failure.top_rad)
        if c is not None:
            c = _rounded(c, CLEARANCE_STEP_M, down=False)
            changed = msgspec.structs.replace(holes, clearance_m=c)
            yield f"holes.clearance_m >= {c:g}", replace(layout, holes=changed)
    best = falls_to_zero(lambda a: layout.fit_slack_m(layout.hang(a)), LOWEST_RAD, failure.top_rad)
    shape = layout.hang(best)
    if failure.reason != "not guided":
        far = _outer_along(layout, shape)
        if far is not None:
            far = _rounded(far, LENGTH_STEP_M, down=False)
            further = msgspec.structs.replace(holes.outer, along_m=far)
            changed = msgspec.structs.replace(holes, outer=further)
            yield f"holes.outer.along_m >= {far:g}", replace(layout, holes=changed)
    guided = falls_to_zero(lambda a: layout.guide_slack_m(layout.hang(a)), LOWEST_RAD, best)
    height = pins.height_m + min(
        layout.lift_m(shape) - layout.margin_m, layout.lift_m(layout.hang(guided))
    )
    # Where the middle holes are above their tips, lower pins make it worse.
    if LENGTH_STEP_M < height < pins.height_m:
        height = _rounded(height, LENGTH_STEP_M, down=True)
        lower = msgspec.structs.replace(pins, height_m=height)
        yield f"pins.height_m <= {height:g}", replace(layout, pins=lower)


def _rounded(value: float, step: float, *, down: bool) -> float:
    """Round a proposal to whole steps, towards more room."""
    count = math.floor(value / step) if down else math.ceil(value / step)
    return float(f"{count * step:.9g}")


def _middle_along(layout: Layout, shape: HangingSheet) -> float:
    """Return the largest arc length at which the middle pair has room in a shape."""

    def slack(s: float) -> float:
        return min(layout.fit_slack_m(shape, s), layout.seat_slack_m(shape, s))

    return falls_to_zero(slack, 0.0, layout.holes.middle.along_m)


def _outer_along(layout: Layout, shape: HangingSheet) -> float | None:
    """Return the arc length at which the outer holes just clear their pins in a shape."""
    wanted, t = layout.pins.height_m + layout.margin_m, layout.sheet.thickness_m

    def low(s: float) -> float:
        return wanted - lowest_rim(shape.at(s), layout.hole_m, t)

    end = layout.sheet.length_m / 2.0
    return falls_to_zero(low, layout.holes.outer.along_m, end) if low(end) < 0.0 else None


def _clearance(layout: Layout, low: float, top: float) -> float | None:
    """Return the clearance with which the middle pair just fits where the outer holes just clear.

    At an angle α the pair fits with D = (d + t sin θ + 2 (s₀ − X))/cos θ; larger holes also have
    lower rims, so α is where the outer holes of that D are a margin above their pins.
    """
    holes, d, t = layout.holes, layout.pins.diameter_m, layout.sheet.thickness_m
    wanted = layout.pins.height_m + layout.margin_m

    def diameter(shape: HangingSheet) -> float:
        pose = shape.at(holes.middle.along_m)
        closer = 2.0 * layout.approach_m(pose, holes.middle.along_m)
        return (d + t * math.sin(pose.slope_rad) + closer) / math.cos(pose.slope_rad)

    def missing(alpha: float) -> float:
        shape = layout.hang(alpha)
        return wanted - lowest_rim(shape.at(holes.outer.along_m), diameter(shape), t)

    if missing(top) > 0.0:
        return None
    return diameter(layout.hang(falls_to_zero(missing, low, top))) - d
