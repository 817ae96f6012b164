"""Jacobian of a point of a MuJoCo model."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.types import Vector

PLANE = (0, 2, 4)
"""x, z and the turn about y in a wrench or a twist of six."""


def site_jacobian(model: mujoco.MjModel, data: mujoco.MjData, site: int) -> Vector:
    """Return ∂(v, ω)/∂q̇ (6, nv) of a site in world axes; needs kinematics and `mj_comPos`."""
    jacobian = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
    return jacobian
