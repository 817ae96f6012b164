"""Set-points of poses near nominal ones, whose set-points mink has solved: Newton's method."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.control.alter import turn
from dualbend.scene.ik import IKSolution
from dualbend.scene.observation import BENDING_TO_WORLD
from dualbend.scene.posed import Posed
from dualbend.types import SIDES, Vector, matvec

_POSE = 6
_MAX_STEPS = 6
"""One is enough in most cycles of a run."""

_RESTS = 1e-10
"""Residual [m, rad] that is left: set-points that stayed for less would be a dead zone."""

_LARGEST_MISS = 1e-2
"""By which what was foreseen may miss [rad, m] and tell how the next will: not after a jump, from
where Newton's method may lead to another configuration of the arm."""

_HALF_TURN = np.stack((np.eye(3), np.diag([-1.0, -1.0, 1.0])))
"""Axes of both arms' bending frames in the world (2, 3, 3)."""

_PITCHED = np.zeros((3, 3, 3))
_PITCHED[0, 0, 0] = _PITCHED[0, 2, 2] = _PITCHED[1, 2, 0] = _PITCHED[2, 1, 1] = 0.5
_PITCHED[1, 0, 2] = -0.5
_PITCHED_EACH = (_PITCHED @ _HALF_TURN[:, np.newaxis]).reshape(2, 3, 9)
"""½ Rᵀ (2, 3, 9) of both grips that are pitched by α, per cos α, sin α and 1."""

_SKEW = np.zeros((9, 3))
_SKEW[[5, 6, 1], [0, 1, 2]], _SKEW[[7, 2, 3], [0, 1, 2]] = 1.0, -1.0
"""Takes a matrix (9,) to r₂₃ − r₃₂, r₃₁ − r₁₃, r₁₂ − r₂₁."""

_TRACE = np.eye(3).ravel()

_SIGNS, _INWARD, _ONES = BENDING_TO_WORLD[:, ::2].copy(), BENDING_TO_WORLD[:, 1].copy(), np.ones(6)

_TWISTS = np.zeros((2, _POSE, 3))
_TWISTS[:, [0, 2, 4], [0, 1, 2]] = BENDING_TO_WORLD[:, [0, 2, 1]]
"""Of both grips in the world (2, 6, 3), per x, z and α in their bending frames."""


