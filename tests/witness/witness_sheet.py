"""The sheet and the poses that rod and plate are asked about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualbend.analysis.validation_sheet import (
    INTERVAL_RAD,
    EndLoads,
    default_sheet,
    oracle_loads,
    settled_loads,
)
from dualbend.beam.path import BendingPath, ExactPath, PiecewiseLinearPath
from dualbend.beam.sheet import Sheet

Vector = NDArray[np.float64]

SHIPPED, STRIPS = default_sheet()
WIDE = replace(SHIPPED, length_m=0.6, width_m=0.2, thickness_m=0.0005)
"""600 × 200 × 0.5 mm of the shipped material: wide enough to be a plate."""

END_RAD = 1.0


def piecewise(sheet: Sheet) -> tuple[str, BendingPath, Vector]:
    """Return the 0.2 rad path and end slopes in the middle of its pieces, where M peaks."""
    path = PiecewiseLinearPath.from_interval(sheet.length_m, END_RAD, INTERVAL_RAD)
    return "0.2 rad path", path, np.array([0.1, 0.3, 0.5, 0.7, 0.9])


def exact(sheet: Sheet) -> tuple[str, BendingPath, Vector]:
    """Return the zero-moment path and end slopes on it."""
    return "exact path", ExactPath(sheet.length_m, END_RAD), np.array([0.2, 0.6, 1.0])


def poses(path: BendingPath, alphas: Vector) -> list[tuple[float, float]]:
    """Return (α [rad], half distance [m])."""
    return [(alpha, path.at(alpha)[0]) for alpha in alphas.tolist()]


def simulated(sheet: Sheet, path: BendingPath, alphas: Vector, *, weight: bool) -> EndLoads:
    """Return this project's simulation in ideal grips, the shipped division."""
    return settled_loads(sheet, STRIPS.hinges, path, alphas, weight=weight)


def theory(sheet: Sheet, path: BendingPath, alphas: Vector, *, weight: bool) -> EndLoads:
    """Return the elastica off the optimum, by this project's oracle."""
    return oracle_loads(sheet, path, alphas, weight=weight)
