"""Set-points of poses beside nominal ones, whose set-points mink has solved: Newton's method."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.control.alter import turn
from dualbend.scene.ik import IKSolution
from dualbend.scene.observation import BENDING_TO_WORLD
from dualbend.scene.posed import Posed
from dualbend.types import SIDES, Vector

_POSE = 6
_MAX_STEPS = 6
"""One or two are enough for deviations of millimetres."""

_RESTS = 1e-10
"""Residual [m, rad] that is left: set-points that stayed for less would be a dead zone."""

_CURVATURE = 60.0
"""Of a grip at most R from all joints a step by dq leaves at most ½ R (Σ|dqᵢ|)² <= 3 R Σ dqᵢ²: with
this number for R up to 20 m."""

_ABOVE, _BELOW = np.array([7, 2, 3]), np.array([5, 6, 1])
"""Where a matrix (9,) has its skew part: r₃₂ − r₂₃, r₁₃ − r₃₁, r₂₁ − r₁₂."""

_HALF_TURN = np.stack((np.eye(3), np.diag([-1.0, -1.0, 1.0])))
"""Axes of both arms' bending frames in the world (2, 3, 3)."""


class PoseCorrection:
    """Joint angles (..., n) of grip poses near those of known angles, one world or many.

    Newton's method on the arms' own Jacobians, ``q ← q + J⁻¹ e``, with the grip's error e in the
    world, ``[p* − p; ½ Σ rᵢ × r*ᵢ]``, to well within mink's tolerances. Arms of six
    joints only: J (..., 2, 6, 6) of both arms is square.

    Parameters
    ----------
    model
        Of the robots alone.
    posed
        The same with the sites of both grips, of any leading shape.
    """

    def __init__(self, model: mujoco.MjModel, posed: Posed) -> None:
        self._posed = posed
        self._lower, self._upper = model.jnt_range.T

    @staticmethod
    def suits(model: mujoco.MjModel) -> bool:
        """Tell whether both arms have as many joints as a pose has numbers."""
        counts = [
            sum(model.joint(i).name.startswith(side) for i in range(model.njnt)) for side in SIDES
        ]
        return counts == [_POSE, _POSE]

    def solve(self, places: Vector, axes: Vector, start: Vector) -> IKSolution:
        """Return the angles for grips at places (..., 2, 3) with axes (..., 2, 3, 3) in the world.

        A world that is not reached (a joint's limit, a singular pose) has its last angles. Its
        residuals are bounds from above where the last step was too short to need a look.
        """
        if start.ndim == 1:
            return self._solve_one(places, axes, start)
        q, steps = start, np.zeros(start.shape[:-1], dtype=np.int_)
        left = np.ones(start.shape[:-1], dtype=np.bool_)
        residual, halves = np.empty((*start.shape[:-1], 2)), _halves(axes)
        for step in range(_MAX_STEPS + 1):
            error = self._error(q, places, halves)
            found = _residuals(error)
            np.copyto(residual, found, where=left[..., np.newaxis])
            left = left & (np.maximum(found[..., 0], found[..., 1]) > _RESTS)
            if step == _MAX_STEPS or not np.count_nonzero(left):
                break
            turns = _solved(self._posed.jacobian(), error).reshape(q.shape)
            moved = q + turns
            inside = (moved > self._lower) & (moved < self._upper)
            if not inside.all():
                left = left & inside.all(axis=-1)
            q = moved if left.all() else np.where(left[..., np.newaxis], moved, q)
            steps += left
            at_most = _left_at_most(turns)
            rests = left & (at_most <= _RESTS)
            if np.count_nonzero(rests):
                np.copyto(residual, at_most[..., np.newaxis], where=rests[..., np.newaxis])
                left = left & ~rests
                if not np.count_nonzero(left):
                    break
        return IKSolution(
            q=q,
            position_residual_m=residual[..., 0],
            rotation_residual_rad=residual[..., 1],
            iterations=steps,
        )

    def _solve_one(self, places: Vector, axes: Vector, start: Vector) -> IKSolution:
        """Do the same for one world, whose decisions are plain numbers: half the time."""
        q, steps, halves = start, 0, _halves(axes)
        while True:
            error = self._error(q, places, halves)
            position, rotation = _residuals(error).tolist()
            if max(position, rotation) <= _RESTS or steps == _MAX_STEPS:
                break
            turns = _solved(self._posed.jacobian(), error).ravel()
            moved = q + turns
            if not ((moved > self._lower) & (moved < self._upper)).all():
                break
            q, steps, at_most = moved, steps + 1, float(_left_at_most(turns))
            if at_most <= _RESTS:
                position = rotation = at_most
                break
        return IKSolution(
            q=q,
            position_residual_m=position,
            rotation_residual_rad=rotation,
            iterations=steps,
        )

    def _error(self, q: Vector, places: Vector, halves: Vector) -> Vector:
        """Return e (..., 2, 6) of axes that are given as ½ R*ᵀ."""
        grips, axes = self._posed.frames(q)
        # Σ rᵢ × r*ᵢ is twice the skew part of R* Rᵀ.
        turns = (axes.reshape(halves.shape) @ halves).reshape(axes.shape)
        error = np.empty((*places.shape[:-1], _POSE))
        np.subtract(places, grips, out=error[..., :3])
        below, above = turns.take(_BELOW, axis=-1), turns.take(_ABOVE, axis=-1)
        np.subtract(below, above, out=error[..., 3:])
        return error


