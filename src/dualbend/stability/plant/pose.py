"""One arm at a pose of the nominal path: what it gives way, and its moved joints."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.mechanics.tool import tool_inertia
from dualbend.run.arms import arm_pair, one_kind
from dualbend.run.cell import make_servo
from dualbend.scenario.scenario import Scenario
from dualbend.scene.cell import robots_only
from dualbend.scene.ik import InverseKinematics, grip_targets
from dualbend.stability.plant.arm import Joints
from dualbend.types import SIDES, Vector

_PLANAR = [0, 2, 4]
"""x, z and the turn about y among the six of a site's Jacobian."""

_POSE, _DIFFERENCE = 6, 1e-3
_MOVED = 1e-6
"""A joint that a unit of any set-point moves by less is not moved: rounding of the poses."""


class PosedArm:
    """The left arm at one pose after another; the right one is its image by a turn about z.

    Parameters
    ----------
    scenario
        Says the cell, the servos and the grasp.
    home : (3,)
        x, z [m], α [rad] of the grips where the servos' feed-forward was set: the path's start.

    Raises
    ------
    InputError
        A pose is out of reach.
    """

    def __init__(self, scenario: Scenario, home: Vector) -> None:
        arms = one_kind(arm_pair(scenario), "the stability of the loop")
        self._model = robots_only(arms).compile()
        self._data = mujoco.MjData(self._model)
        self._ik = InverseKinematics(self._model, arms.home)
        self._q = self._home = arms.home
        self._site = self._model.site(f"{SIDES[0]}_{GRIP_SITE}").id
        self._n = arms.left.model.count
        self._reach(home)
        servo = make_servo(scenario, self._model, self._q)
        nothing, unit = np.zeros((2, self._n * len(SIDES)))
        unit += 1.0
        fed = servo.setpoint(nothing, nothing, unit) * servo.stiffness
        self._stiffness = servo.stiffness[: self._n]
        self._feed_forward = fed[: self._n]
        self._rubs = self._model.dof_frictionloss.ravel()[: self._n] > 0.0
        viscous = self._model.dof_damping.ravel()
        self._damping = (servo.damping + viscous)[: self._n]
        grasp = scenario.grasp
        self.grasp = np.diag(
            1.0
            / np.array(
                [
                    grasp.translational_stiffness_n_per_m,
                    grasp.translational_stiffness_n_per_m,
                    grasp.rotational_stiffness_n_m_per_rad,
                ]
            )
        )
        """What a grasp gives way (3, 3) in x, z, α per wrench on it."""

    def _reach(self, pose: Vector) -> None:
        self._pose = pose
        targets = grip_targets(np.array([pose, pose]))
        solution = self._ik.solve(targets, self._q)
        self._q = (
            solution if solution.reached else self._ik.solve_from_home(targets, self._home)
        ).q

    def move(self, pose: Vector) -> None:
        """Go to x, z [m] and α [rad] of the grip."""
        self._reach(pose)
        self._data.qpos[:] = self._q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_crb(self._model, self._data)
        translation, rotation = np.zeros((2, 3, self._model.nv))
        mujoco.mj_jacSite(self._model, self._data, translation, rotation, self._site)
        self._jacobian = np.vstack([translation, rotation])[:, : self._n]

    @property
    def compliance(self) -> Vector:
        """What the joints give way, J Kq⁻¹ Jᵀ (3, 3) in x, z, α: wrench on the arm to its give."""
        planar = self._jacobian[_PLANAR]
        return np.asarray((planar / self._stiffness) @ planar.T)

    def _setpoint(self) -> Vector:
        """Return what x, z, α of the grip ask of the joints (n, 3): J⁻¹, or by differences.

        A redundant arm's answer bends with its posture, so its own inverse kinematics is asked.
        """
        if self._n == _POSE:
            return np.asarray(np.linalg.inv(self._jacobian)[:, _PLANAR])
        columns = []
        for step in _DIFFERENCE * np.eye(len(_PLANAR)):
            ahead, back = (
                self._ik.solve(grip_targets(np.array([pose, pose])), self._q).q[: self._n]
                for pose in (self._pose + step, self._pose - step)
            )
            columns.append((ahead - back) / (2.0 * _DIFFERENCE))
        return np.stack(columns, axis=1)

    def joints(self) -> Joints:
        """Return the joints that set-points in the plane move."""
        mass = np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_fullM(self._model, self._data, mass)
        setpoint = self._setpoint()
        # Without dry friction nothing holds a joint but its servo.
        moved = (np.abs(setpoint).max(axis=1) > _MOVED) | ~self._rubs
        return Joints(
            mass=mass[: self._n, : self._n][np.ix_(moved, moved)],
            stiffness=self._stiffness[moved],
            damping=self._damping[moved],
            feed_forward=self._feed_forward[moved],
            jacobian=self._jacobian[_PLANAR][:, moved],
            setpoint=setpoint[moved],
        )

    def tool_inertia(self) -> Vector:
        """Return the inertia (3, 3) in x, z, α of what hangs beyond the sensor, at the grip."""
        return tool_inertia(self._model, self._data, self._site)
