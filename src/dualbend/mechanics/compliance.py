"""Compliance of an arm's end point and of its grasp, and a stiffness with compliances in series."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dualbend.errors import InputError
from dualbend.types import Vector


def endpoint_compliance(jacobian: ArrayLike, stiffness: ArrayLike) -> Vector:
    """Return how far the end point yields per wrench when only the joints behind it yield.

    C = J Kq⁻¹ Jᵀ, with dx = C f. Pushed along one axis while the others are free to yield, the end
    point shows the stiffness 1 / C_ii. Springs in series are joints too: their compliances add up.

    Parameters
    ----------
    jacobian : (m, n)
        End-point Jacobian [m/rad, rad/rad].
    stiffness : (n,)
        Kq, positive [N m/rad].

    Returns
    -------
    (m, m) compliance [m/N, rad/(N m)], in the Jacobian's frame; singular where J has lost rank.

    Raises
    ------
    InputError
        Shapes do not fit, or a stiffness is not positive.

    Source: Salisbury (1980), active stiffness control of a manipulator in Cartesian coordinates.
    """
    J, kq = np.asarray(jacobian, dtype=np.float64), np.asarray(stiffness, dtype=np.float64)
    if J.ndim != 2 or kq.shape != (J.shape[1],):
        raise InputError(f"jacobian (m, n) needs stiffness (n,), got {J.shape}, {kq.shape}")
    if not np.all(kq > 0.0):
        raise InputError(f"joint stiffness must be positive, got {kq} N m/rad")
    return np.asarray((J / kq) @ J.T)


def grasp_compliance(translational_n_per_m: float, rotational_nm_per_rad: float) -> Vector:
    """Return the compliance (3, 3) of a grasp in x, z, α, from the stiffness of its pads."""
    stiffness = [translational_n_per_m, translational_n_per_m, rotational_nm_per_rad]
    return endpoint_compliance(np.eye(3), stiffness)


def series_stiffness(stiffness: Vector, compliance: Vector) -> Vector:
    """Return a stiffness with a compliance in series: (1 + K C)⁻¹ K, also for a singular K."""
    return np.asarray(
        np.linalg.solve(np.eye(len(stiffness)) + stiffness @ compliance, stiffness),
        dtype=np.float64,
    )
