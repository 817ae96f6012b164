"""Moment over bending angle, the paper's figure: what was recorded and what the rod predicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualbend.beam.rod import planar as rod
from dualbend.evaluation.recorded_rod import recorded_rods
from dualbend.evaluation.sheet import no_theory
from dualbend.report.plot import Axis, Colour, Curve, Plot
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario

Rows = NDArray[np.intp]

ANGLE = Axis("bending angle α", "rad")
MOMENT = Axis("moment", "mN m")

_POINTS = 120
_FIRST_RAD = 2e-3
"""The flat rod's end force is indeterminate."""


_RECORDED: tuple[tuple[str, str, Colour, float], ...] = (
    ("raw", "measured", "grey", 0.8),
    ("filtered", "filtered", "orange", 1.2),
    ("true", "true", "blue", 2.2),
)
"""Name, column, colour and width of what was recorded."""


def is_bending(run: RunRecord) -> NDArray[np.bool_]:
    """Return which rows are of the phase ``bend`` (rows,); none where a task has no such phase."""
    number = run.phases.index("bend") if "bend" in run.phases else -1
    return np.asarray(run["phase"] == number)


def bending_rows(run: RunRecord) -> Rows:
    """Return the rows of the phase ``bend``, the first sheet's where there are several (rows,)."""
    rows = is_bending(run)
    if "sheet" in run.trace:
        rows &= np.nan_to_num(run["sheet"]) == 0
    return np.flatnonzero(rows)


def recorded_moments(run: RunRecord, rows: Rows | NDArray[np.bool_]) -> list[Curve]:
    """Return raw, filtered and true moment at the sensing gripper [mN m] over the angle [rad]."""
    alpha, side = run["nominal_alpha"][rows], run.sensing_side
    return [
        Curve(name, alpha, 1e3 * run[f"{side}_{column}_moment_y"][rows], colour, width)
        for name, column, colour, width in _RECORDED
    ]


def moment_curves(run: RunRecord) -> list[Curve]:
    """Return the recorded moments and, unless the sheet may yield, the reference solution's."""
    predicted = [] if no_theory(run.scenario) else [reference_on_path(run.scenario)]
    return [*recorded_moments(run, bending_rows(run)), *predicted]


def reference_on_path(scenario: Scenario) -> Curve:
    """Return the rod's end moment [mN m] between grippers that follow the nominal path exactly."""
    sheet, path = scenario.sheet.sheet(), scenario.path.make(scenario.sheet.length_m)
    start = max(float(path.knots[0]), _FIRST_RAD)
    grid = np.linspace(start, float(path.knots[-1]), _POINTS)
    alphas = np.union1d(grid, path.knots[path.knots > start])
    states = rod.follow_symmetric(
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        [(alpha, path.at(alpha)[0]) for alpha in alphas.tolist()],
        sheet.weight_per_length_n_per_m,
        axial_stiffness_n=sheet.axial_stiffness_n,
        sheet=sheet,
    )
    ends = [s.left if "left" in scenario.compliance.sensing else s.right for s in states]
    found = [s.converged for s in states]
    moment = np.where(found, [end.moment_nm for end in ends], np.nan)
    name = "reference, nominal"
    return Curve(name, alphas, 1e3 * moment, colour="green", width=1.4, dash="dashed")


def reference_at_ends(run: RunRecord) -> Curve:
    """Return the rod's moment [mN m] on the sensing gripper between the sheet's recorded ends."""
    rows = bending_rows(run)
    chosen = rows[:: max(1, len(rows) // _POINTS)]
    moment = np.array(
        [
            (s.left if run.sensing_side == "left" else s.right).moment_nm if s.converged else np.nan
            for s in recorded_rods(run, "edge", chosen)
        ]
    )
    name, alpha = "reference, recorded", run["nominal_alpha"][chosen]
    return Curve(name, alpha, 1e3 * moment, colour="purple", width=1.4, dash="dotted")


def knots_of(scenario: Scenario) -> list[float]:
    """Return the end slopes where the pieces of a scenario's path meet [rad]."""
    knots: list[float] = scenario.path.make(scenario.sheet.length_m).knots.tolist()
    return knots


def moment_plot(
    curves: Sequence[Curve],
    knots: Sequence[float],
    *,
    axes: tuple[Axis, Axis] = (ANGLE, MOMENT),
    title: str = "",
) -> Plot:
    """Return the paper's figure: moment over bending angle, with the path's knots."""
    x, y = axes
    return Plot(curves=curves, x=x, y=y, knots=knots, levels=[0.0], title=title)


def describe_peak(curve: Curve) -> str:
    """Return where a curve's largest size is, in words."""
    if not np.isfinite(curve.y).any():
        return f"{curve.name}: nothing recorded"
    at = int(np.nanargmax(np.abs(curve.y)))
    return f"{curve.name}: at most {abs(curve.y[at]):.1f} mN m, at {curve.x[at]:.2f} rad"
