"""The robots alone, placed at joint angles: one pair of arms, or a pair for each of many worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch

from dualbend.scene.observation import Source
from dualbend.types import SIDES, Vector


class Posed(Protocol):
    """Robots that can be placed; ``data`` has the fields of an MjData, of any leading shape."""

    data: Source

    def place(self, q: Vector) -> Source:
        """Place the robots at joint angles (..., n), update their frames; return the data."""

    def jacobian(self, sites: Vector) -> Vector:
        """Return that of a site on each arm (..., 2, 6, 6), arms of six joints, left and right.

        Translation and rotation in the world, by the own arm's joints, where it was placed.
        """

    def move(self, q: Vector, speed: Vector) -> Vector:
        """Place the robots and let them move; return their Coriolis torques (..., n) [N m]."""


class PosedArms:
    """One pair of arms, of a model of the robots alone, without gravity."""

    def __init__(self, robots: mujoco.MjModel) -> None:
        self._model = weightless(robots)
        self.data = mujoco.MjData(self._model)
        self._placed = b""
        self._jacobians = np.zeros((len(SIDES), 6, robots.nv))

    def place(self, q: Vector) -> mujoco.MjData:
        """As :class:`Posed` has it; a cycle asks several times at the same angles."""
        if (at := q.tobytes()) != self._placed:
            self.data.qpos[:], self._placed = q, at
            mujoco.mj_kinematics(self._model, self.data)
        return self.data

    def jacobian(self, sites: Vector) -> Vector:
        """As :class:`Posed` has it."""
        mujoco.mj_comPos(self._model, self.data)
        for whole, site in zip(self._jacobians, sites, strict=True):
            mujoco.mj_jacSite(self._model, self.data, whole[:3], whole[3:], site)
        return own_joints(self._jacobians)

    def move(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        torque = np.empty(self._model.nv)
        self.place(q).qvel[:] = speed
        mujoco.mj_comPos(self._model, self.data)
        mujoco.mj_comVel(self._model, self.data)
        mujoco.mj_rne(self._model, self.data, 0, torque)
        return torque


class PosedWorlds:
    """A pair of arms for each of n worlds, placed on ``threads`` threads."""

    def __init__(self, robots: Sequence[mujoco.MjModel], threads: int) -> None:
        models = [weightless(model) for model in robots]
        self.data = Batch(models[0], len(models), threads)
        self.data.set_models(models)
        for name in ("site_xpos", "site_xmat", "qfrc_bias"):
            self.data.bind(name)
        self._qpos, self._qvel = self.data.bind("qpos"), self.data.bind("qvel")

    def place(self, q: Vector) -> Batch:
        """As :class:`Posed` has it."""
        if not np.array_equal(self._qpos, q):
            self._qpos[:] = q
            self.data.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
        return self.data

    def jacobian(self, sites: Vector) -> Vector:
        """As :class:`Posed` has it."""
        both = np.empty((len(self._qpos), len(SIDES), 6, self._qvel.shape[-1]))
        bodies = self.data.model.site_bodyid[sites]
        for i, (site, body) in enumerate(zip(sites, bodies, strict=True)):
            moves, turns = self.data.jac(body, self.data.site_xpos[:, site])
            both[:, i, :3], both[:, i, 3:] = moves, turns
        return own_joints(both)

    def move(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        self._qpos[:], self._qvel[:] = q, speed
        self.data.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
        return np.asarray(self.data.qfrc_bias).copy()


def own_joints(both: Vector) -> Vector:
    """Return the part (..., 2, 6, n/2) of Jacobians (..., 2, 6, n) that is of each arm's joints."""
    half = both.shape[-1] // 2
    return np.stack((both[..., 0, :, :half], both[..., 1, :, half:]), axis=-3)


def weightless(robots: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy without gravity, contacts and constraints: nothing is left but kinematics."""
    model = robots.__copy__()
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    )
    return model
