"""An arm from its URDF, in plain NumPy: the oracle for the MuJoCo model that is made of it.

Frames are the URDF's: link i is T_i = T_{i-1} P_i R(a_i, q_i), P_i the joint's origin and a_i its
axis. Nothing of MuJoCo is asked.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualbend.arm.urdf import UrdfChain
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.errors import InputError

Array = NDArray[np.float64]


def _vector(chain: UrdfChain, name: str, values: ArrayLike) -> Array:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (len(chain.joints),):
        raise InputError(f"{name} needs shape ({len(chain.joints)},), got {vector.shape}")
    return vector


def _turn(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) about an axis: a aᵀ + cos (1 − a aᵀ) + sin [a]×."""
    x, y, z = axis
    along = np.outer(axis, axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(along + np.cos(angle) * (np.eye(3) - along) + np.sin(angle) * across)


def link_frames(chain: UrdfChain, q_rad: ArrayLike) -> Array:
    """Return the frames of base and moving links in the base's, (n + 1, 4, 4) [m]."""
    frames = [np.eye(4)]
    for joint, angle in zip(chain.joints, _vector(chain, "q_rad", q_rad), strict=True):
        own = np.eye(4)
        own[:3, :3] = _turn(joint.axis, float(angle))
        frames.append(frames[-1] @ joint.pose @ own)
    return np.array(frames)


def flange_pose(chain: UrdfChain, q_rad: ArrayLike) -> Array:
    """Return the flange in the base frame (4, 4) [m]."""
    return np.asarray(link_frames(chain, q_rad)[-1] @ chain.flange)


def inverse_dynamics(
    chain: UrdfChain,
    q_rad: ArrayLike,
    velocity_rad_per_s: ArrayLike,
    acceleration_rad_per_s2: ArrayLike,
    *,
    gravity_m_per_s2: float = GRAVITY_M_PER_S2,
) -> Array:
    """Return the joint torques of a motion, τ = M(q) q̈ + c(q, q̇) + g(q), without rotors.

    Recursive Newton-Euler in the base's axes; gravity enters as an upward acceleration of the base.
    Shapes (n,) [rad, rad/s, rad/s², N m]. Raises InputError for another shape.
    Source: Luh, Walker and Paul (1980), with joint i about its axis in link i's frame.
    """
    frames = link_frames(chain, q_rad)
    rates = _vector(chain, "velocity_rad_per_s", velocity_rad_per_s)
    accelerations = _vector(chain, "acceleration_rad_per_s2", acceleration_rad_per_s2)
    axes = [
        frame[:3, :3] @ joint.axis for frame, joint in zip(frames[1:], chain.joints, strict=True)
    ]
    origins = frames[:, :3, 3]
    omega, domega = np.zeros(3), np.zeros(3)
    linear = np.array([0.0, 0.0, gravity_m_per_s2])
    wrenches = []
    for i, link in enumerate(chain.links):
        linear = linear + _swing(omega, domega, origins[i + 1] - origins[i])
        domega = domega + axes[i] * accelerations[i] + np.cross(omega, axes[i] * rates[i])
        omega = omega + axes[i] * rates[i]
        R = frames[i + 1, :3, :3]
        inertia, lever = R @ link.inertia_kg_m2 @ R.T, R @ link.centre_m
        force = link.mass_kg * (linear + _swing(omega, domega, lever))
        moment = inertia @ domega + np.cross(omega, inertia @ omega)
        wrenches.append((force, moment + np.cross(lever, force)))
    torques = np.zeros(len(axes))
    force, moment = np.zeros(3), np.zeros(3)  # of everything beyond, about origin i + 1
    beyond = origins[-1]
    for i in reversed(range(len(axes))):
        moment = moment + np.cross(beyond - origins[i + 1], force) + wrenches[i][1]
        force = force + wrenches[i][0]
        beyond = origins[i + 1]
        torques[i] = axes[i] @ moment
    return torques


def _swing(omega: Array, domega: Array, arm: Array) -> Array:
    """Return ω̇ × r + ω × (ω × r), the acceleration of a point r away on a turning body (3,)."""
    return np.asarray(np.cross(domega, arm) + np.cross(omega, np.cross(omega, arm)))


def gravity_torque(chain: UrdfChain, q_rad: ArrayLike) -> Array:
    """Return the torques that hold the arm still, g(q), (n,) [N m]."""
    rest = np.zeros(len(chain.joints))
    return inverse_dynamics(chain, q_rad, rest, rest)


def mass_matrix(chain: UrdfChain, q_rad: ArrayLike) -> Array:
    """Return the joint-space inertia without rotors, column i = τ(q, 0, e_i), (n, n) [kg m²]."""
    n = len(chain.joints)
    columns = [
        inverse_dynamics(chain, q_rad, np.zeros(n), e, gravity_m_per_s2=0.0) for e in np.eye(n)
    ]
    return np.column_stack(columns)
