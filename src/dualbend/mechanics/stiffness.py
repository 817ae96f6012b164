"""Stiffness of an arm's end point from the stiffness of its joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualbend.errors import InputError


def endpoint_stiffness(jacobian: ArrayLike, joint_stiffness: ArrayLike) -> NDArray[np.float64]:
    """Return the static stiffness that the end point shows when only the joints give way.

    K = (J Kq⁻¹ Jᵀ)⁻¹, with f = K dx. The stiffness felt along one axis while the others are free
    to yield is 1 / (K⁻¹)_ii, which is never above K_ii.

    Parameters
    ----------
    jacobian : (m, n)
        End-point Jacobian, m ≤ n [m/rad, rad/rad].
    joint_stiffness : (n,)
        Kq, positive [N m/rad].

    Returns
    -------
    (m, m) stiffness [N/m, N m/rad], in the Jacobian's frame.

    Raises
    ------
    InputError
        Shapes do not fit, a stiffness is not positive, or J has lost rank (infinite stiffness).

    Source: Salisbury (1980), active stiffness control of a manipulator in Cartesian coordinates.
    """
    J = np.asarray(jacobian, dtype=np.float64)
    kq = np.asarray(joint_stiffness, dtype=np.float64)
    if J.ndim != 2 or kq.shape != (J.shape[1],):
        raise InputError(f"jacobian (m, n) needs joint_stiffness (n,), got {J.shape}, {kq.shape}")
    if not np.all(kq > 0.0):
        raise InputError(f"joint stiffness must be positive, got {kq} N m/rad")
    if np.linalg.matrix_rank(J) < J.shape[0]:
        raise InputError("the Jacobian has lost rank: some direction is infinitely stiff")
    return np.asarray(np.linalg.inv((J / kq) @ J.T))