def _halves(axes: Vector) -> Vector:
    """Return ½ R*ᵀ (..., 3, 3): halves have the same digits."""
    return np.multiply(axes.mT, 0.5, order="C")


def _residuals(error: Vector) -> Vector:
    """Return how far places [m] and turns [rad] (..., 2) are off, the worse arm's of either."""
    of = error.reshape(*error.shape[:-1], 2, 3)
    squares = np.vecdot(of, of)
    return np.asarray(np.sqrt(np.maximum(squares[..., 0, :], squares[..., 1, :])))


def _left_at_most(turns: Vector) -> Vector:
    """Return the largest residual (...) [m, rad] after steps (..., n)."""
    return np.asarray(_CURVATURE * np.vecdot(turns, turns))


def grip_frames(pose: Vector, aside: Vector) -> tuple[Vector, Vector]:
    """Return places (..., 2, 3) and axes (..., 2, 3, 3) of both grips in the world.

    ``pose`` (..., 2, 3) x, z [m], α [rad] and ``aside`` (..., 2, 3) y [m], roll and yaw [rad], each
    in its arm's bending frame, with the axes that :func:`dualbend.control.alter.turn` has there.
    """
    places = np.empty(pose.shape)
    places[..., ::2], places[..., 1] = pose[..., :2], aside[..., 0]
    places *= BENDING_TO_WORLD
    if np.count_nonzero(aside):
        angles = np.stack((aside[..., 1], pose[..., 2], aside[..., 2]), axis=-1)
        return places, np.asarray(_HALF_TURN @ turn(angles))
    axes = np.zeros((*pose.shape, 3))
    axes[..., 0, 0] = axes[..., 2, 2] = np.cos(pose[..., 2])
    axes[..., 0, 2] = np.sin(pose[..., 2])
    axes[..., 2, 0] = -axes[..., 0, 2]
    axes[..., 1, 1] = 1.0
    axes[..., 1, :2, :] *= -1.0
    return places, axes


def _solved(jacobian: Vector, error: Vector) -> Vector:
    """Return J⁻¹ e (..., 2, 6): NaN where J is singular, which must not stop other worlds."""
    try:
        return np.asarray(np.linalg.solve(jacobian, error[..., np.newaxis])[..., 0])
    except np.linalg.LinAlgError:
        found = np.full(error.shape, np.nan)
        for at in np.ndindex(error.shape[:-1]):
            if np.linalg.matrix_rank(jacobian[at]) == _POSE:
                found[at] = np.linalg.solve(jacobian[at], error[at])
        return found
