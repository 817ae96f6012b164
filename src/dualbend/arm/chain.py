"""Many configurations of one arm at once: forward kinematics, Jacobian, inverse kinematics.

A product of exponentials in NumPy, T(q) = e^{S_1 q_1} ... e^{S_n q_n} M, whose screws S and rest
pose M are read from the compiled arm: fast enough to try thousands of places for a base.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.arm.mjcf import GRIP_SITE, with_gripper
from dualbend.arm.model import ArmModel
from dualbend.types import Mask, Vector

_DAMPING = 1e-4
"""Of the damped least squares, over the squared length: bounds a step near a singular pose."""

_LARGEST_STEP_RAD = 0.5
_SOLVED, _STILL_RAD, _SEED = 1e-9, 1e-6, 11
_EYE = np.eye(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class SerialChain:
    """An arm with the gripper: axes and points of its joints at q = 0, the grip's pose there.

    Attributes
    ----------
    axes, points : (n, 3) unit vectors and places [m] in the base frame at q = 0
    slides : (n,) which joints are slides, whose q is in m
    grip : (4, 4) pose of the grip frame at q = 0
    range_rad : (n, 2)
    length_m : scale between translation and rotation, the arm's reach
    """

    axes: Vector
    points: Vector
    slides: Mask
    grip: Vector
    range_rad: Vector
    length_m: float

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.axes)

    def forward(self, q: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Return the grip's rotation (b, 3, 3) and place (b, 3), joint axes and points (b, n, 3).

        ``q`` (b, n) [rad]; everything in the base frame.
        """
        rotation = np.broadcast_to(_EYE, (len(q), 3, 3))
        place = np.zeros((len(q), 3))
        axes, points = np.empty((2, len(q), self.count, 3))
        for i in range(self.count):
            axes[:, i] = rotation @ self.axes[i]
            points[:, i] = rotation @ self.points[i] + place
            if self.slides[i]:
                place = place + axes[:, i] * q[:, i, None]
                continue
            turn = self._about(i, q[:, i])
            place = place + (rotation @ (self.points[i] - turn @ self.points[i])[..., None])[..., 0]
            rotation = rotation @ turn
        grip = rotation @ self.grip[:3, 3] + place
        return rotation @ self.grip[:3, :3], grip, axes, points

    def jacobian(self, grip: Vector, axes: Vector, points: Vector) -> Vector:
        """Return the grip's Jacobian (b, 6, n), velocity over the length, then turn rate."""
        velocity = np.cross(axes, grip[:, None] - points) / self.length_m
        if self.slides.any():
            velocity = np.where(self.slides[:, None], axes / self.length_m, velocity)
            axes = np.where(self.slides[:, None], 0.0, axes)
        return np.concatenate((velocity, axes), axis=2).transpose(0, 2, 1)

    def solve(
        self,
        rotation: Vector,
        place: Vector | None,
        q: Vector,
        posture: Vector | None,
        iterations: int,
    ) -> tuple[Vector, Vector]:
        """Move configurations (b, n) towards grip poses (b, 3, 3), (b, 3) in the base frame.

        Without a place towards the rotation alone, wherever the grip then is.

        Damped least squares, kept within the ranges; with a posture (b, n) a redundant arm comes
        as near to it as the pose lets it. Returns q and the misses (b,), in lengths and rad.
        """
        low, high = self.range_rad.T
        for _ in range(iterations):
            error, jacobian = self._error(rotation, place, q)
            solved = bool(_miss(error).max() < _SOLVED)
            if solved and (posture is None or self.count <= 6):
                break
            transposed = jacobian.transpose(0, 2, 1)
            damping = _DAMPING * _miss(error)[:, None, None] * np.eye(jacobian.shape[1])
            inverse = transposed @ np.linalg.inv(jacobian @ transposed + damping)
            step = (inverse @ error[..., None])[..., 0]
            if posture is not None and self.count > 6:
                pull = posture - q
                step += pull - (inverse @ (jacobian @ pull[..., None]))[..., 0]
            largest = np.abs(step).max(axis=1, keepdims=True)
            if solved and largest.max() < _STILL_RAD:
                break
            step *= np.minimum(1.0, _LARGEST_STEP_RAD / np.maximum(largest, 1e-12))
            q = np.clip(q + step, low, high)
        return q, _miss(self._error(rotation, place, q)[0])

    def _error(self, rotation: Vector, place: Vector | None, q: Vector) -> tuple[Vector, Vector]:
        found, grip, axes, points = self.forward(q)
        turn = rotation @ found.transpose(0, 2, 1)
        # The vector of a rotation from its skew part, well defined up to half a turn.
        skew = 0.5 * (turn[:, [2, 0, 1], [1, 2, 0]] - turn[:, [1, 2, 0], [2, 0, 1]])
        sine = np.linalg.norm(skew, axis=1)
        cosine = 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0)
        angle = np.arctan2(sine, cosine)
        ratio = np.divide(angle, sine, out=np.ones_like(angle), where=sine >= 1e-9)
        jacobian, turn_rad = self.jacobian(grip, axes, points), skew * ratio[:, None]
        if place is None:
            return turn_rad, jacobian[:, 3:]
        return np.concatenate(((place - grip) / self.length_m, turn_rad), axis=1), jacobian

    @functools.cached_property
    def _crosses(self) -> Vector:
        """Matrices (n, 2, 3, 3) of the axes' cross products and their squares."""
        x, y, z = self.axes.T
        none = np.zeros(self.count)
        K = np.stack((none, -z, y, z, none, -x, -y, x, none), axis=1).reshape(-1, 3, 3)
        return np.stack((K, K @ K), axis=1)

    def _about(self, joint: int, angle: Vector) -> Vector:
        """Return rotations (b, 3, 3) of a joint by angles (b,); Rodrigues."""
        s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
        K, square = self._crosses[joint]
        return np.asarray(_EYE + s * K + (1.0 - c) * square)

    def manipulability(self, q: Vector) -> Vector:
        """Return √det(J Jᵀ) (b,) [-] of the Jacobian scaled by the length; Yoshikawa (1985)."""
        _, grip, axes, points = self.forward(q)
        return volume(self.jacobian(grip, axes, points))

    @functools.cached_property
    def largest_manipulability(self) -> float:
        """The largest of 4000 seeded configurations [-]."""
        low, high = self.range_rad.T
        q = np.random.default_rng(_SEED).uniform(low, high, (4000, self.count))
        return float(self.manipulability(q).max())

    def margins(self, q: Vector) -> Vector:
        """Return how far joints (..., n) are from their nearer limits [rad], slides in lengths."""
        low, high = self.range_rad.T
        return np.asarray(np.minimum(q - low, high - q)) / self.scale

    @functools.cached_property
    def scale(self) -> Vector:
        """What makes a joint's number (n,) an angle or a share of the length: 1 of a hinge."""
        return np.where(self.slides, self.length_m, 1.0)


def volume(jacobian: Vector) -> Vector:
    """Return √det(J Jᵀ) (b,) of Jacobians (b, 6, n)."""
    square = np.linalg.det(jacobian @ jacobian.transpose(0, 2, 1))
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def _miss(error: Vector) -> Vector:
    return np.asarray(np.linalg.norm(error, axis=1))


@functools.cache
def serial_chain(arm: ArmModel) -> SerialChain:
    """Return the chain of an arm with the gripper at its flange."""
    model = with_gripper(arm.spec(looks=False)).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    joints = [model.joint(joint).id for joint in arm.joints]
    grip = np.eye(4)
    site = data.site(f"tool_{GRIP_SITE}")
    grip[:3, :3], grip[:3, 3] = site.xmat.reshape(3, 3), site.xpos
    return SerialChain(
        axes=data.xaxis[joints].copy(),
        points=data.xanchor[joints].copy(),
        slides=np.array(arm.slides),
        grip=grip,
        range_rad=np.array(arm.range_rad),
        length_m=arm.reach_m,
    )
