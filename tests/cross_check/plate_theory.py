"""A strip with free edges between beam and plate: the rigidity that depends on the curvature.

A strip bent to κ wants to curl across by −ν κ; a wide one may not, because that would stretch its
edges, and stays flat but for a margin of the order √(t/κ). Across the width the deflection w(y)
minimises ½ D (w″² + 2 ν κ w″ + κ²) + ½ E t κ² w², and M(κ) = ∫ D (κ + ν w″) + E t κ w² dy goes from
EI κ (narrow or flat) to D κ, D = EI/(1 − ν²).
Source: D. G. Ashwell, "The anticlastic curvature of rectangular beams and plates", J. Royal
Aeronautical Society 54, 1950.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp, trapezoid
from scipy.interpolate import CubicSpline

from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet

Vector = NDArray[np.float64]


def bending_moment(sheet: Sheet, curvature: float) -> float:
    """Return M(κ) [N m]."""
    nu, t, half = sheet.poisson_ratio, sheet.thickness_m, sheet.width_m / 2.0
    D = sheet.young_pa * t**3 / (12.0 * (1.0 - nu**2))
    if curvature == 0.0:
        return 0.0
    rate = (3.0 * (1.0 - nu**2) * (curvature / t) ** 2) ** 0.25
    u = rate * np.linspace(0.0, half, 4001)
    even, odd = np.cosh(u) * np.cos(u), np.sinh(u) * np.sin(u)
    plus = np.cosh(u) * np.sin(u) + np.sinh(u) * np.cos(u)
    minus = np.sinh(u) * np.cos(u) - np.cosh(u) * np.sin(u)
    edge = np.array([[-odd[-1], even[-1]], [-plus[-1], minus[-1]]])
    a, b = np.linalg.solve(edge, [-nu * curvature / (2.0 * rate**2), 0.0])
    slope = rate * (a * minus + b * plus)[-1]
    sag = trapezoid((a * even + b * odd) ** 2, u / rate)
    membrane = sheet.young_pa * t * curvature * sag
    return float(2.0 * (D * (curvature * half + nu * slope) + membrane))


@cache
def _tangent(sheet: Sheet, largest: float) -> CubicSpline:
    """Return dM/dκ over |κ| up to a largest one."""
    grid = largest * np.linspace(0.0, 1.0, 400) ** 2
    moments = CubicSpline(grid, [bending_moment(sheet, k) for k in grid.tolist()])
    return moments.derivative()


def clamped_loads(sheet: Sheet, poses: Sequence[tuple[float, float]]) -> tuple[Vector, Vector]:
    """Return P [N] and M at the clamp [N m] (n,) at poses (α [rad], half distance [m])."""
    EI, L = sheet.bending_stiffness_nm2, sheet.length_m
    states = rod.follow_symmetric(EI, L, poses)
    largest = 1.5 * max(float(np.abs(s.curvature_per_m).max()) for s in states)
    tangent = _tangent(sheet, largest)
    loads = []
    for (alpha, half_distance), state in zip(poses, states, strict=True):

        def along(s: Vector, y: Vector, p: Vector) -> Vector:
            return np.stack([y[1], -p[0] * np.sin(y[0]) / tangent(np.abs(y[1])), np.cos(y[0])])

        def ends(
            ya: Vector, yb: Vector, p: Vector, a: float = alpha, x: float = half_distance
        ) -> Vector:
            return np.array([ya[0] - a, yb[0], ya[2], yb[2] - x])

        half = state.s_m <= L / 2.0
        start = np.stack(
            [state.theta_rad[half], state.curvature_per_m[half], state.x_m[half] - state.x_m[0]]
        )
        found = solve_bvp(
            along, ends, state.s_m[half], start, p=[state.end_force_n], tol=1e-8, max_nodes=20000
        )
        if not found.success:
            raise RuntimeError(f"no state at {alpha:g} rad: {found.message}")
        kappa = float(found.y[1, 0])
        loads.append((found.p[0], np.sign(kappa) * bending_moment(sheet, abs(kappa))))
    force, moment = np.array(loads).T
    return force, moment
