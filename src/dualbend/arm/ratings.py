"""What a data sheet would say of an arm, computed from its model: reach and payload."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.optimize import minimize

from dualbend.arm.mjcf import FLANGE_SITE
from dualbend.types import Vector

_SEED, _SAMPLES, _CLIMBED = 13, 1000, 3


def largest_reach(model: mujoco.MjModel) -> float:
    """Return the largest distance [m] from the shoulder, the second hinge, to the flange.

    The longest of 1000 seeded configurations climb to the maximum within the joints' ranges.
    """
    data, flange = mujoco.MjData(model), model.site(FLANGE_SITE).id
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    shoulder = int(hinges[min(1, len(hinges) - 1)])

    def minus_distance(q: Vector) -> float:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        return -float(np.linalg.norm(data.site_xpos[flange] - data.xanchor[shoulder]))

    samples = _samples(model)
    found = np.array([minus_distance(q) for q in samples])
    best = [
        minimize(minus_distance, samples[i], method="L-BFGS-B", bounds=model.jnt_range).fun
        for i in np.argsort(found)[:_CLIMBED]
    ]
    return -float(min(best))


def held_mass(model: mujoco.MjModel) -> float:
    """Return the mass [kg] at the flange that the joints' torques hold in any configuration.

    The smallest (τ_i − |g_i|) / |∂(g z)/∂q_i| of all joints and 1000 seeded configurations, with g
    the torque of the arm's own weight; 0 where that is too much by itself.
    """
    data, flange = mujoco.MjData(model), model.site(FLANGE_SITE).id
    jacobian = np.zeros((3, model.nv))
    gravity = float(-model.opt.gravity[2])
    limit, held = model.jnt_actfrcrange[:, 1], np.inf
    for q in _samples(model):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_jacSite(model, data, jacobian, None, flange)
        arm = np.maximum(np.abs(gravity * jacobian[2]), 1e-9)
        held = min(held, float(((limit - np.abs(data.qfrc_bias)) / arm).min()))
    return max(held, 0.0)


def _samples(model: mujoco.MjModel) -> Vector:
    low, high = model.jnt_range.T
    return np.random.default_rng(_SEED).uniform(low, high, (_SAMPLES, model.nv))
