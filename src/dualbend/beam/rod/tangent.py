"""The wrench of the sheet on the grips, and its tangent stiffness.

The six coordinates are x, z [m], α [rad] of the left and then of the right grip, each in its own
bending frame. With a stiffness K the wrench on the arms changes by −K times the motion.
"""

from __future__ import annotations

import numpy as np

from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.state import RodState
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.types import Vector


def sheet_tangent(state: RodState) -> Vector:
    """Return the sheet's stiffness (6, 6) in the grips' coordinates: K = (EI/L) Tᵀ H T.

    H is the second derivative of the energy over EI/L in θ(0), θ(L), shortening and climb.
    Raises InputError for a state that was not found.
    """
    if not state.converged:
        raise InputError(f"the sheet's state was not found: {state.reason}")
    second = state.problem.stiffness(state.problem.fields(state.unknowns))
    EI, L = state.scale.EI, state.scale.L
    clamps = clamps_per_grips(L)
    return np.asarray(EI / L * clamps.T @ second @ clamps)


def clamps_per_grips(length_m: float) -> Vector:
    """Return (4, 6): θ(0), θ(L), shortening and climb per change of the grips' coordinates."""
    clamps = np.zeros((4, 6))
    clamps[0, 2], clamps[1, 5] = 1.0, -1.0
    # Both x_B point inward: the grips come together by their sum. z is up in both frames.
    clamps[2, [0, 3]] = 1.0 / length_m
    clamps[3, [1, 4]] = -1.0 / length_m, 1.0 / length_m
    return clamps


def sheet_wrench(state: RodState) -> Vector:
    """Return force x, z [N] and moment y [N m] on both arms (6,), in their bending frames."""
    left, right = state.left, state.right
    return np.array([*left, -right.force_x_n, right.force_z_n, right.moment_nm])


def solve_grips(sheet: Sheet, grips: Vector, guess: RodState | None = None) -> RodState:
    """Return the state of the sheet with weight between grips (6,) in their bending frames."""
    return follow_grips(sheet, grips[np.newaxis], guess)[0]


def follow_grips(
    sheet: Sheet, grips: Vector, guess: RodState | None = None
) -> tuple[RodState, ...]:
    """Return the states of the sheet with weight between grips (n, 6), each from the previous."""
    # The right arm's bending frame looks the other way: its x is minus the planar frame's.
    pairs = ((tuple(row[:3]), (-row[3], row[4], row[5])) for row in grips.tolist())
    return rod.follow_planar(
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        pairs,
        sheet.weight_per_length_n_per_m,
        guess,
        sheet.axial_stiffness_n,
        sheet,
    )
