"""One arm at a pose: the compliance of its joints and its grasp, and the inertia of its tool."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.arm.pair import ArmPair
from dualbend.mechanics.compliance import endpoint_compliance, grasp_compliance
from dualbend.mechanics.jacobian import PLANE, site_jacobian
from dualbend.mechanics.tool import tool_inertia
from dualbend.scene.cell import GraspConfig, robots_only
from dualbend.scene.ik import InverseKinematics, carried_targets, grip_targets
from dualbend.types import SIDES, Vector

_STEPS = 10
"""From home to a pose that Newton's steps do not reach at once."""


class ArmCompliance:
    """The left arm at one pose after another; the right one is its image by a turn about z.

    ``grasp`` (3, 3) is the compliance of its grasp in x, z, α [m/N, rad/(N m)].

    Parameters
    ----------
    arms
        Both arms; they stand alike.
    stiffness : (n,)
        Of the servos of all joints [N m/rad].
    grasp
        The pads.
    integrates
        The servos have integral action: under a steady load the joints stand where they were sent.
    """

    def __init__(
        self, arms: ArmPair, stiffness: ArrayLike, grasp: GraspConfig, *, integrates: bool
    ) -> None:
        self._model = robots_only(arms).compile()
        self._data = mujoco.MjData(self._model)
        self._ik = InverseKinematics(self._model, arms.home)
        self._q = self._home = arms.home
        self._left = arms.joints("left")
        self._stiffness = np.asarray(stiffness, dtype=np.float64)[self._left]
        self._integrates = integrates
        self._site = self._model.site(f"{SIDES[0]}_{GRIP_SITE}").id
        self.grasp = grasp_compliance(
            grasp.translational_stiffness_n_per_m, grasp.rotational_stiffness_n_m_per_rad
        )

    def move(self, pose: Vector, place: Vector | None = None) -> None:
        """Go to x, z [m] and α [rad] of the grip; InputError where that is out of reach.

        ``place`` (4,): where the bending frames are carried to, as
        :func:`dualbend.scene.ik.carried_targets` has it, not turned; None: nowhere.
        """
        both = np.array([pose, pose])
        targets = grip_targets(both) if place is None else carried_targets(both, place)
        solution = self._ik.solve(targets, self._q)
        if not solution.reached:
            start = self._home if place is not None else self._followed(pose)
            solution = self._ik.solve_from_home(targets, start)
        self._pose, self._q = pose, solution.q
        self._data.qpos[:] = self._q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        self._jacobian = site_jacobian(self._model, self._data, self._site)[:, self._left]

    def _followed(self, pose: Vector) -> Vector:
        """Return joint angles (n,) near a pose, in steps from home: a small arm turns far there."""
        self._data.qpos[:] = q = self._home
        mujoco.mj_kinematics(self._model, self._data)
        x, _, z = self._data.site_xpos[self._site]
        turn = self._data.site_xmat[self._site]
        home = np.array([x, z, np.arctan2(-turn[6], turn[0])])
        for share in np.linspace(0.0, 1.0, _STEPS + 1)[1:].tolist():
            between = home + share * (pose - home)
            q = self._ik.solve(grip_targets(np.array([between, between])), q).q
        return q

    @property
    def compliance(self) -> Vector:
        """Compliance of the joints at the grip (3, 3) in x, z, α [m/N, rad/(N m)].

        It is that of loads which change faster than an integral action follows.
        """
        return endpoint_compliance(self._jacobian[PLANE, :], self._stiffness)

    def displacement(self, load: Vector, held_n_m: Vector) -> Vector:
        """Return x, z [m] and α [rad] (3,) by which joints and grasp yield to a steady load (3,).

        δ = J q + C_g w, q_j = (|τ_j| − h_j)₊ sign(τ_j) / k_j and τ = Jᵀ w: integral action takes
        off what its share h ``held_n_m`` (n,) of the torque limit holds.
        """
        jacobian = self._jacobian[PLANE, :]
        torque = jacobian.T @ load
        beyond = np.sign(torque) * np.maximum(np.abs(torque) - held_n_m[self._left], 0.0)
        return np.asarray(jacobian @ (beyond / self._stiffness) + self.grasp @ load)

    @property
    def rest_compliance(self) -> Vector:
        """Compliance of the joints at the grip (3, 3) under a steady load."""
        return self.compliance * float(not self._integrates)

    @property
    def tool_inertia(self) -> Vector:
        """Inertia (3, 3) in x, z, α of what hangs beyond the sensor, at the grip."""
        return tool_inertia(self._model, self._data, self._site)
