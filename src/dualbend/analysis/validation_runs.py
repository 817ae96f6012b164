"""The shipped scenarios, run once each, against the oracle and against each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from dualbend.analysis.metrics import bending_rows, compute_metrics, peak_by_piece
from dualbend.analysis.validation_row import Row, absolute, at_least, at_most
from dualbend.beam import rod
from dualbend.beam.path import PiecewiseLinearPath
from dualbend.run.runner import BendingRun, RunResult
from dualbend.run.scenario import list_scenarios, load_scenario
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scene.cell import SIDES
from dualbend.task.bending import make_path

Vector = NDArray[np.float64]

IK_TOLERANCE = 1e-5
_EVERY = 4
"""Every which command cycle is compared with the oracle."""


def run_shipped() -> dict[str, RunResult]:
    """Run every shipped scenario, by name."""
    return {name: BendingRun(load_scenario(name)).run() for name in list_scenarios()}


def residual_rows(runs: Mapping[str, RunResult]) -> Iterator[Row]:
    """Judge outcomes and IK residuals over all runs; a residual never reached is a NaN."""
    unexpected = sum(not run.expected for run in runs.values())
    yield absolute("shipped scenarios that end unexpectedly", unexpected, 0.0, "1", 0.0)
    for column, unit in (("ik_position", "m"), ("ik_rotation", "rad")):
        worst = max(_largest(run.trace[column]) for run in runs.values())
        name = f"IK residual in shipped scenarios, {column.removeprefix('ik_')}"
        yield absolute(name, worst, 0.0, unit, IK_TOLERANCE)


def _largest(values: Vector) -> float:
    """Return the largest |value| of what was recorded; a run that stopped leaves NaN at its end."""
    return float(np.nanmax(np.abs(values), initial=-math.inf))


def oracle_moments(result: RunResult, place: str, rows: NDArray[np.int_]) -> Vector:
    """Return the oracle's moment on the left gripper at recorded poses (rows,) [N m]; NaN unsolved.

    ``place`` is "grip" (the arms') or "edge" (the sheet's, behind the pads). The rod has the
    sheet's weight and axial stiffness.
    """
    sheet, trace = result.scenario.sheet.sheet(), result.trace
    left, right = (
        np.column_stack([trace[f"{side}_{place}_{part}"][rows] for part in ("x", "z", "alpha")])
        for side in SIDES
    )
    # The right arm's bending frame looks the other way: its x is minus the planar frame's.
    pairs = [
        (rod.Grip(*a), rod.Grip(-b[0], b[1], b[2]))
        for a, b in zip(left.tolist(), right.tolist(), strict=True)
    ]
    states = rod.follow_planar(
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        pairs,
        sheet.weight_per_length_n_per_m,
        axial_stiffness_n=sheet.axial_stiffness_n,
    )
    return np.array([s.left.moment_nm if s.converged else np.nan for s in states])


def moment_rows(fig6: RunResult) -> Iterator[Row]:
    """Compare the moment of a run without compliance with the oracle, over its first peak.

    At the sheet's own edges the strips alone differ; at the grippers' poses the pads' compliance
    is in between, which the oracle does not know.
    """
    bending = np.flatnonzero(bending_rows(fig6))
    moment = fig6.trace["left_true_moment_y"]
    peak = _first_peak(fig6)
    for place, limit, words in (("grip", 0.10, "grippers' poses"), ("edge", 0.03, "edges' poses")):
        rows = bending[::_EVERY]
        error = np.abs(moment[rows] - oracle_moments(fig6, place, rows)) / peak
        name = f"fig6 moment against the oracle at the {words}, largest error over first peak"
        yield absolute(name, float(np.max(error, initial=-math.inf)), 0.0, "1", limit)
    alpha = fig6.trace["left_grip_alpha"][bending]
    knots = make_path(fig6.scenario.path, fig6.scenario.sheet.length_m).knots[1:-1]
    at_knots = np.interp(knots, alpha, moment[bending], left=math.nan, right=math.nan)
    largest = float(np.max(np.abs(at_knots)))
    yield absolute("fig6 largest moment at inner knots over first peak", largest / peak, 0.0, "1", 0.10)


def _first_peak(run: RunResult) -> float:
    pieces = peak_by_piece(run)
    return pieces[0] if pieces else math.nan


def comparison_rows(runs: Mapping[str, RunResult]) -> Iterator[Row]:
    """Compare what compliance, too much of it, and the exact path make of the moment."""
    plain, compliant = peak_by_piece(runs["fig6"]), peak_by_piece(runs["fig8"])
    ratio = _largest_ratio(runs["fig8"], plain, compliant)
    yield at_most("fig8 over fig6 peak moment, worst piece with compliance", ratio, 0.6, "1")
    yield from oscillation_rows(runs["fig8"], runs["fig9"])
    exact = compute_metrics(runs["exact"])["peak_moment"].value
    peak = exact if isinstance(exact, float) else math.nan
    yield at_most("exact over fig6 peak moment", peak / _first_peak(runs["fig6"]), 0.3, "1")


def _largest_ratio(compliant_run: RunResult, plain: list[float], compliant: list[float]) -> float:
    """Return the largest ratio over the pieces in which an axis complies from their start on."""
    scenario = compliant_run.scenario
    axes = (scenario.compliance.x, scenario.compliance.rotation)
    start = min(axis.from_alpha_rad for axis in axes if axis is not None)
    knots = make_path(scenario.path, scenario.sheet.length_m).knots
    pieces = [k for k in range(len(knots) - 1) if knots[k] >= start - 1e-9]
    if not pieces or max(pieces) >= min(len(plain), len(compliant)):
        return math.nan
    return max(compliant[k] / plain[k] for k in pieces)


def oscillation_rows(fig8: RunResult, fig9: RunResult) -> Iterator[Row]:
    """Judge that a too small B makes the loop oscillate: growth, and a moment far above fig8's.

    A protective stop is such an end too, whatever it leaves of the record.
    """
    metrics = compute_metrics(fig9)
    growth, peak = metrics["oscillation_growth"].value, _peak_from(fig9, 1)
    stopped = fig9.outcome == "protective_stop"
    rate = growth if isinstance(growth, float) else (0.0 if stopped else math.nan)
    bound = 0.0 if stopped else 0.5
    yield at_least("fig9 growth rate of the oscillation", rate, bound, "1/s")
    wanted = 0.0 if stopped else 3.0
    ratio = peak / _peak_from(fig8, 1)
    yield at_least("fig9 over fig8 peak moment from the second piece on", ratio, wanted, "1")


def _peak_from(run: RunResult, piece: int) -> float:
    return max(peak_by_piece(run)[piece:], default=math.nan)


def differing_values(first: RunResult, second: RunResult) -> int:
    """Return how many values of two traces differ, but for the wall clock's; NaN equals NaN."""
    if first.trace.rows != second.trace.rows or first.trace.columns != second.trace.columns:
        return max(first.trace.rows, second.trace.rows) * len(first.trace.columns)
    names = [name for name, _ in first.trace.columns if name not in WALL_CLOCK_COLUMNS]
    pairs = [(first.trace[name], second.trace[name]) for name in names]
    pairs.append((first.trace.qpos, second.trace.qpos))
    return sum(int(np.sum((a != b) & ~(np.isnan(a) & np.isnan(b)))) for a, b in pairs)


def repeat_row(first: RunResult) -> Row:
    """Run a scenario again with its seed and count the values of the trace that differ."""
    second = BendingRun(first.scenario).run()
    name = f"values that differ between two runs of {first.scenario.name} with one seed"
    return absolute(name, differing_values(first, second), 0.0, "1", 0.0)
