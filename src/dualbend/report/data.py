"""What a report computes from a saved run: moments, oracle, path, shapes of the sheet, phases."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.evaluation.recorded_rod import recorded_rods
from dualbend.evaluation.sheet import no_theory
from dualbend.run.record import RunRecord
from dualbend.scenario.path import make_path
from dualbend.types import SIDES, Vector

Rows = NDArray[np.intp]

SHAPES = 5
"""Bending angles at which the sheet's shape is shown."""

_ORACLE_POINTS = 120
_FIRST_RAD = 2e-3
"""The flat rod's end force is indeterminate."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A curve: what it is of, x (n,) and y (n,) in the units of its plot."""

    name: str
    x: Vector
    y: Vector


@dataclass(frozen=True, kw_only=True)
class Shape:
    """The sheet at one instant: points (n,) in the bending plane [m], z from its ends' height.

    ``elastica_*``: the zero-moment shape at the sheet's own end slope ``slope_rad``, the arms lag
    behind ``alpha_rad``. ``off_*``: largest distance between points of the same arc length [m],
    from it, and from the oracle with weight between the sheet's own ends (NaN: not found, and of
    a sheet that may yield).
    """

    alpha_rad: float
    slope_rad: float
    time_s: float
    x_m: Vector
    z_m: Vector
    elastica_x_m: Vector
    elastica_z_m: Vector
    off_elastica_m: float
    off_rod_m: float


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A phase as it was run; ``attempt`` and ``sheet`` count from 0."""

    name: str
    sheet: int
    attempt: int
    start_s: float
    end_s: float


def bending_rows(run: RunRecord) -> Rows:
    """Return the rows of the phase ``bend``, of the first sheet in an assembly (rows,)."""
    rows = run["phase"] == run.phases.index("bend")
    if run.scenario.assembly is not None:
        rows &= np.nan_to_num(run["sheet"]) == 0
    return np.flatnonzero(rows)


def moment_lines(run: RunRecord) -> list[Line]:
    """Return raw, filtered and true moment at the sensing gripper [mN m] over the angle [rad]."""
    rows, side = bending_rows(run), run.sensing_side
    alpha = run["nominal_alpha"][rows]
    columns = (("raw", "measured"), ("filtered", "filtered"), ("true", "true"))
    return [
        Line(name=name, x=alpha, y=1e3 * run[f"{side}_{column}_moment_y"][rows])
        for name, column in columns
    ]


def nominal_lines(run: RunRecord) -> list[Line]:
    """Return the moments of :func:`moment_lines` and, unless the sheet may yield, the oracle's."""
    predicted = [] if no_theory(run.scenario) else [oracle_on_path(run)]
    return [*moment_lines(run), *predicted]


def oracle_on_path(run: RunRecord) -> Line:
    """Return the oracle's moment [mN m] on grippers that follow the nominal path exactly."""
    scenario = run.scenario
    sheet, path = scenario.sheet.sheet(), make_path(scenario.path, scenario.sheet.length_m)
    start = max(float(path.knots[0]), _FIRST_RAD)
    grid = np.linspace(start, float(path.knots[-1]), _ORACLE_POINTS)
    alphas = np.union1d(grid, path.knots[path.knots > start])
    states = rod.follow_symmetric(
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        [(alpha, path.at(alpha)[0]) for alpha in alphas.tolist()],
        sheet.weight_per_length_n_per_m,
        axial_stiffness_n=sheet.axial_stiffness_n,
    )
    moment = [state.end_moment_nm if state.converged else np.nan for state in states]
    return Line(name="oracle, nominal", x=alphas, y=1e3 * np.array(moment))


