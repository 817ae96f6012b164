"""One arm at a pose of the nominal path: its compliance, and the joints that set-points move."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.mechanics.jacobian import PLANE
from dualbend.run.arms import joint_stiffness, one_kind
from dualbend.run.cell import make_integral, make_servo
from dualbend.scenario.scenario import Scenario
from dualbend.scene.arm_compliance import ArmCompliance
from dualbend.scene.ik import grip_targets
from dualbend.stability.plant.arm import Joints
from dualbend.types import SIDES, Vector

_POSE, _DIFFERENCE = 6, 1e-3
_MOVED = 1e-6
"""A joint that a unit of any set-point moves by less is not moved: rounding of the poses."""


class PosedArm(ArmCompliance):
    """A scenario's left arm with its servos, at one pose after another.

    ``home`` (3,): x, z [m], α [rad] of the grips where the servos' feed-forward was set, the path's
    start. Raises InputError where a pose is out of reach.
    """

    def __init__(self, scenario: Scenario, home: Vector) -> None:
        arms = one_kind(scenario, "the stability of the loop")
        super().__init__(
            arms,
            joint_stiffness(scenario),
            scenario.grasp,
            integrates=scenario.robot.servo.integral is not None,
        )
        self.move(home)
        servo = make_servo(scenario, self._model, self._q)
        self._integral_gain = make_integral(scenario, self._model).gain
        self._n = arms.left.model.count
        nothing, unit = np.zeros((2, self._n * len(SIDES)))
        unit += 1.0
        fed = servo.setpoint(nothing, nothing, unit) * servo.stiffness
        self._feed_forward = fed[: self._n]
        self._friction = self._model.dof_frictionloss.ravel()[: self._n]
        viscous = self._model.dof_damping.ravel()
        self._damping = (servo.damping + viscous)[: self._n]

    def _setpoint(self) -> Vector:
        """Return what x, z, α of the grip ask of the joints (n, 3): J⁻¹, or by differences.

        A redundant arm's answer bends with its posture, so its own inverse kinematics is asked.
        """
        if self._n == _POSE:
            return np.asarray(np.linalg.inv(self._jacobian)[:, PLANE])
        columns = []
        for step in _DIFFERENCE * np.eye(len(PLANE)):
            ahead, back = (
                self._ik.solve(grip_targets(np.array([pose, pose])), self._q).q[: self._n]
                for pose in (self._pose + step, self._pose - step)
            )
            columns.append((ahead - back) / (2.0 * _DIFFERENCE))
        return np.stack(columns, axis=1)

    def joints(self) -> Joints:
        """Return the joints that set-points in the plane move."""
        mass = np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_crb(self._model, self._data)
        mujoco.mj_fullM(self._model, self._data, mass)
        setpoint = self._setpoint()
        # Without dry friction nothing holds a joint but its servo.
        moved = (np.abs(setpoint).max(axis=1) > _MOVED) | (self._friction == 0.0)
        return Joints(
            mass=mass[: self._n, : self._n][np.ix_(moved, moved)],
            stiffness=self._stiffness[moved],
            damping=self._damping[moved],
            feed_forward=self._feed_forward[moved],
            jacobian=self._jacobian[PLANE, :][:, moved],
            setpoint=setpoint[moved],
            integral_gain=self._integral_gain,
            dry_friction=self._friction[moved],
        )
