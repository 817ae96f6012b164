"""The symmetric rod that yields: the reference solution of a yielding sheet.

The elastica with the moment of the section instead of EI κ, for monotonic first loading that is
symmetric:

    M' = −P sin θ − q (L/2 − s) cos θ,  θ' = κ(M),  θ(0) = α,  θ(L/2) = 0,  ∫₀^{L/2} cos θ ds = x,

with the unknowns P and M(0), by shooting. It is not valid where a section has unloaded in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from dualbend.beam.rod.planar import solve_symmetric
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.types import Vector

_TABLE = 4001
_FURTHEST = 60.0
"""Curvatures up to this many times the first yield are in the table of the inverse."""

_SOFTENING = (8.0, 4.0, 2.5, 1.8, 1.4, 1.2, 1.1, 1.05, 1.0)
"""Continuation: the yield strain is taken so many times as large, down to its own."""


@dataclass(frozen=True, kw_only=True)
class PlasticState:
    """End force P [N], end moment [N m] and largest |curvature| [1/m] of a yielded rod."""

    end_force_n: float
    end_moment_nm: float
    curvature_max_per_m: float


def solve_plastic(
    sheet: Sheet, alpha_rad: float, half_distance_m: float, weight_n_per_m: float
) -> PlasticState:
    """Return the state of a sheet that yields between two grips.

    Raises InputError where the sheet does not yield, or no state was found.
    """
    if sheet.plasticity is None:
        raise InputError("the sheet does not yield; beam.rod solves an elastic one")
    if not sheet.is_plain:
        raise InputError("the yielding rod is of one thickness and straight at rest")
    EI, L = sheet.bending_stiffness_nm2, sheet.length_m
    first = sheet.plasticity.first_yield(sheet.thickness_m)
    table = np.concatenate(([0.0], np.geomspace(first, _FURTHEST * first, _TABLE)))
    moments = np.concatenate(([0.0], sheet.plasticity.moment(table[1:], sheet.thickness_m)))
    elastic = solve_symmetric(EI, L, alpha_rad, half_distance_m, weight_n_per_m)
    unknowns = np.array([elastic.end_force_n * L**2 / EI, elastic.end_moment_nm * L / EI])

    def shoot(guess: Vector, soft: float) -> Vector:
        soft_moments, soft_table = soft * moments, soft * table
        P, start = guess[0] * EI / L**2, guess[1] / L  # moments over EI from here on

        def slope(s: float, y: Vector) -> list[float]:
            theta, moment = y[0], y[1]
            size = np.interp(abs(moment), soft_moments, soft_table)
            turn = P * np.sin(theta) + weight_n_per_m * (L / 2.0 - s) * np.cos(theta)
            return [float(np.copysign(size, moment)), -turn / EI, float(np.cos(theta))]

        found = solve_ivp(
            slope, (0.0, L / 2.0), [alpha_rad, start, 0.0], rtol=1e-8, atol=1e-10, max_step=L / 200
        )
        return np.asarray(found.y[:, -1])

    def missed(guess: Vector, soft: float) -> Vector:
        end = shoot(guess, soft)
        return np.array([end[0], (end[2] - half_distance_m) / L])

    for soft in _SOFTENING:
        solved = root(missed, unknowns, args=(soft,), tol=1e-9)
        if not solved.success:
            raise InputError(f"no yielded state at alpha = {alpha_rad} rad: {solved.message}")
        unknowns = solved.x
    middle = abs(float(shoot(unknowns, 1.0)[1]))
    return PlasticState(
        end_force_n=float(unknowns[0]) * EI / L**2,
        end_moment_nm=float(unknowns[1]) * EI / L,
        curvature_max_per_m=float(np.interp(middle, moments, table)),
    )