class PoseCorrection:
    """Joint angles (..., n) of grip poses that follow one another, of one world or many.

    Newton's method on the arms' own Jacobians, ``q ← q + J⁻¹ e``, with the grip's error e in the
    world, ``[p* − p; ½ Σ rᵢ × r*ᵢ]``. It starts where the last angles lead to, by the last J⁻¹
    times the change of the pose and by what that missed the last time. A step dq leaves at most
    ½ R (Σ|dqᵢ|)², R the arm's reach: where that is little enough nobody looks again. Each world has
    a memory of its own. Arms of six joints only: J (..., 2, 6, 6) of both arms is square.

    Parameters
    ----------
    model
        Of the robots alone.
    posed
        The same with the sites of both grips, of any leading shape.
    """

    def __init__(self, model: mujoco.MjModel, posed: Posed) -> None:
        self._posed, self._half_reach = posed, np.asarray(0.5 * posed.reach)
        self._lower, self._upper = model.jnt_range.T
        self._q: Vector | None = None
        worlds = self._half_reach.shape
        # What a call computes first, without allocating it anew.
        self._places = places = np.empty((*worlds, 2, 3))
        self._in_plane, self._lateral = places[..., ::2], places[..., 1]
        self._circle = circle = np.ones((*worlds, 2, 1, 3))
        self._cosine, self._sine = circle[..., 0, 0], circle[..., 0, 1]
        self._sought = np.empty((*worlds, 2, _POSE, 4))
        self._sought[..., 1:] = _TWISTS
        self._error = self._sought[..., 0]

    @staticmethod
    def suits(model: mujoco.MjModel) -> bool:
        """Tell whether both arms have as many joints as a pose has numbers."""
        counts = [
            sum(model.joint(i).name.startswith(side) for i in range(model.njnt)) for side in SIDES
        ]
        return counts == [_POSE, _POSE]

    def solve(self, pose: Vector, aside: Vector, last: Vector) -> IKSolution:
        """Return the angles for grips at x, z [m], α [rad]; aside y [m], roll and yaw [rad].

        Both (..., 2, 3), each in its arm's bending frame, with the axes that
        :func:`dualbend.control.alter.turn` has there. ``last`` (..., n): of the last cycle. Where
        they are not the very array that was returned for it, nothing is remembered.

        A world that is not reached (a joint's limit, a singular pose) has the angles that it came
        to. Residuals are bounds from above.
        """
        if last is not self._q:
            self._pose, self._missed = pose, np.zeros(last.shape)
            self._gain = np.zeros((*pose.shape[:-1], _POSE, 3))
        foreseen = last + matvec(self._gain, pose - self._pose).reshape(last.shape)
        start, halves = foreseen + self._missed, self._aim(pose, aside)
        self._look(start, halves)
        turns, self._gain = self._newton()
        q = start + turns.reshape(last.shape)
        inside, residual = (q > self._lower) & (q < self._upper), self._left_at_most(turns)
        steps: int | NDArray[np.int_] = 1
        if np.count_nonzero(inside) < q.size or np.count_nonzero(residual > _RESTS):
            left = inside.all(axis=-1)
            q, residual = np.where(left[..., np.newaxis], q, last), np.where(left, residual, np.inf)
            again = residual > _RESTS
            q, residual, steps = self._go_on(q, residual, halves)
            astray = again & (np.abs(q - foreseen).max(axis=-1) > _LARGEST_MISS)
            foreseen = np.where(astray[..., np.newaxis], q, foreseen)
        self._q, self._pose, self._missed = q, pose, q - foreseen
        return IKSolution(
            q=q, position_residual_m=residual, rotation_residual_rad=residual, iterations=steps
        )

    def _go_on(
        self, q: Vector, residual: Vector, halves: Vector
    ) -> tuple[Vector, Vector, NDArray[np.int_]]:
        """Look at worlds that may not be there yet, and go on with those that are not."""
        left, steps = np.isfinite(residual) & (residual > _RESTS), np.ones(residual.shape, np.int_)
        while np.count_nonzero(left):
            self._look(q, halves)
            residual = np.where(left, _largest(self._error), residual)
            left = left & (residual > _RESTS) & (steps < _MAX_STEPS)
            if not np.count_nonzero(left):
                break
            turns, _ = self._newton()
            moved, steps = q + turns.reshape(q.shape), steps + left
            inside = ((moved > self._lower) & (moved < self._upper)).all(axis=-1)
            at_most = np.where(inside, self._left_at_most(turns), np.inf)
            residual, left = np.where(left, at_most, residual), left & inside
            q, left = np.where(left[..., np.newaxis], moved, q), left & (residual > _RESTS)
        return q, residual, steps

    def _aim(self, pose: Vector, aside: Vector) -> Vector:
        """Note the places of poses in the world; return ½ R*ᵀ (..., 2, 3, 3) of their axes."""
        pitch = pose[..., 2]
        np.multiply(pose[..., :2], _SIGNS, out=self._in_plane)
        np.multiply(aside[..., 0], _INWARD, out=self._lateral)
        if np.count_nonzero(aside):
            angles = np.stack((aside[..., 1], pitch, aside[..., 2]), axis=-1)
            return np.multiply((_HALF_TURN @ turn(angles)).mT, 0.5, order="C")
        np.cos(pitch, out=self._cosine)
        np.sin(pitch, out=self._sine)
        return np.asarray(self._circle @ _PITCHED_EACH).reshape(*pose.shape, 3)

    def _look(self, q: Vector, halves: Vector) -> None:
        """Note e (..., 2, 6) of grips that are to be at their places with axes ½ R*ᵀ.

        e is the sine of a turn, as small near half a turn: beyond a quarter, e is infinite.
        """
        grips, axes = self._posed.frames(q)
        error = self._error
        np.subtract(self._places, grips, out=error[..., :3])
        # Σ rᵢ × r*ᵢ is twice the skew part of R* Rᵀ.
        turned = (axes.reshape(halves.shape) @ halves).reshape(axes.shape)
        np.matmul(turned, _SKEW, out=error[..., 3:])
        beyond = turned @ _TRACE < 0.5  # ½ + cos of the turn
        if np.count_nonzero(beyond):
            error[beyond, 3:] = np.inf

    def _newton(self) -> tuple[Vector, Vector]:
        """Return J⁻¹ e (..., 2, 6), and J⁻¹ (..., 2, 6, 3) of x, z and α in the bending frames.

        Of a singular J the one is NaN and the other 0, which must not stop other worlds.
        """
        jacobian, sought = self._posed.jacobian(), self._sought
        try:
            found = np.asarray(np.linalg.solve(jacobian, sought))
        except np.linalg.LinAlgError:
            found = np.zeros(sought.shape)
            found[..., 0] = np.nan
            for at in np.ndindex(sought.shape[:-2]):
                if np.linalg.matrix_rank(jacobian[at]) == _POSE:
                    found[at] = np.linalg.solve(jacobian[at], sought[at])
        return found[..., 0], found[..., 1:]

    def _left_at_most(self, turns: Vector) -> Vector:
        """Return what steps (..., 2, 6) leave at most (...) [m, rad]."""
        sums = np.vecdot(np.abs(turns), _ONES)
        most = np.maximum(sums[..., 0], sums[..., 1])
        return np.asarray(self._half_reach * (most * most))


def _largest(error: Vector) -> Vector:
    """Return by how much places [m] or turns [rad] (..., 2, 6) are off at most (...)."""
    of = error.reshape(*error.shape[:-2], 4, 3)
    return np.asarray(np.sqrt(np.vecdot(of, of).max(axis=-1)))
