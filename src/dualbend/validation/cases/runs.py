"""The shipped scenarios, run once each, against the rod and against each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import mujoco
import numpy as np

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.evaluation.metrics import bending_rows, peak_by_piece
from dualbend.evaluation.recorded_rod import Place, reference_moments
from dualbend.run.arms import arm_pair
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.scene.cell import robots_only
from dualbend.stability.prediction import predict
from dualbend.task.bending import BENDING
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Side, Vector
from dualbend.validation.perfect import PERFECT, perfect_scenario
from dualbend.validation.row import Row, absolute, at_least, at_most, relative

IK_LIMIT = 1e-5
"""Largest residual of position [m] and rotation [rad]."""

LINEAR = ("path.kind=piecewise", "path.interval_rad=0.2", "path.end_rad=1.0")
"""Makes the path of ``exact`` that of ``fig6``, on its own sheet."""

FROM_REST = (
    *("path.start_rad=0.19", "path.end_rad=0.21", "compliance=admittance"),
    *("motion.speed_rad_per_s=0.004", "compliance.tare=true", "compliance.units=paper"),
    *("sensor.force_noise_n=0", "sensor.torque_noise_nm=0"),
    *("sensor.force_resolution_n=0", "sensor.torque_resolution_nm=0"),
)
"""Bent slowly past 0.2 rad, where the compliance begins, with nothing that disturbs it."""


def paper_gains(share: float = 1.0) -> tuple[str, str]:
    """Return settings with a share of the paper's B (26)-(27) on both axes, from 0.2 rad on."""
    text = "compliance.{}={{b={},k={},form='printed',from_alpha_rad=0.2}}"
    return text.format("x", 7.0 * share, 575.0), text.format("rotation", 0.5 * share, 1e4)


def run_shipped() -> dict[str, RunRecord]:
    """Run every shipped scenario that bends the sheet between two grips, by name."""
    shipped = {name: load_scenario(name) for name in list_scenarios()}
    return {
        name: BendingRun(scenario).run()
        for name, scenario in shipped.items()
        if scenario.task.kind == BENDING.kind
    }


def residual_rows(runs: Mapping[str, RunRecord]) -> Iterator[Row]:
    """Check how all runs end, and how far the solved joint angles miss the commanded poses."""
    unexpected = sum(not run.expected for run in runs.values())
    yield absolute("shipped scenarios that end unexpectedly", unexpected, 0.0, "1", 0.0)
    yield from ik_rows("IK residual, all shipped scenarios", *runs.values())


def ik_rows(name: str, *runs: RunRecord) -> Iterator[Row]:
    """Check the largest misses of all grips of some runs."""
    worst = np.max([ik_residuals(run) for run in runs], axis=0)
    for part, miss, unit in zip(("position", "rotation"), worst, ("m", "rad"), strict=True):
        yield absolute(f"{name}, {part}", miss, 0.0, unit, IK_LIMIT)


def ik_residuals(run: RunRecord) -> tuple[float, float]:
    """Return the largest miss of a grip, [m] and [rad], by MuJoCo's forward kinematics alone.

    The recorded joint set-points are put into the robots' model and compared with the recorded
    commands, so nothing of the solver's own account enters. NaN where no cycle was solved.
    """
    model = robots_only(arm_pair(run.scenario)).compile()
    data, trace = mujoco.MjData(model), run.trace
    q = np.column_stack([trace[name.replace("_", "_setpoint_", 1)] for name in trace.joints])
    poses = [
        np.column_stack([trace[f"{side}_command_{part}"] for part in ("x", "z", "alpha")])
        for side in SIDES
    ]
    residuals = [(math.nan, math.nan)] if np.isnan(q).any(axis=1).all() else []
    # The cycle in which the robot stops is observed, but nothing is solved in it.
    for row in np.flatnonzero(~np.isnan(q).any(axis=1)):
        data.qpos[:] = q[row]
        mujoco.mj_kinematics(model, data)
        for side, pose in zip(SIDES, poses, strict=True):
            site = data.site(f"{side}_{GRIP_SITE}")
            residuals.append(_miss(site.xpos, site.xmat.reshape(3, 3), side, pose[row]))
    position, rotation = np.max(residuals, axis=0)
    return float(position), float(rotation)


def _miss(position: Vector, rotation: Vector, side: Side, pose: Vector) -> tuple[float, float]:
    """Return distance [m] and angle [rad] from (x, z, α), given in the arm's bending frame."""
    (x, z, alpha), sign = pose, 1.0 if side == "left" else -1.0
    c, s = np.cos(alpha), np.sin(alpha)
    wanted = np.array([[sign * c, 0.0, sign * s], [0.0, sign, 0.0], [-s, 0.0, c]])
    turn = wanted.T @ rotation
    # From the skew part, which keeps its digits near zero, where the trace loses half of them.
    axis = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    angle = math.atan2(float(np.linalg.norm(axis)), float(np.trace(turn)) - 1.0)
    return float(np.linalg.norm(position - [sign * x, 0.0, z])), angle


