"""The metrics of an assembly: per phase, per hole, per pin, and whether the holes are seated."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualbend.evaluation.metrics import (
    after_stop_signals,
    common_metrics,
    peak,
    surface_strain,
)
from dualbend.planning.plan import plan_assembly
from dualbend.run.record import Metric, RunRecord
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.program.motions import CHECK
from dualbend.types import SIDES, Vector

OFFSET_BEYOND_CLEARANCE_M = 0.02e-3
"""A seated hole's centre is at most this beyond half the clearance from its pin's axis."""

RESTING_WITHIN_M = 0.5e-3
"""A seated hole is at most this above what its sheet rests on."""


def holes_of(result: RunRecord) -> tuple[str, ...]:
    """Return the names of the holes and pins of a run."""
    return assembly_of(result.scenario).layout.holes.names


def final_holes(result: RunRecord) -> Vector:
    """Return (sheets, n, 3): each hole from its pin's axis, x, y, and above its rest, z [m].

    Of a sheet that was not let go, where it was at the end of the run; of one that was never
    picked up, nothing, nor of a run that ended in its first cycle.
    """
    laid = list(result.laid)
    assembly, names = assembly_of(result.scenario), holes_of(result)
    if len(laid) < assembly.sheets and result.trace.rows:
        columns = [[result.trace[f"hole_{hole}_{axis}"][-1] for axis in "xyz"] for hole in names]
        if np.isfinite(columns).all():
            laid.append(np.array(columns))
    holes = np.array(laid).reshape(len(laid), len(names), 3)
    # Each sheet rests on those before it.
    thickness = result.scenario.true_sheet.thickness_m
    holes[:, :, 2] -= thickness * np.arange(len(laid))[:, np.newaxis]
    return holes


def seated(result: RunRecord) -> NDArray[np.bool_]:
    """Return which holes are seated (sheets, n): around their pins, and resting, and let go."""
    in_place = _in_place(result)
    return in_place & (np.arange(len(in_place))[:, np.newaxis] < len(result.laid))


def not_seated(result: RunRecord, sheet: int) -> str:
    """Return which hole of a sheet that was let go is not seated, and why; of a seated one, ""."""
    there = seated(result)[sheet]
    if there.all():
        return ""
    for missing in assembly_of(result.scenario).layout.pins.missing:
        return f"there is no {missing} pin"
    which = int(np.argmin(there))
    x, y, z = np.round(1e3 * final_holes(result)[sheet, which], 2) + 0.0  # no minus before a zero
    return (
        f"the {holes_of(result)[which]} hole is {np.hypot(x, y):.2f} mm off its pin's axis and "
        f"{z:.2f} mm above its rest"
    )


def _in_place(result: RunRecord) -> NDArray[np.bool_]:
    """Return which holes are around their pins and resting, let go or not (sheets, n).

    None is around a pin that is missing. A pin that is thicker than drawn leaves less clearance.
    """
    holes, layout = final_holes(result), assembly_of(result.scenario).layout
    clearance = layout.holes.clearance_m - layout.thicker_m
    allowed = 0.5 * clearance + OFFSET_BEYOND_CLEARANCE_M
    around = layout.standing & (np.hypot(holes[:, :, 0], holes[:, :, 1]) <= allowed)
    return np.asarray(around & (np.abs(holes[:, :, 2]) <= RESTING_WITHIN_M))


def wrong_checks(result: RunRecord) -> int:
    """Count the sheets on which the program's check of the seats and the truth disagree.

    A sheet that was let go counted as seated; one at which the check stopped the task, as not.
    """
    holes, laid = seated(result), len(result.laid)
    wrong = int((~holes[:laid].all(axis=1)).sum())
    stopped_by_it = result.outcome == "aborted" and result.reason.startswith(CHECK)
    return wrong + int(stopped_by_it and bool(_in_place(result)[laid:].all(axis=1).any()))


def peaks(result: RunRecord) -> dict[str, Vector]:
    """Return the signal (rows,) of which each metric is the largest value, over all phases."""
    trace, holes = result.trace, holes_of(result)
    forces = [[trace[f"{side}_true_force_{axis}"] for axis in "xyz"] for side in SIDES]
    return {
        "peak_moment": np.max([np.abs(trace[f"{side}_true_moment_y"]) for side in SIDES], axis=0),
        "peak_force": np.max([np.linalg.norm(force, axis=0) for force in forces], axis=0),
        "peak_pin_force": np.max([trace[f"pin_force_{hole}"] for hole in holes], axis=0),
        "peak_edge_force": np.max([trace[f"edge_force_{hole}"] for hole in holes], axis=0),
        "peak_penetration": np.max([trace[f"penetration_{hole}"] for hole in holes], axis=0),
        "peak_impact_depth": trace["impact_depth"],
        "peak_surface_strain": surface_strain(result),
        "ik_residual_max": np.abs(trace["ik_position"]),
        **after_stop_signals(result),
    }


def phase_table(result: RunRecord) -> list[dict[str, Any]]:
    """Return each phase in the order in which it was entered, with its time and peaks.

    ``peak_moment`` about the bending axis [N m] and ``peak_force`` [N] on either gripper,
    ``peak_pin_force`` [N].
    """
    trace, signals = result.trace, peaks(result)
    if not trace.rows:
        return []
    # A run that ends in its first cycle has not counted yet.
    attempt, sheet = (np.nan_to_num(trace[name]) for name in ("attempt", "sheet"))
    keys = np.stack([trace["phase"], attempt, sheet])
    starts = np.flatnonzero(np.any(np.diff(keys, prepend=np.nan) != 0.0, axis=0))
    return [
        {
            "phase": result.phases[int(trace["phase"][first])],
            "sheet": int(sheet[first]),
            "attempt": int(attempt[first]),
            "start_s": float(trace["time"][first]),
            "time_s": float((end - first) * result.scenario.period_s),
            "peak_moment_nm": peak(signals["peak_moment"][first:end]),
            "peak_force_n": peak(signals["peak_force"][first:end]),
            "peak_pin_force_n": peak(signals["peak_pin_force"][first:end]),
        }
        for first, end in zip(starts, [*starts[1:], trace.rows], strict=True)
    ]


def sheet_table(result: RunRecord) -> list[dict[str, Any]]:
    """Return each sheet's retries, time and peak pin force [N], and what was learned with it.

    The latter only of sheets that were found seated, where the robots learn.
    """
    phases, rows = phase_table(result), []
    for sheet in range(1 + max((row["sheet"] for row in phases), default=-1)):
        own = [row for row in phases if row["sheet"] == sheet]
        forces = [row["peak_pin_force_n"] for row in own]
        lesson = result.lessons[sheet] if sheet < len(result.lessons) else {}
        rows.append(
            {
                "sheet": sheet,
                "retries": _retries(own),
                "time_s": sum(row["time_s"] for row in own),
                "peak_pin_force_n": max((f for f in forces if f is not None), default=None),
                **lesson,
            }
        )
    return rows


def _retries(phases: list[dict[str, Any]]) -> int:
    return sum(row["attempt"] > 0 for row in phases if "lower" in row["phase"])


def hole_table(result: RunRecord) -> list[dict[str, Any]]:
    """Return each hole's final offset from its pin's axis, height above its rest, and verdict."""
    verdict = seated(result)
    return [
        {
            "sheet": sheet,
            "hole": hole,
            "offset_x_m": float(x),
            "offset_y_m": float(y),
            "offset_m": float(np.hypot(x, y)),
            "height_m": float(z),
            "seated": bool(verdict[sheet, i]),
        }
        for sheet, holes in enumerate(final_holes(result))
        for i, (hole, (x, y, z)) in enumerate(zip(holes_of(result), holes, strict=True))
    ]


def pin_table(result: RunRecord) -> list[dict[str, Any]]:
    """Return each pin's peak force, and the largest force of one contact at its hole's edge."""
    trace = result.trace
    return [
        {
            "pin": hole,
            "peak_force_n": peak(trace[f"pin_force_{hole}"]),
            "peak_edge_force_n": peak(trace[f"edge_force_{hole}"]),
        }
        for hole in holes_of(result)
    ]


def middle_spacing(result: RunRecord) -> float | None:
    """Return the distance along the chord of the outermost middle holes of the bent sheet [m].

    At the end of the first bending, before anything is touched; None where that was not reached, or
    there is but one.
    """
    trace = result.trace
    bent = np.flatnonzero(trace["phase"] == result.phases.index("bend"))
    holes = assembly_of(result.scenario).layout.holes
    places, names = holes.places_of("middle"), holes.names_of("middle")
    ends = np.argmin(places[:, 0]), np.argmax(places[:, 0])
    if not bent.size or ends[0] == ends[1]:
        return None
    nominal = (places[ends[1]] - places[ends[0]]).tolist()
    between = list(nominal)
    for i, axis in enumerate("xy"):
        left, right = (trace[f"hole_{names[end]}_{axis}"][bent[-1]] for end in ends)
        between[i] += right - left
    return float(np.sqrt(between[0] ** 2 + between[1] ** 2 - nominal[1] ** 2))


def metrics(result: RunRecord) -> dict[str, Metric]:
    """Return the metrics of an assembly; forces and moments are those of all phases."""
    signals, config = peaks(result), assembly_of(result.scenario)
    holes, spacing = hole_table(result), middle_spacing(result)
    if spacing is not None:
        sheet = result.scenario.sheet.sheet()
        plan = plan_assembly(sheet, config.layout.holes, config.layout.pins)
        spacing -= plan.spacing_m(result.scenario.path.end_rad)

    def largest(name: str, unit: str) -> Metric:
        return Metric(peak(signals[name]), unit)

    return {
        "holes_seated": Metric(float(seated(result).sum()), "1"),
        "wrong_seat_checks": Metric(float(wrong_checks(result)), "1"),
        "worst_hole_offset": Metric(peak(np.array([h["offset_m"] for h in holes])), "m"),
        "worst_hole_height": Metric(peak(np.array([h["height_m"] for h in holes])), "m"),
        "peak_pin_force": largest("peak_pin_force", "N"),
        "peak_edge_force": largest("peak_edge_force", "N"),
        "peak_penetration": largest("peak_penetration", "m"),
        "peak_impact_depth": largest("peak_impact_depth", "m"),
        "peak_moment": largest("peak_moment", "N m"),
        "peak_force": largest("peak_force", "N"),
        "peak_surface_strain": largest("peak_surface_strain", "1"),
        "yield_strain": Metric(result.scenario.limit_strain, "1"),
        "middle_spacing_error": Metric(spacing, "m"),
        "retries": Metric(float(_retries(phase_table(result))), "1"),
        **{k: v for k, v in common_metrics(result).items() if k != "ik_rotation_residual_max"},
    }


def tables(result: RunRecord) -> dict[str, list[dict[str, Any]]]:
    """Return the tables of phases, sheets, holes and pins."""
    return {
        "phases": phase_table(result),
        "sheets": sheet_table(result),
        "holes": hole_table(result),
        "pins": pin_table(result),
    }
