"""Inertia of the tool beyond the force/torque sensor."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.types import SIDES, Vector


def tool_inertia(model: mujoco.MjModel, data: mujoco.MjData, site: int) -> Vector:
    """Return the inertia (3, 3) in x, z, α of what hangs beyond the left sensor, at its grip."""
    inertia, hand = np.zeros((3, 3)), model.body(f"{SIDES[0]}_hand").id
    for body in range(hand, model.nbody):
        above = body
        while above > hand:
            above = int(model.body_parentid[above])
        if above != hand:
            continue
        lever = data.xipos[body] - data.site_xpos[site]
        moves = np.array([[1.0, 0.0, lever[2]], [0.0, 1.0, -lever[0]]])
        inertia += model.body_mass[body] * moves.T @ moves
        axis = data.ximat[body].reshape(3, 3)[1]
        inertia[2, 2] += float(axis**2 @ model.body_inertia[body])
    return inertia
