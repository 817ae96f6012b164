"""The strips against the rod: end force, end moment and order of convergence.

The sheet hangs between two ideal grips, whose welds yield by less than 0.2 µm. What is compared are
statics at the poses that the grips impose, so the strips are settled at each point; their damping,
which does not change statics, is far above the shipped one to make that quick.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.beam.path import BendingPath, ExactPath, PiecewiseLinearPath
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.scenario.load import load_scenario
from dualbend.scene.sheet.strips import StripConfig
from dualbend.types import Vector
from dualbend.validation.cases.ideal_grips import (
    STEP_S,
    gripped_strips,
    left_wrench,
    place_grips,
    start_on_elastica,
)
from dualbend.validation.row import Row, at_least, worst

FIRST_SLOPE_RAD, LAST_SLOPE_RAD = 0.05, 1.0
"""End slopes compared. Below the first, P on the linear piece nears the clamped load 4π² EI/L²:
half the wave length, so four times the strips' error, (2π h/L)²/12 = 0.8 % for 20 hinges."""

INTERVAL_RAD = 0.2
_SETTLING_DAMPING = 0.5
_MOVE_S, _SETTLE_S, _FIRST_SETTLE_S = 0.05, 0.15, 0.4


@dataclass(frozen=True, kw_only=True)
class EndLoads:
    """End force P [N] (compression positive) and moment at the left grip [N m], both (n,)."""

    force_n: Vector
    moment_nm: Vector


def default_sheet() -> tuple[Sheet, StripConfig]:
    """Return the sheet of ``exact`` and how it is divided."""
    settings = load_scenario("exact").sheet
    return settings.sheet(), settings.strips


def settled_loads(
    sheet: Sheet, hinges: int, path: BendingPath, alphas: Vector, *, weight: bool
) -> EndLoads:
    """Return the loads on the left grip at rest at each α of a path (n,)."""
    strips = StripConfig(hinges=hinges, damping_ratio=_SETTLING_DAMPING)
    model = gripped_strips(sheet, strips, weight=weight)
    alpha = float(alphas[0])
    data = start_on_elastica(model, sheet, hinges, alpha, path.at(alpha)[0])
    mujoco.mj_step(model, data, nstep=round(_FIRST_SETTLE_S / STEP_S))
    loads = []
    for target in alphas.tolist():
        for between in np.linspace(alpha, target, round(_MOVE_S / STEP_S)).tolist():
            place_grips(data, between, path.at(between)[0])
            mujoco.mj_step(model, data)
        mujoco.mj_step(model, data, nstep=round(_SETTLE_S / STEP_S))
        mujoco.mj_forward(model, data)
        loads.append(left_wrench(model, data))
        alpha = target
    wrench = np.array(loads)
    return EndLoads(force_n=-wrench[:, 0], moment_nm=wrench[:, 4])


def reference_loads(sheet: Sheet, path: BendingPath, alphas: Vector, *, weight: bool) -> EndLoads:
    """Return the same loads of the rod that cannot stretch, as the strips cannot; NaN unsolved."""
    q = sheet.weight_per_length_n_per_m if weight else 0.0
    points = [(alpha, path.at(alpha)[0]) for alpha in alphas.tolist()]
    EI, L = sheet.bending_stiffness_nm2, sheet.length_m
    states = rod.follow_symmetric(EI, L, points, q, sheet=sheet)
    loads = [(s.end_force_n, s.end_moment_nm) if s.converged else (np.nan, np.nan) for s in states]
    force, moment = np.array(loads).T
    return EndLoads(force_n=force, moment_nm=moment)


def first_peak_moment(sheet: Sheet) -> float:
    """Return the largest |M| on the first 0.2 rad piece [N m], of the rod without weight."""
    path = PiecewiseLinearPath.from_interval(sheet.length_m, INTERVAL_RAD, INTERVAL_RAD)
    alphas = np.linspace(0.1, 0.9, 41) * INTERVAL_RAD
    return float(np.max(np.abs(reference_loads(sheet, path, alphas, weight=False).moment_nm)))


def load_rows(points: int = 20) -> Iterator[Row]:
    """Compare force and moment with the rod on two paths, with and without weight.

    The force's error is relative to the rod's P or the Euler load, whichever is larger, because
    with weight P passes through zero; the moment's to the first peak of the 0.2 rad path. Each row
    is the worst of the points.
    """
    sheet, strips = default_sheet()
    length, peak = sheet.length_m, first_peak_moment(sheet)
    paths: tuple[tuple[str, BendingPath], ...] = (
        ("0.2 rad path", PiecewiseLinearPath.from_interval(length, LAST_SLOPE_RAD, INTERVAL_RAD)),
        ("exact path", ExactPath(length, LAST_SLOPE_RAD)),
    )
    alphas = np.linspace(FIRST_SLOPE_RAD, LAST_SLOPE_RAD, points)
    for path_name, path in paths:
        for weight, load in ((False, "no weight"), (True, "with weight")):
            found = settled_loads(sheet, strips.hinges, path, alphas, weight=weight)
            wanted = reference_loads(sheet, path, alphas, weight=weight)
            where = f"{path_name}, {load}, from {FIRST_SLOPE_RAD:g} rad"
            scale = np.maximum(np.abs(wanted.force_n), sheet.euler_load_n)
            name = f"sheet force, {where}"
            yield worst(name, found.force_n, wanted.force_n, "N", 0.005, scale)
            name = f"sheet moment / first peak, {where}"
            yield worst(name, found.moment_nm, wanted.moment_nm, "N m", 0.01, peak)


def convergence_order(hinges: Sequence[int] = (10, 20, 40), points: int = 4) -> float:
    """Return the order p of ΔP ~ N⁻ᵖ on the exact path without weight, by a fit over N.

    ΔP is the root mean square over end slopes from 0.4 to 1 rad of the difference from the rod.
    """
    sheet, _ = default_sheet()
    path = ExactPath(sheet.length_m, LAST_SLOPE_RAD)
    alphas = np.linspace(0.4, LAST_SLOPE_RAD, points)
    wanted = reference_loads(sheet, path, alphas, weight=False).force_n
    found = [settled_loads(sheet, n, path, alphas, weight=False).force_n for n in hinges]
    return fitted_order(hinges, np.sqrt(np.mean((np.array(found) - wanted) ** 2, axis=1)))


def fitted_order(divisions: Sequence[int], errors: Vector) -> float:
    """Return the order p of errors ~ N⁻ᵖ, by a fit over N."""
    return -float(np.polyfit(np.log(divisions), np.log(errors), 1)[0])


def order_row(what: str, order: float) -> Row:
    """Return the row of an order of convergence in N: 2 by design, at least 1.8 is asked for."""
    return at_least(f"{what}, order of convergence in N", order, 1.8, "1")
