"""The sheet and the poses that rod and plate are asked about."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dualbend.beam.path import BendingPath, ExactPath, PiecewiseLinearPath
from dualbend.beam.sheet import Sheet
from dualbend.validation.cases.sheet import (
    INTERVAL_RAD,
    EndLoads,
    default_sheet,
    reference_loads,
    settled_loads,
)

Vector = NDArray[np.float64]

SHIPPED, STRIPS = default_sheet()
WIDE = replace(SHIPPED, length_m=0.6, width_m=0.2, thickness_m=0.0005)
"""600 × 200 × 0.5 mm of the shipped material: wide enough to be a plate."""

END_RAD = 1.0


@dataclass(frozen=True, kw_only=True)
class Points:
    """End slopes [rad] on a named path."""

    name: str
    path: BendingPath
    alphas: Vector


def piecewise(sheet: Sheet) -> Points:
    """Return the 0.2 rad path and the middles of its pieces, where M peaks."""
    path = PiecewiseLinearPath.from_interval(sheet.length_m, END_RAD, INTERVAL_RAD)
    return Points(name="0.2 rad path", path=path, alphas=np.array([0.1, 0.3, 0.5, 0.7, 0.9]))


def exact(sheet: Sheet) -> Points:
    """Return the zero-moment path and end slopes on it."""
    path = ExactPath(sheet.length_m, END_RAD)
    return Points(name="exact path", path=path, alphas=np.array([0.2, 0.6, 1.0]))


def poses(given: Points) -> list[tuple[float, float]]:
    """Return (α [rad], half distance [m])."""
    return [(alpha, given.path.at(alpha)[0]) for alpha in given.alphas.tolist()]


def simulated(sheet: Sheet, given: Points, *, weight: bool) -> EndLoads:
    """Return this project's simulation in ideal grips, the shipped division."""
    return settled_loads(sheet, STRIPS.hinges, given.path, given.alphas, weight=weight)


def theory(sheet: Sheet, given: Points, *, weight: bool) -> EndLoads:
    """Return the elastica off the optimum, by this project's rod."""
    return reference_loads(sheet, given.path, given.alphas, weight=weight)
