"""The robots alone, placed at joint angles: one pair of arms, or a pair for each of many worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS

from dualbend.types import SIDES, Mask, Vector

_POSE = 6


class Posed(Protocol):
    """Robots at joint angles (..., n), and where some of their sites then are."""

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """Return places (..., sites, 3) and axes (..., sites, 9) of the sites in the world."""

    def jacobian(self, worlds: Mask) -> Vector:
        """Return that of the first site of each arm (..., 2, 6, 6), where they were placed.

        Translation and rotation in the world, by the own arm's six joints; of the others than the
        named worlds (...) it is 0.
        """

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """Return the torques (..., n) [N m] of Coriolis and centrifugal forces."""


class PosedArms:
    """One pair of arms; ``sites``: one of each arm, left and right, and any others."""

    def __init__(self, robots: mujoco.MjModel, sites: Sequence[str]) -> None:
        self.model = weightless(robots)
        self.data = mujoco.MjData(self.model)
        self._sites = np.array([robots.site(name).id for name in sites])
        self._jacobians = np.zeros((len(SIDES), _POSE, robots.nv))
        self._torque = np.empty(robots.nv)
        self._placed = b""

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """As :class:`Posed` has it; a cycle asks several times at the same angles."""
        if (at := q.tobytes()) != self._placed:
            self._placed = at
            self.place(q)
        return self.read()

    def jacobian(self, worlds: Mask) -> Vector:
        """As :class:`Posed` has it."""
        mujoco.mj_comPos(self.model, self.data)
        for whole, site in zip(self._jacobians, self._sites, strict=False):
            mujoco.mj_jacSite(self.model, self.data, whole[:3], whole[3:], site)
        left, right = self._jacobians
        return np.stack((left[:, :_POSE], right[:, _POSE:]))

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        self.frames(q)
        return self.torque(speed).copy()

    def place(self, q: Vector) -> None:
        """Place the arms at joint angles (n,)."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)

    def read(
        self, places: Vector | None = None, axes: Vector | None = None
    ) -> tuple[Vector, Vector]:
        """Return places (sites, 3) and axes (sites, 9), in given arrays or in new ones."""
        data = self.data
        return (
            data.site_xpos.take(self._sites, axis=0, out=places),
            data.site_xmat.take(self._sites, axis=0, out=axes),
        )

    def torque(self, speed: Vector) -> Vector:
        """Return the torques (n,) [N m] of Coriolis and centrifugal forces where it was placed."""
        self.data.qvel[:] = speed
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)
        mujoco.mj_rne(self.model, self.data, 0, self._torque)
        return self._torque


class PosedWorlds:
    """The pairs of arms of n worlds of one structure, one after the other in one place of memory.

    What has not moved since is not computed again.
    """

    def __init__(self, robots: Sequence[mujoco.MjModel], sites: Sequence[str]) -> None:
        self._arms = PosedArms(robots[0], sites)
        model, names = self._arms.model, differing(robots)
        names = [name for name in names if name not in _NOT_OF_A_MOTION]
        self._numbers = [
            [(getattr(model, name), getattr(one, name)) for name in names] for one in robots
        ]
        self._q = np.full((len(robots), len(self._arms.data.qpos)), np.nan)
        self._places, self._axes = (np.array([part] * len(robots)) for part in self._arms.read())

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """As :class:`Posed` has it."""
        moved = np.any(q != self._q, axis=-1)
        if moved.any():
            self._q = q.copy()
            for world in np.flatnonzero(moved).tolist():
                self._place(world).read(self._places[world], self._axes[world])
        return self._places, self._axes

    def jacobian(self, worlds: Mask) -> Vector:
        """As :class:`Posed` has it."""
        found = np.zeros((len(self._q), len(SIDES), _POSE, _POSE))
        for world in np.flatnonzero(worlds).tolist():
            found[world] = self._place(world).jacobian(worlds)
        return found

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        self.frames(q)
        torque = np.empty_like(speed)
        for world, v in enumerate(speed):
            torque[world] = self._place(world).torque(v)
        return torque

    def _place(self, world: int) -> PosedArms:
        for own, number in self._numbers[world]:
            own[...] = number
        self._arms.place(self._q[world])
        return self._arms


_NOT_OF_A_MOTION = ("body_invweight0", "dof_invweight0", "dof_M0", "actuator_acc0", "dof_length")
"""What is derived from a model's numbers for its constraints, and moves nothing by itself."""


def differing(models: Sequence[mujoco.MjModel]) -> list[str]:
    """Return the names of the fields of which some model has other values than the first."""
    names = [name for name in sorted(MODEL_FIELDS) if not name.startswith("opt.")]
    first = {name: getattr(models[0], name, None) for name in names}
    return [
        name
        for name, value in first.items()
        if isinstance(value, np.ndarray)
        and not all(np.array_equal(value, getattr(model, name)) for model in models[1:])
    ]


def weightless(robots: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy without gravity."""
    model = robots.__copy__()
    model.opt.gravity[:] = 0.0
    return model
