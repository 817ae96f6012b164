"""A compliant arm: its joints, servos and tool under load, over one command cycle.

The simulated arm follows its set-points to within what the load does to it. About a pose, with the
moved joints q, their mass matrix M, servos (K, D), the feed-forward inertia J₀ and the grip's
Jacobian J,

    (M + Jᵀ m J) q̈ + D (q̇ − q̇_r) + K (q − q_r − z) + Jᵀ S J q = J₀ q̈_r,

S and m the sheet's stiffness and mass at the grip, z the servos' integral action: each cycle
z ← z + k_i T (q_r − q) of its start. It is stepped as the simulation steps it: by backward Euler at
the physics step, which matters as half a step of delay.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dualbend.control.response import CommandResponse
from dualbend.stability.state_space import StateSpace
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class Joints:
    """The n joints of one arm that its set-points move, at one pose.

    ``mass`` (n, n) [kg m²] with the tool; ``stiffness``, ``damping``, ``feed_forward`` (n,) of the
    servo [N m/rad, N m s/rad, kg m²], the damping with the joint's viscous friction; ``jacobian``
    (3, n) to the grip's x, z, α; ``setpoint`` (n, 3): what a commanded x, z, α asks of the joints.
    A joint that nothing moves is held by its dry friction and is not among them.
    ``dry_friction`` (n,): Coulomb friction [N m], of which the servos feed most forward.
    ``integral_gain``: k_i T of the servos' integral action [-]; 0: none.
    """

    mass: Vector
    stiffness: Vector
    damping: Vector
    feed_forward: Vector
    jacobian: Vector
    setpoint: Vector
    dry_friction: Vector
    integral_gain: float = 0.0


@dataclass(frozen=True, kw_only=True)
class CompliantArm:
    """A moving arm with the sheet that it holds, and what the sensor reads of its motion.

    ``deviation_jacobian`` (3, 2): a grip's x, z, α per δx, δα; ``stiffness`` and ``mass`` (3, 3):
    of the sheet at the arm's own grip; ``stiffness_read`` and ``mass_read`` (2, 3): force x and
    moment that the sensing arm loses per displacement and per acceleration of this grip.
    """

    joints: Joints
    deviation_jacobian: Vector
    stiffness: Vector
    mass: Vector
    stiffness_read: Vector
    mass_read: Vector

    def friction_lag(self) -> Vector:
        """Return by how much less δx [m] and δα [rad] (2,) is read because of dry friction.

        A joint whose friction T_c is not fed forward is T_c/K behind its set-point. What the sensor
        reads of that is S J K⁻¹ T_c sign(q̇); over what it reads of a deviation it is h. Below 0 the
        reading is that of a grip ahead.
        """
        asked = self.joints.setpoint @ self.deviation_jacobian
        back = (self.joints.dry_friction / self.joints.stiffness)[:, np.newaxis] * np.sign(asked)
        read = np.diag(self.stiffness_read @ self.joints.jacobian @ back)
        own = np.diag(self.stiffness_read @ self.deviation_jacobian)
        return np.divide(read, own, out=np.zeros(2), where=own != 0.0)

    def cycle(
        self, response: CommandResponse, age_steps: int, acting: tuple[bool, bool]
    ) -> tuple[StateSpace, int]:
        """Return one cycle from set-points of the acting axes to wrench, and whole cycles of age.

        States: y, ẏ and the last set-point of each axis, then q and q̇, and z where the servos
        integrate. The wrench is the one of ``age_steps`` >= 1 before the cycle's start but for the
        whole cycles, which are returned.
        """
        steps = response.steps
        cycles = math.ceil(age_steps / steps)
        sensed = cycles * steps - age_steps
        sent, joints = self.deviation_jacobian[:, acting], self.joints
        axes, n = sent.shape[1], len(joints.stiffness)
        integrals = n if joints.integral_gain else 0
        size = 3 * axes + 2 * n + integrals + axes
        ends = _reference(response)
        q, v = (np.eye(n, size, k=3 * axes + shift) for shift in (0, n))
        from_axis = [
            np.eye(size)[[axis, axes + axis, 2 * axes + axis, size - axes + axis]]
            for axis in range(axes)
        ]
        asked = joints.setpoint @ sent
        z = np.eye(integrals, size, k=3 * axes + 2 * n)
        held = np.zeros((n, size))
        if integrals:
            z += joints.integral_gain * (asked @ np.eye(axes, size) - q)
            held += joints.stiffness[:, np.newaxis] * z
        advance = self._stepper(response.period_s / steps, asked, held)
        wrench = np.empty((0, size))
        for step in range(steps):
            reference = np.stack([ends[step] @ part for part in from_axis], axis=1)
            q, v, acceleration = advance(q, v, reference)
            if step == sensed:
                grip = joints.jacobian @ q, joints.jacobian @ acceleration
                wrench = -(self.stiffness_read @ grip[0] + self.mass_read @ grip[1])[list(acting)]
        last = np.stack([ends[-1] @ part for part in from_axis], axis=1)
        setpoints = np.eye(size)[size - axes :]
        end = np.vstack([last[0], last[1], setpoints, q, v, z])
        states = size - axes
        return StateSpace(
            a=end[:, :states], b=end[:, states:], c=wrench[:, :states], d=wrench[:, states:]
        ), cycles

    def _stepper(
        self, step_s: float, asked: Vector, held: Vector
    ) -> Callable[[Vector, Vector, Vector], tuple[Vector, Vector, Vector]]:
        """Return the physics step: joints, speeds and references to new joints, speeds, q̈.

        ``held`` (n, states): the integral's torques, which a cycle does not change.
        """
        joints = self.joints
        jacobian = joints.jacobian
        mass = joints.mass + jacobian.T @ self.mass @ jacobian
        spring = np.diag(joints.stiffness) + jacobian.T @ self.stiffness @ jacobian
        weights = np.stack([joints.stiffness, joints.damping, joints.feed_forward])
        drive = weights[:, :, np.newaxis] * asked
        solve = np.linalg.inv(mass + step_s * np.diag(joints.damping) + step_s**2 * spring)

        def advance(q: Vector, v: Vector, reference: Vector) -> tuple[Vector, Vector, Vector]:
            servo = np.einsum("kna,kas->ns", drive, reference) + held
            speed = solve @ (mass @ v + step_s * (servo - spring @ q))
            return q + step_s * speed, speed, (speed - v) / step_s

        return advance


def _reference(response: CommandResponse) -> Vector:
    """Return y, ẏ, ÿ at the end of each step (steps, 3, 4) of (y, ẏ, u_prev, u_next)."""
    omega = 2.0 * math.pi * response.config.natural_frequency_hz
    rows = np.empty((response.steps, 3, 4))
    for step in range(response.steps):
        c, d = response.outputs_at(step)
        rows[step, [0, 2]] = np.hstack([c, d])
        part = (step + 1) / response.steps
        setpoint = np.array([0.0, 0.0, 1.0 - part, part])
        # ÿ + 2ξω ẏ + ω² y = ω² u tells the speed, which the response does not.
        pull = omega**2 * (setpoint - rows[step, 0]) - rows[step, 2]
        rows[step, 1] = pull / (2.0 * response.config.damping_ratio * omega)
    return rows