def moment_rows(linear: RunRecord | None = None) -> Iterator[Row]:
    """Compare the moment of linear pieces without compliance with the rod, over its first peak.

    On ``exact``'s sheet, and at the edges of ``fig6``'s in a perfect cell. At the sheet's own edges
    the strips alone differ; at the grippers' poses the pads' compliance is in between, which the
    rod does not know.
    """
    linear = linear or BendingRun(perfect_scenario("exact", LINEAR)).run()
    bending = np.flatnonzero(bending_rows(linear))
    moment = linear.trace["left_true_moment_y"]
    name = "linear pieces, moment error / first peak, at {} poses"
    yield absolute(name.format("gripper"), moment_error(linear, "grip"), 0.0, "1", 0.10)
    yield absolute(name.format("edge"), moment_error(linear, "edge"), 0.0, "1", 0.03)
    alpha = linear.trace["left_grip_alpha"][bending]
    knots = linear.scenario.path.make(linear.scenario.sheet.length_m).knots[1:-1]
    at_knots = np.interp(knots, alpha, moment[bending], left=math.nan, right=math.nan)
    largest = float(np.max(np.abs(at_knots))) / first_peak(linear)
    yield absolute("linear pieces, moment at inner knots / first peak", largest, 0.0, "1", 0.10)
    fig6 = BendingRun(load_scenario("fig6", PERFECT)).run()
    name = "fig6 without imperfections, moment error / first peak, at edge poses"
    yield absolute(name, moment_error(fig6, "edge"), 0.0, "1", 0.03)


def moment_error(run: RunRecord, place: Place) -> float:
    """Return the largest error of the moment against the rod while bending, over its first peak.

    ``place`` as :func:`reference_moments` has it; NaN where nothing was bent.
    """
    rows = np.flatnonzero(bending_rows(run))
    error = run.trace["left_true_moment_y"][rows] - reference_moments(run, place, rows)
    return float(np.max(np.abs(error))) / first_peak(run) if error.size else math.nan


def first_peak(run: RunRecord) -> float:
    """Return the largest |moment| on the first piece of the path [N m]; NaN if not reached."""
    pieces = peak_by_piece(run)
    return pieces[0] if pieces else math.nan


def comparison_rows(runs: Mapping[str, RunRecord]) -> Iterator[Row]:
    """Compare what compliance, too much of it, and the exact path make of the moment."""
    plain, compliant = peak_by_piece(runs["fig6"]), peak_by_piece(runs["fig8"])
    ratio = _largest_ratio(runs["fig8"], plain, compliant)
    yield at_most("fig8 / fig6 peak moment, worst piece with compliance", ratio, 0.72, "1")
    yield from oscillation_rows(runs["fig8"], runs["fig9"])
    pieces = BendingRun(load_scenario("exact", LINEAR)).run()
    ratio = metric(runs["exact"], "peak_moment") / first_peak(pieces)
    yield at_most("exact / linear pieces on its sheet, peak moment", ratio, 0.3, "1")


def metric(run: RunRecord, name: str) -> float:
    """Return a metric; NaN where it does not apply."""
    value = run.metrics[name].value
    return value if isinstance(value, float) else math.nan


def _largest_ratio(compliant_run: RunRecord, plain: list[float], compliant: list[float]) -> float:
    """Return the largest ratio over the pieces in which an axis complies from their start on."""
    scenario = compliant_run.scenario
    axes = (scenario.compliance.x, scenario.compliance.rotation)
    start = min(axis.from_alpha_rad for axis in axes if axis is not None)
    knots = scenario.path.make(scenario.sheet.length_m).knots
    pieces = [k for k in range(len(knots) - 1) if knots[k] >= start - 1e-9]
    if not pieces or max(pieces) >= min(len(plain), len(compliant)):
        return math.nan
    return max(compliant[k] / plain[k] for k in pieces)


def oscillation_rows(fig8: RunRecord, fig9: RunRecord) -> Iterator[Row]:
    """Check that a too small B makes the loop oscillate: a moment far above fig8's.

    A protective stop is the other way in which such a loop ends.
    """
    if fig9.outcome == "protective_stop":
        yield at_least("fig9 ends in a protective stop", 1.0, 1.0, "1")
        return
    late, plain = (max(peak_by_piece(run)[1:], default=math.nan) for run in (fig9, fig8))
    yield at_least("fig9 / fig8 peak moment from the second piece on", late / plain, 3.0, "1")


def growth_rows(share: float = 0.05) -> Iterator[Row]:
    """Compare an oscillation that grows from rest with the least stable eigenvalue of the loop.

    Of ``exact``'s sheet with a share of the paper's B on both axes. The eigenvalue is the mean of
    those at the ends of the bend; 20 %: a tenth is the error that a measured rate may have, a tenth
    that the eigenvalue at either end is from the mean.
    """
    scenario = perfect_scenario("exact", (*FROM_REST, *paper_gains(share)))
    run, modes = BendingRun(scenario).run(), predict(scenario).rows
    rate = float(np.mean([mode.growth_per_s for mode in modes]))
    frequency = float(np.mean([mode.frequency_hz for mode in modes]))
    what = "B too small, from rest: {} of the oscillation / eigenvalue".format
    yield relative(what("growth rate"), metric(run, "oscillation_growth"), rate, "1/s", 0.2)
    yield relative(what("frequency"), metric(run, "oscillation_frequency"), frequency, "Hz", 0.03)


def differing_values(first: RunRecord, second: RunRecord) -> int:
    """Return how many values of two traces differ, but for the wall clock's; NaN equals NaN."""
    if first.trace.rows != second.trace.rows or first.trace.columns != second.trace.columns:
        return max(first.trace.rows, second.trace.rows) * len(first.trace.columns)
    names = [name for name, _ in first.trace.columns if name not in WALL_CLOCK_COLUMNS]
    pairs = [(first.trace[name], second.trace[name]) for name in names]
    pairs.append((first.trace.qpos, second.trace.qpos))
    return sum(int(np.sum((a != b) & ~(np.isnan(a) & np.isnan(b)))) for a, b in pairs)


def repeat_row(first: RunRecord) -> Row:
    """Run a scenario again with its seed and count the values of the trace that differ."""
    second = BendingRun(first.scenario).run()
    name = f"values that differ, {first.scenario.name} twice with one seed"
    return absolute(name, differing_values(first, second), 0.0, "1", 0.0)
