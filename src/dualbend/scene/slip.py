"""A sheet that slides in the jaws where a grip transmits more than its friction.

Friction bounds the force along the jaws' plane (x, y of the gripper's frame) and the moment about
their normal together, by the ellipsoid ``(F / 2μN)² + (M / 2μN r)² ≤ 1`` (Goyal, Ruina and
Papadopoulos, Wear 143, 1991; Howe and Cutkosky, Int. J. Robotics Research 15, 1996), r the mean
distance of the pad's points from its middle: the pressure is taken as even. What is beyond it is
returned to it (elastic predictor, return mapping): the edge slides by the rest, along the
ellipsoid's normal. The normal force, and the moments that tilt the jaws, have no limit.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from dualbend.scene.cell import PAD_LENGTH_M, PAD_SITE, PAD_WIDTH_M, GraspConfig
from dualbend.types import SIDES, Vector

_TANGENTIAL = np.array([0, 1, 5])
"""Which of a pad's six joints friction moves: along x and y, about z."""

_SOFT = 0.03
"""Stiffness of a sliding pad over that of one that holds: within a physics step the limit is met
by the pad's own forces, which would otherwise drag on a light edge as kilograms do."""

_NEAR, _STUCK = 0.5, 0.98
"""Shares of the limit from which on every physics step is looked at, and below which a sliding
edge holds again."""

_LEAST = 0.01
"""Share of its friction below which a grip lets go."""


_TINY_N = 1e-12


def turning_radius(length_m: float, width_m: float) -> float:
    """Return the mean distance of a rectangle's points from its middle [m].

    ``(2 d + (a²/b) asinh(b/a) + (b²/a) asinh(a/b)) / 12`` with the diagonal d.
    """
    a, b = length_m, width_m
    return (
        2.0 * math.hypot(a, b) + a * a / b * math.asinh(b / a) + b * b / a * math.asinh(a / b)
    ) / 12.0


