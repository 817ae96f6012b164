"""Set-points of poses beside nominal ones, whose set-points mink has solved: Newton's method."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.control.alter import turn
from dualbend.scene.ik import IKSolution
from dualbend.scene.observation import BENDING_TO_WORLD
from dualbend.scene.posed import Posed
from dualbend.types import SIDES, Mask, Vector

_POSE = 6
_MAX_STEPS = 6
"""One or two are enough for deviations of millimetres."""

_RESTS = 1e-10
"""Residual [m, rad] that is left: set-points that stayed for less would be a dead zone."""

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

        A world that is not reached (a joint's limit, a singular pose) has its last angles.
        """
        q, steps = start, np.zeros(start.shape[:-1], dtype=np.int_)
        left = np.ones(start.shape[:-1], dtype=np.bool_)
        for step in range(_MAX_STEPS + 1):
            error = self._error(q, places, axes)
            # Squares over both arms' places and turns, the worse arm's of either.
            halves = error.reshape(*start.shape[:-1], 2, 2, 3)
            squares = np.einsum("...i,...i->...", halves, halves).max(axis=-2)
            residual = np.sqrt(squares)
            position, rotation = residual[..., 0], residual[..., 1]
            left = left & (np.maximum(position, rotation) > _RESTS)
            if step == _MAX_STEPS or not np.count_nonzero(left):
                break
            jacobian = self._posed.jacobian(left)
            moved = q + _solved(jacobian, error, left).reshape(q.shape)
            left &= np.all((moved > self._lower) & (moved < self._upper), axis=-1)
            q = np.where(left[..., np.newaxis], moved, q)
            steps += left
        return IKSolution(
            q=q,
            position_residual_m=position,
            rotation_residual_rad=rotation,
            iterations=steps,
        )

    def _error(self, q: Vector, places: Vector, axes: Vector) -> Vector:
        """Return e (..., 2, 6)."""
        grips, axes_there = self._posed.frames(q)
        grip = axes_there.reshape(axes.shape)
        # Σ rᵢ × r*ᵢ is twice the skew part of R* Rᵀ.
        turns = (axes @ np.swapaxes(grip, -1, -2)).reshape(*axes.shape[:-2], 9)
        error = np.empty((*places.shape[:-1], _POSE))
        np.subtract(places, grips, out=error[..., :3])
        np.subtract(turns[..., _ABOVE], turns[..., _BELOW], out=error[..., 3:])
        error[..., 3:] *= 0.5
        return error


def grip_frames(pose: Vector, aside: Vector) -> tuple[Vector, Vector]:
    """Return places (..., 2, 3) and axes (..., 2, 3, 3) of both grips in the world.

    ``pose`` (..., 2, 3) x, z [m], α [rad] and ``aside`` (..., 2, 3) y [m], roll and yaw [rad], each
    in its arm's bending frame, with the axes that :func:`dualbend.control.alter.turn` has there.
    """
    places = np.stack((pose[..., 0], aside[..., 0], pose[..., 1]), axis=-1) * BENDING_TO_WORLD
    angles = np.stack((aside[..., 1], pose[..., 2], aside[..., 2]), axis=-1)
    return np.asarray(places), np.asarray(_HALF_TURN @ turn(angles))


def _solved(jacobian: Vector, error: Vector, worlds: Mask) -> Vector:
    """Return J⁻¹ e (..., 2, 6) of the named worlds (...), 0 of the others.

    NaN where J is singular, which must not stop the other worlds.
    """
    step = np.zeros(error.shape)
    jacobian, error = jacobian[worlds], error[worlds]
    try:
        step[worlds] = np.linalg.solve(jacobian, error[..., np.newaxis])[..., 0]
    except np.linalg.LinAlgError:
        found = np.full(error.shape, np.nan)
        for at in np.ndindex(error.shape[:-1]):
            if np.linalg.matrix_rank(jacobian[at]) == _POSE:
                found[at] = np.linalg.solve(jacobian[at], error[at])
        step[worlds] = found
    return step
