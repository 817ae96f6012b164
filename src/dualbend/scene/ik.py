"""Inverse kinematics of both arms with mink, on a model that holds the robots and nothing else."""

from __future__ import annotations

import math

import mink
import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.errors import InputError
from dualbend.scene.mjcf import about_z
from dualbend.types import SIDES, Mask, Reals, Vector

Targets = tuple[mink.SE3, mink.SE3]
"""World poses of the left and the right grip frame."""

TOLERANCE_M = TOLERANCE_RAD = 1e-7
"""Residual at which the iteration stops: what is left must make no joint speed to speak of, since
the sign of a joint's speed decides the friction that is fed forward."""

_DAMPING = 1e-12
"""Keeps the QP definite at a singular pose, too small to slow Newton's convergence elsewhere."""

_POSE, _POSTURE_COST = 6, 1e-4
_POSTURE_RESTS_RAD, _LARGEST_STEP_RAD = 1e-8, 0.5

_IN_PLANE: Vector = np.zeros((len(SIDES), 3))

_MAX_ITERATIONS = 20
_MAX_HOME_ITERATIONS = 200


class IKSolution(msgspec.Struct, frozen=True, kw_only=True):
    """Joint angles (..., n) of both arms and how well they reach their targets (...)."""

    q: Vector
    position_residual_m: Reals
    rotation_residual_rad: Reals
    iterations: int | NDArray[np.int_]

    @property
    def reached(self) -> bool | Mask:
        """Both residuals are within the tolerance."""
        near: bool | Mask = self.position_residual_m <= TOLERANCE_M
        return near & (self.rotation_residual_rad <= TOLERANCE_RAD)


class InverseKinematics:
    """Joint angles (n,) that put both grip frames at given poses, within the joint limits.

    Each call does Newton steps ``dq = argmin |J dq − e|²`` within the joint limits (a QP in mink),
    from a start that the caller predicts, until the residual e is below the tolerance.

    Arms with more joints than a pose needs take the solution nearest to a posture: the step is then
    ``dq = J⁺ e + (1 − J⁺ J)(q_posture − q)``, until the second part rests too. So an angle depends
    on the pose alone and not on the way there.

    Parameters
    ----------
    model
        Of the robots alone, :func:`dualbend.scene.cell.robots_only`.
    posture : (n,)
        Which of its solutions a redundant arm takes; the others do not need it.
    """

    def __init__(self, model: mujoco.MjModel, posture: Vector | None = None) -> None:
        self._configuration = mink.Configuration(model)
        self._redundant = model.nv > _POSE * len(SIDES)
        self._posture = np.zeros(model.nv) if posture is None else posture
        self._posture_task = mink.PostureTask(model, cost=_POSTURE_COST)
        self._posture_task.set_target(self._posture)
        self._tasks = [
            mink.FrameTask(f"{side}_{GRIP_SITE}", "site", position_cost=1.0, orientation_cost=1.0)
            for side in SIDES
        ]
        self._limits = [mink.ConfigurationLimit(model)]
        self._lower, self._upper = model.jnt_range.T
        self.model = model

    def solve(
        self, targets: Targets, start: Vector, max_iterations: int = _MAX_ITERATIONS
    ) -> IKSolution:
        """Return the joint angles for the grip poses of the left and right arm in the world."""
        configuration = self._configuration
        configuration.update(start)
        for task, target in zip(self._tasks, targets, strict=True):
            task.set_target(target)
        for iteration in range(max_iterations + 1):
            errors = [task.compute_error(configuration) for task in self._tasks]
            position = max(math.sqrt(e[:3] @ e[:3]) for e in errors)
            rotation = max(math.sqrt(e[3:] @ e[3:]) for e in errors)
            at_pose = position <= TOLERANCE_M and rotation <= TOLERANCE_RAD
            if iteration == max_iterations or (at_pose and not self._redundant):
                break
            step = self._redundant_step(errors) if self._redundant else self._newton_step()
            if at_pose and np.abs(step).max() < _POSTURE_RESTS_RAD:
                break
            configuration.integrate_inplace(step, 1.0)
        return IKSolution(
            q=configuration.q.copy(),
            position_residual_m=position,
            rotation_residual_rad=rotation,
            iterations=iteration,
        )

    def _newton_step(self) -> Vector:
        """Minimise the tasks' error within the limits: the QP's free minimum where it is inside."""
        free = mink.build_ik(self._configuration, self._tasks, 1.0, damping=_DAMPING, limits=[])
        return self._within_limits(np.linalg.solve(free.P, -free.q), self._tasks)

    def _redundant_step(self, errors: list[Vector]) -> Vector:
        """Step towards the pose, and within it towards the posture; mink's QP at the limits."""
        configuration = self._configuration
        jacobian = np.vstack([task.compute_jacobian(configuration) for task in self._tasks])
        # mink's Jacobian is that of the error, which the step takes to zero.
        inverse = np.linalg.pinv(jacobian)
        pull = self._posture - configuration.q
        step = pull - inverse @ (np.concatenate(errors) + jacobian @ pull)
        size = float(np.abs(step).max())
        step *= min(1.0, _LARGEST_STEP_RAD / size) if size > 0.0 else 1.0
        return self._within_limits(step, [*self._tasks, self._posture_task])

    def _within_limits(self, step: Vector, tasks: list[mink.Task]) -> Vector:
        """Return the step, or mink's QP where it would pass a joint limit."""
        configuration = self._configuration
        reached = configuration.q + step
        if (reached > self._lower).all() and (reached < self._upper).all():
            return np.asarray(step)
        return np.asarray(
            mink.solve_ik(configuration, tasks, 1.0, "daqp", damping=_DAMPING, limits=self._limits)
        )

    def solve_from_home(self, targets: Targets, home: Vector) -> IKSolution:
        """Solve far from a known solution; raise InputError where a target is out of reach."""
        solution = self.solve(targets, home, _MAX_HOME_ITERATIONS)
        if not solution.reached:
            raise InputError(self.describe_miss(solution))
        return solution

    def describe_miss(self, solution: IKSolution) -> str:
        """Say how far from the target the search ended, and which joints were at their limits."""
        margin = np.minimum(solution.q - self._lower, self._upper - solution.q)
        at_limit = [self.model.joint(int(i)).name for i in np.flatnonzero(margin < 1e-3)]
        where = f", at the limit of {', '.join(at_limit)}" if at_limit else ""
        return (
            f"grip pose out of reach: the search ended "
            f"{1e3 * solution.position_residual_m:.1f} mm and "
            f"{np.degrees(solution.rotation_residual_rad):.2f} degrees away{where}"
        )


