"""Equilibrium of compliance and sheet: the state about which the loop may oscillate.

The admittance yields to the whole wrench, not only to its error. A soft loop therefore holds the
sheet flatter than the path says, and the flatter sheet is the stiffer one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from dualbend.beam.rod.state import RodState
from dualbend.beam.rod.tangent import clamps_per_grips, sheet_tangent, sheet_wrench, solve_grips
from dualbend.beam.sheet import Sheet
from dualbend.types import Vector

_LARGEST_STEP_M = 2e-3
_ITERATIONS, _HALVINGS = 60, 8
_FOUND = 1e-9
_SMALL = 1e-6


def sheet_mass(sheet: Sheet, state: RodState) -> Vector:
    """Return the sheet's mass (6, 6) in the grips' coordinates, m ∫ (∂r/∂g)ᵀ (∂r/∂g) dσ.

    Its points follow the grips as at rest (Guyan), which holds well below its first mode. A flat
    sheet that comes together bulges far: at 0.2 rad its 31 g weigh 170 g along x.
    """
    per_clamp = np.stack([_moved_shape(state, i) for i in range(4)], axis=1) * state.scale.L
    moved = per_clamp @ clamps_per_grips(state.scale.L)
    points = len(moved) // 2
    moved[:points, 0] += 1.0
    moved[points:, 1] += 1.0
    share = np.full(points, 1.0 / (points - 1))
    share[[0, -1]] /= 2.0
    if sheet.profile:
        share *= sheet.thickness_at(state.s_m) / sheet.thickness_m
    return np.asarray(sheet.mass_kg * (moved.T * np.tile(share, 2)) @ moved)


def _moved_shape(state: RodState, clamp: int) -> Vector:
    """Return x/L and z/L (2 points,) of the rod from its left end, per change of one clamp."""
    problem, unknowns = state.problem, state.unknowns
    base, f = problem.basis, problem.fields(unknowns)
    name = fields(problem.clamps)[clamp].name
    ends = [
        replace(
            problem, clamps=replace(problem.clamps, **{name: getattr(problem.clamps, name) + step})
        )
        for step in (_SMALL, -_SMALL)
    ]
    gaps = [end.residual(unknowns, end.fields(unknowns)) for end in ends]
    follow = -np.linalg.solve(problem.tangent(f), (gaps[0] - gaps[1]) / 2.0)
    shapes = []
    for end, change in zip(ends, (follow, -follow), strict=True):
        moved = end.fields(unknowns + change)
        along = base.cumulative @ (
            moved.stretch[:, np.newaxis] * np.stack([moved.cos, -moved.sin], axis=1)
        )
        shapes.append(along.T.ravel())
    return np.asarray((shapes[0] - shapes[1]) / (2.0 * _SMALL))


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """The grips at rest (6,), the sheet's state there, and whether an equilibrium was found."""

    grips: Vector
    state: RodState
    settled: bool


def find_equilibrium(
    sheet: Sheet, nominal: Vector, compliance: Vector, guess: RodState | None = None
) -> Equilibrium:
    """Solve q = q_nominal + C F(q) by Newton's method, (1 + C K) Δq = q_nominal + C F − q.

    ``nominal`` (6,): commanded grips in their bending frames [m, m, rad]; ``compliance`` (6, 6) of
    arms, grasps and admittance per wrench on the arms; ``guess``: a state nearby. The sheet has
    weight and stretch. Where no equilibrium is found, it is the nominal grips, not ``settled``.
    """
    state = solve_grips(sheet, nominal, guess)
    grips, unsettled = nominal, Equilibrium(grips=nominal, state=state, settled=False)
    if not state.converged:
        return unsettled
    error = _gap(nominal, compliance, grips, state)
    for _ in range(_ITERATIONS):
        if np.abs(error).max() < _FOUND:
            return Equilibrium(grips=grips, state=state, settled=True)
        step = np.linalg.solve(np.eye(6) + compliance @ sheet_tangent(state), error)
        # In a taut sheet the force turns up within micrometres: short steps find the way there.
        step *= min(1.0, _LARGEST_STEP_M / np.abs(step[[0, 1, 3, 4]]).max(initial=1e-12))
        for _ in range(_HALVINGS):
            there = solve_grips(sheet, grips + step, state)
            found = _gap(nominal, compliance, grips + step, there) if there.converged else None
            if found is not None and np.abs(found).max() < np.abs(error).max():
                grips, state, error = grips + step, there, found
                break
            step = step / 2.0
        else:
            break
    return unsettled


def _gap(nominal: Vector, compliance: Vector, grips: Vector, state: RodState) -> Vector:
    return np.asarray(nominal + compliance @ sheet_wrench(state) - grips)