class SlidingGrips:
    """Friction of both grips; looks once a cycle, and every physics step where one is near it.

    ``width_m`` of the sheet; ``grasp.friction`` is given. All over x, y [m] and r times the turn.

    Attributes
    ----------
    share : (2,) of the friction that each grip has; events lower it
    slip : (2, 3) how far each edge has slid along x, y [m] and turned about z [rad]
    offset : (2, 6) of the pads' sites, x, y, z [m], roll, pitch, yaw [rad]
    sliding, dropped : which grips slide, and which have lost the sheet
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, grasp: GraspConfig, width_m: float
    ) -> None:
        assert grasp.friction is not None
        self._model, self._data = model, data
        self.radius_m = turning_radius(PAD_LENGTH_M, min(PAD_WIDTH_M, width_m))
        self.limit_n = 2.0 * grasp.friction * grasp.normal_force_n
        self._scale = np.array([1.0, 1.0, self.radius_m])
        first = [model.joint(f"{side}_{PAD_SITE}_slide_x") for side in SIDES]
        self._joints = np.array([joint.id + _TANGENTIAL for joint in first])
        self._q = model.jnt_qposadr[self._joints]
        self._dof = model.jnt_dofadr[self._joints]
        self._holds = [model.equality(f"{side}_hold").id for side in SIDES]
        tangential, turning = (
            grasp.translational_stiffness_n_per_m,
            grasp.rotational_stiffness_n_m_per_rad / self.radius_m**2,
        )
        self._hard = np.array([tangential, tangential, turning])
        # Alike in all three: then the way back to the limit is along the ellipsoid's normal.
        self._soft = np.full(3, _SOFT * tangential)
        # As compiled, to the last bit; both hold polynomials, whose first coefficient is linear.
        self._stiffnesses = model.jnt_stiffness.reshape(model.njnt, -1)
        self._dampings = model.dof_damping.reshape(model.nv, -1)
        self._own = self._stiffnesses[self._joints, 0], self._dampings[self._dof, 0]
        self._loss_s = grasp.loss_time_s
        self.reset()

    def reset(self) -> None:
        """Let both grips hold, the edges where they are held."""
        self.share = np.ones(2)
        self.slip, self._load, self.offset = np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 6))
        self._before = np.full((2, 3), np.nan)
        self.sliding = [False, False]
        self.dropped = [False, False]
        self._held, self._is_soft = [False, False], [False, False]
        self.near = False
        for i in range(len(SIDES)):
            self._make(i, soft=False)

    def look(self) -> bool:
        """Look once a cycle; True where the offset of an edge that was let go is taken back."""
        changed = False
        for i, hold in enumerate(self._holds):
            held = bool(self._data.eq_active[hold])
            if held and self.share[i] < _LEAST:
                self._drop(i)
                held, changed = False, True
            if held and not self._held[i]:
                self.slip[i] = 0.0
            elif self._held[i] and not held and self.offset[i].any():
                self._let_go(i)
                changed = True
            self._held[i] = held
        holding = [i for i in range(len(SIDES)) if self._held[i]]
        sizes = [self._size(i, self._hard * self._state(i)[0]) for i in holding]
        self.near = any(self.sliding) or max(sizes, default=0.0) > _NEAR
        return changed

    def slide(self) -> bool:
        """Return each grip to its limit after a physics step; True where an edge has slid."""
        slid = [self._slide(i) for i in range(len(SIDES)) if self._held[i]]
        return any(slid)

    def replace(self, load: Vector) -> None:
        """Put what sliding pads bear into a load (2, 6): a pad's own state is set back by then."""
        for i in np.flatnonzero(self.sliding).tolist():
            load[i, _TANGENTIAL] = self._load[i]

    def _slide(self, i: int) -> bool:
        """Return one grip to its limit; True where it bears more, or slides on."""
        (q, v), stiffness = self._state(i), self._stiffness(i)
        borne = stiffness * (q + self._loss_s * v)
        # A steady push meets the limit exactly where the edge's speed goes on changing as it did.
        # One that has turned back has nothing to go on with: it would swing ever farther.
        change = np.nan_to_num(v - self._before[i])
        change[change * v > v * v] = 0.0
        step_s = self._model.opt.timestep  # of this step: those near a tip are divided
        ahead = (step_s + self._loss_s) * (v + change)
        load = stiffness * (q + ahead) if self._is_soft[i] else borne
        size = self._size(i, load)
        self.sliding[i] = self._is_soft[i] or size > 1.0
        if not self.sliding[i]:
            self._before[i] = np.nan
            return False
        self._load[i], self._before[i] = borne * self._scale, v
        along = float((v + change) @ load) / max(math.sqrt(load @ load), _TINY_N)
        # As fast, a pad that does not slide bears all of its limit within a step.
        fast = self._limit(i) / (self._hard[0] * (step_s + self._loss_s))
        soft = along > (0.25 if self._is_soft[i] else 1.0) * fast
        if size < _STUCK and along <= math.sqrt(change @ change):
            soft, ahead = False, np.zeros(3)  # it would turn back within a step: it holds again
        if soft != self._is_soft[i]:
            self._make(i, soft=soft)
        after = load / max(size, 1.0)
        moved = after / self._stiffness(i) - ahead
        self._shift(i, q / self._scale, moved / self._scale)
        edge = moved / self._scale + self.offset[i, _TANGENTIAL]
        self.slip[i] = edge - after / self._hard / self._scale
        if self.slip[i, 0] >= 0.5 * PAD_LENGTH_M:
            self._drop(i)
        return True

    def _drop(self, i: int) -> None:
        self._data.eq_active[self._holds[i]] = 0
        self._held[i], self.dropped[i] = False, True
        self._let_go(i)

    def _let_go(self, i: int) -> None:
        """Put a pad back that nothing pulls any more: soft as it was, it has swung far."""
        self._data.qpos[self._q[i]] = self._data.qvel[self._dof[i]] = 0.0
        self.offset[i], self._before[i], self.sliding[i] = 0.0, np.nan, False
        self._make(i, soft=False)

    def _state(self, i: int) -> tuple[Vector, Vector]:
        q, v = self._data.qpos[self._q[i]], self._data.qvel[self._dof[i]]
        return q * self._scale, v * self._scale

    def _stiffness(self, i: int) -> Vector:
        return self._soft if self._is_soft[i] else self._hard

    def _limit(self, i: int) -> float:
        return self.limit_n * float(self.share[i])

    def _size(self, i: int, load: Vector) -> float:
        """Return a load over the limit."""
        return math.sqrt(load @ load) / self._limit(i)

    def _make(self, i: int, *, soft: bool) -> None:
        """Make a pad soft or as stiff as it is, along the jaws' plane and about its normal."""
        self._is_soft[i] = soft
        stiffness, damping = self._own[0][i], self._own[1][i]
        if soft:
            stiffness = self._soft * self._scale**2
            damping = self._loss_s * stiffness
        self._stiffnesses[self._joints[i], 0] = stiffness
        self._dampings[self._dof[i], 0] = damping

    def _shift(self, i: int, before: Vector, after: Vector) -> None:
        """Move a pad from (x, y, yaw) to another place; the edge, in its site, stays where it is.

        ``p = q + R(ψ) s``; the pads' tilt, milliradians, is left out.
        """
        x, y, turn = self.offset[i, _TANGENTIAL]
        c, s = math.cos(before[2]), math.sin(before[2])
        along = before[0] - after[0] + c * x - s * y
        across = before[1] - after[1] + s * x + c * y
        c, s = math.cos(after[2]), math.sin(after[2])
        self.offset[i, _TANGENTIAL] = (
            c * along + s * across,
            c * across - s * along,
            turn + before[2] - after[2],
        )
        self._data.qpos[self._q[i]] = after