def grip_targets(pose: Vector, aside: Vector = _IN_PLANE) -> Targets:
    """Return both grips' world poses from x, z [m], α [rad] (2, 3), each in its bending frame.

    ``aside`` (2, 3): y [m], roll and yaw [rad] out of the bending plane; the axes are then
    R_z(yaw) R_x(roll) R_y(α), as :func:`dualbend.control.alter.turn` has them.
    """
    if aside.any():
        left, right = grip_targets(pose)
        return _moved(left, 1.0, aside[0]), _moved(right, -1.0, aside[1])
    (x_l, z_l, a_l), (x_r, z_r, a_r) = pose.tolist()
    cl, sl = math.cos(a_l / 2), math.sin(a_l / 2)
    cr, sr = math.cos(a_r / 2), math.sin(a_r / 2)
    # Left: R_y(α). Right: R_z(π) R_y(α), as a quaternion (w, x, y, z).
    return (
        mink.SE3(np.array([cl, 0.0, sl, 0.0, x_l, 0.0, z_l])),
        mink.SE3(np.array([0.0, -sr, 0.0, cr, -x_r, 0.0, z_r])),
    )


def _moved(planar: mink.SE3, sign: float, aside: Vector) -> mink.SE3:
    """Return a pose in the plane with y, roll and yaw of a frame that is turned by 0 or π.

    Roll and yaw are of an arm's own axes: those of x and y point the other way on the right.
    """
    y, roll, yaw = aside.tolist()
    turned = mink.SO3.from_z_radians(yaw) @ mink.SO3.from_x_radians(sign * roll)
    return mink.SE3.from_rotation_and_translation(
        turned @ planar.rotation(), planar.translation() + np.array([0.0, sign * y, 0.0])
    )


def carried_targets(pose: Vector, place: Vector, aside: Vector = _IN_PLANE) -> Targets:
    """Return both grips' world poses where the bending frames are carried to a place.

    ``pose`` (2, 3) and ``aside`` as :func:`grip_targets` has them, heights above the place;
    ``place`` (4,) x, y, z [m] and turn about the vertical [rad] in the world.
    """
    x, y, z, yaw = place.tolist()
    frame = mink.SE3(np.array([*about_z(yaw), x, y, z]))
    left, right = grip_targets(pose, aside)
    return frame @ left, frame @ right
