"""The shape of a run's sheet at some bending angles, and how far it is from theory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dualbend.beam import elastica
from dualbend.beam.rod.planar import RodState
from dualbend.evaluation.recorded_rod import recorded_rods
from dualbend.evaluation.sheet import no_theory
from dualbend.report.moment import bending_rows
from dualbend.run.record import RunRecord
from dualbend.types import SIDES, Vector

SHAPES = 5
"""Bending angles at which the sheet's shape is shown."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """The sheet at one instant: points (2, n) in the bending plane [m], z from its ends' height.

    ``elastica_m``: the zero-moment shape at the sheet's own end slope ``slope_rad``, the arms lag
    behind ``alpha_rad``. ``off_*``: largest distance between points of the same arc length [m],
    from it, and from the rod with weight between the sheet's own ends (NaN: not found, and of a
    sheet that may yield).
    """

    alpha_rad: float
    slope_rad: float
    time_s: float
    points_m: Vector
    elastica_m: Vector
    off_elastica_m: float
    off_rod_m: float


def has_shape(run: RunRecord) -> bool:
    """Tell whether the trace holds the bending angles; that of an early version does not."""
    return "bend_000" in run.trace


def sheet_points(run: RunRecord, row: int) -> tuple[Vector, Vector, Vector]:
    """Return arc lengths, x and z [m] of the flat pieces' ends (n + 2,), from the left edge on.

    Strips and plate alike bend at n places, (i + 1/2) L/n. θ grows by each one's angle;
    x' = cos θ, z' = −sin θ, in the planar frame of the rod.
    """
    sections, length = run.scenario.sheet.model.sections, run.scenario.sheet.length_m
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
    states = recorded_rods(run, "edge", chosen)
    return [_shape(run, row, state) for row, state in zip(chosen.tolist(), states, strict=True)]


def _shape(run: RunRecord, row: int, state: RodState | None) -> Shape:
    slope = 0.5 * sum(float(run[f"{side}_edge_alpha"][row]) for side in SIDES)
    allowed = min(max(slope, 0.0), elastica.END_SLOPE_GRIPPERS_MEET)
    s, x, z = sheet_points(run, row)
    wanted = np.stack(elastica.shape(allowed, run.scenario.sheet.length_m, s)[:2])
    points = np.stack([part - 0.5 * (part[0] + part[-1]) for part in (x, z)])
    off_rod = np.nan
    if state is not None and state.converged:
        rod_x, rod_z = (np.interp(s, state.s_m, part) for part in (state.x_m, state.z_m))
        off_rod = float(np.hypot(x - rod_x, z - rod_z).max())
    return Shape(
        alpha_rad=float(run["nominal_alpha"][row]),
        slope_rad=slope,
        time_s=float(run["time"][row]),
        points_m=points,
        elastica_m=wanted,
        off_elastica_m=float(np.hypot(*(points - wanted)).max()),
        off_rod_m=off_rod,
    )