def oracle_at_edges(run: RunRecord) -> Line:
    """Return the oracle's moment [mN m] at the poses that the sheet's ends really had."""
    rows = bending_rows(run)
    chosen = rows[:: max(1, len(rows) // _ORACLE_POINTS)]
    moments = [
        (s.left if run.sensing_side == "left" else s.right).moment_nm if s.converged else np.nan
        for s in _rods(run, chosen)
    ]
    return Line(
        name="oracle, recorded",
        x=run["nominal_alpha"][chosen],
        y=1e3 * np.array(moments),
    )


def _rods(run: RunRecord, rows: Rows) -> tuple[rod.RodState, ...]:
    return recorded_rods(run, run.scenario.sheet.sheet(), "edge", rows)


def has_shape(run: RunRecord) -> bool:
    """Tell whether the trace holds the bending angles; that of an early version does not."""
    return "bend_000" in run.trace


def sheet_points(run: RunRecord, row: int) -> tuple[Vector, Vector, Vector]:
    """Return arc lengths, x and z [m] of the flat pieces' ends (n + 2,), from the left edge on.

    Strips and plate alike bend at n places, (i + 1/2) L/n. θ grows by each one's angle;
    x' = cos θ, z' = −sin θ, in the planar frame of the rod.
    """
    sections, length = run.scenario.sheet.sections, run.scenario.sheet.length_m
    bends = [float(run[f"bend_{i:03d}"][row]) for i in range(sections)]
    start = [float(run[f"left_edge_{part}"][row]) for part in ("x", "z", "alpha")]
    theta = start[2] + np.concatenate([[0.0], np.cumsum(bends)])
    pieces = np.full(sections + 1, length / sections)
    pieces[[0, -1]] *= 0.5
    s = np.concatenate([[0.0], np.cumsum(pieces)])
    x = start[0] + np.concatenate([[0.0], np.cumsum(pieces * np.cos(theta))])
    z = start[1] - np.concatenate([[0.0], np.cumsum(pieces * np.sin(theta))])
    s[-1] = length
    return s, x, z


def shapes(run: RunRecord) -> list[Shape]:
    """Return the sheet at angles evenly spaced up to the largest one that it was bent to."""
    rows = bending_rows(run)
    if not rows.size or not has_shape(run):
        return []
    alpha = run["nominal_alpha"][rows]
    wanted = alpha.max() * np.arange(1, SHAPES + 1) / SHAPES
    at = np.minimum(np.searchsorted(alpha, wanted - 1e-9), rows.size - 1)
    chosen = rows[np.unique(at)]
    if no_theory(run.scenario):
        return [_shape(run, row, None) for row in chosen.tolist()]
    return [
        _shape(run, row, state)
        for row, state in zip(chosen.tolist(), _rods(run, chosen), strict=True)
    ]


def _shape(run: RunRecord, row: int, state: rod.RodState | None) -> Shape:
    slope = 0.5 * sum(float(run[f"{side}_edge_alpha"][row]) for side in SIDES)
    allowed = min(max(slope, 0.0), elastica.END_SLOPE_GRIPPERS_MEET)
    s, x, z = sheet_points(run, row)
    wanted_x, wanted_z, _ = elastica.shape(allowed, run.scenario.sheet.length_m, s)
    middle, level = 0.5 * (x[0] + x[-1]), 0.5 * (z[0] + z[-1])
    off_rod = np.nan
    if state is not None and state.converged:
        rod_x, rod_z = (np.interp(s, state.s_m, part) for part in (state.x_m, state.z_m))
        off_rod = float(np.hypot(x - rod_x, z - rod_z).max())
    return Shape(
        alpha_rad=float(run["nominal_alpha"][row]),
        slope_rad=slope,
        time_s=float(run["time"][row]),
        x_m=x - middle,
        z_m=z - level,
        elastica_x_m=wanted_x,
        elastica_z_m=wanted_z,
        off_elastica_m=float(np.hypot(x - middle - wanted_x, z - level - wanted_z).max()),
        off_rod_m=off_rod,
    )


def phases(run: RunRecord) -> list[Phase]:
    """Return the phases in the order in which they were run."""
    keys = [run["phase"]]
    if run.scenario.assembly is not None:
        # A run that stops while it looks leaves its last row's columns unwritten.
        keys += [_held(run[name]) for name in ("attempt", "sheet")]
    table = np.stack(keys)
    starts = np.flatnonzero(np.any(np.diff(table, prepend=-1.0) != 0.0, axis=0))
    return list(_phases(run, table, starts))


def _phases(run: RunRecord, table: Vector, starts: Rows) -> Iterator[Phase]:
    time = run["time"]
    for first, end in zip(starts, [*starts[1:], len(time)], strict=True):
        phase, attempt, sheet = (*table[:, first].astype(int).tolist(), 0, 0)[:3]
        yield Phase(
            name=run.phases[phase],
            sheet=sheet,
            attempt=attempt,
            start_s=float(time[first]),
            end_s=float(time[end - 1] + COMMAND_PERIOD_S),
        )


def _held(values: Vector) -> Vector:
    """Return the values with what is not a number replaced by the last one before it."""
    known = np.isfinite(values)
    at = np.maximum.accumulate(np.where(known, np.arange(values.size), 0))
    return np.nan_to_num(values[at])
