"""The robots alone, placed at joint angles: one pair of arms, or a pair for each of many worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np

from dualbend.types import SIDES, Vector

_POSE = 6


class Posed(Protocol):
    """Robots at joint angles (..., n), and where some of their sites then are."""

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """Return places (..., sites, 3) and axes (..., sites, 9) of the sites in the world."""

    def jacobian(self) -> Vector:
        """Return that of the first site of each arm (..., 2, 6, 6), where they were placed.

        Translation and rotation in the world, by the own arm's six joints.
        """

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """Return the torques (..., n) [N m] of Coriolis and centrifugal forces."""


class PosedArms:
    """One pair of arms; ``sites``: one of each arm, left and right, and any others."""

    def __init__(self, robots: mujoco.MjModel, sites: Sequence[str]) -> None:
        self._model = weightless(robots)
        self.data = mujoco.MjData(self._model)
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

    def jacobian(self) -> Vector:
        """As :class:`Posed` has it."""
        mujoco.mj_comPos(self._model, self.data)
        for whole, site in zip(self._jacobians, self._sites, strict=False):
            mujoco.mj_jacSite(self._model, self.data, whole[:3], whole[3:], site)
        left, right = self._jacobians
        return np.stack((left[:, :_POSE], right[:, _POSE:]))

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        self.frames(q)
        return self.torque(speed).copy()

    def place(self, q: Vector) -> None:
        """Place the arms at joint angles (n,)."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self.data)

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
        mujoco.mj_comPos(self._model, self.data)
        mujoco.mj_comVel(self._model, self.data)
        mujoco.mj_rne(self._model, self.data, 0, self._torque)
        return self._torque


class PosedWorlds:
    """The pairs of arms of n worlds; what has not moved since is not computed again."""

    def __init__(self, worlds: Sequence[PosedArms]) -> None:
        self._worlds, first = worlds, worlds[0]
        self._q = np.full((len(worlds), len(first.data.qpos)), np.nan)
        self._places, self._axes = (np.array([part] * len(worlds)) for part in first.read())

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """As :class:`Posed` has it."""
        moved = np.any(q != self._q, axis=-1)
        if moved.any():
            self._q = q.copy()
            for world in np.flatnonzero(moved).tolist():
                one = self._worlds[world]
                one.place(q[world])
                one.read(self._places[world], self._axes[world])
        return self._places, self._axes

    def jacobian(self) -> Vector:
        """As :class:`Posed` has it."""
        return np.array([one.jacobian() for one in self._worlds])

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        self.frames(q)
        return np.array([one.torque(v) for one, v in zip(self._worlds, speed, strict=True)])


def weightless(robots: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy without gravity."""
    model = robots.__copy__()
    model.opt.gravity[:] = 0.0
    return model
