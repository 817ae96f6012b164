"""The robots alone, placed at joint angles: one pair of arms, or a pair for each of many worlds."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS, Batch
from numpy.typing import NDArray

from dualbend.types import SIDES, Reals, Vector

_POSE = 6
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Coordinates of which a cross product is made."""


class Posed(Protocol):
    """Robots at joint angles (..., n), and where some of their sites then are."""

    @property
    def reach(self) -> Reals:
        """How far the first site of an arm can be from its joints' axes (...) [m], at least 1."""

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
        self._robots = robots
        self._sites = np.array([robots.site(name).id for name in sites])
        left, right = jacobians = np.zeros((len(SIDES), _POSE, robots.nv))
        self._jacobians = [
            (of[:3], of[3:], at) for of, at in zip(jacobians, self._sites.tolist(), strict=False)
        ]
        self._own = left[:, :_POSE], right[:, _POSE:]
        self._torque = np.empty(robots.nv)
        self._placed, self._frames = b"", (np.empty(0), np.empty(0))

    @property
    def reach(self) -> Reals:
        """As :class:`Posed` has it."""
        return _reach(self._robots, self._sites)

    @cached_property
    def _model(self) -> mujoco.MjModel:
        # With its state 0.6 MB, which a world of a batch does not need.
        return moving_only(self._robots)

    @cached_property
    def _data(self) -> mujoco.MjData:
        return mujoco.MjData(self._model)

    @cached_property
    def _views(self) -> tuple[Vector, Vector, Vector]:
        data = self._data
        return data.qpos, data.site_xpos, data.site_xmat

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """As :class:`Posed` has it; a cycle asks several times at the same angles."""
        if (at := q.tobytes()) != self._placed:
            sites, (angles, places, axes) = self._sites, self._views
            self._placed, angles[:] = at, q
            mujoco.mj_kinematics(self._model, self._data)
            self._frames = places.take(sites, axis=0), axes.take(sites, axis=0)
        return self._frames

    def jacobian(self) -> Vector:
        """As :class:`Posed` has it."""
        mujoco.mj_comPos(self._model, self._data)
        for moves, turns, site in self._jacobians:
            mujoco.mj_jacSite(self._model, self._data, moves, turns, site)
        return np.array(self._own)

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it."""
        self.frames(q)
        self._data.qvel[:] = speed
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)
        mujoco.mj_rne(self._model, self._data, 0, self._torque)
        return self._torque.copy()


class PosedWorlds:
    """The pairs of arms of n worlds of one structure, each to the bit as :class:`PosedArms` is.

    On so many ``threads``; worlds that have not moved since are not computed again.
    """

    def __init__(
        self, robots: Sequence[mujoco.MjModel], sites: Sequence[str], threads: int = 1
    ) -> None:
        self._robots, model = robots, moving_only(robots[0])
        self._data = data = Batch(model, len(robots), threads)
        for name in differing(robots):
            if name not in _NOT_OF_A_MOTION:
                data.expand(name)[:] = [getattr(one, name) for one in robots]
        self._sites = np.array([model.site(name).id for name in sites])
        self._arms = self._sites[: len(SIDES)]
        self._roots = model.body_rootid[model.site_bodyid[self._arms]]
        self._places, self._axes = data.bind("site_xpos"), data.bind("site_xmat")
        self._twists, self._centres = data.bind("cdof"), data.bind("subtree_com")
        self._torque: Vector = data.bind("qfrc_bias")
        self._q, self._speed = np.full(data.qpos.shape, np.nan), np.empty(0)
        self._frames = np.empty(0), np.empty(0)

    @property
    def reach(self) -> Reals:
        """As :class:`Posed` has it."""
        return np.array([_reach(one, self._sites) for one in self._robots])

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        """As :class:`Posed` has it."""
        moved = q != self._q
        if np.count_nonzero(moved):
            worlds = None if moved.all() else np.flatnonzero(moved.any(axis=-1))
            self._speed = np.empty(0)
            self._place(q, mujoco.mjtStage.mjSTAGE_POS, worlds)
        return self._frames

    def jacobian(self) -> Vector:
        """As :class:`Posed` has it, and as ``mj_jac`` computes it.

        A joint moves its subtree's centre of mass by (ω, v), and a point that lies off it by r by
        v + ω × r.
        """
        off = self._places.take(self._arms, axis=1) - self._centres.take(self._roots, axis=1)
        r = off[..., np.newaxis]
        twists = self._twists.reshape(-1, len(SIDES), _POSE, _POSE).mT
        found = np.empty(twists.shape)
        moves, turns = found[..., :3, :], found[..., 3:, :]
        turns[:] = twists[..., :3, :]
        crossed = turns.take(_NEXT, axis=-2) * r.take(_LAST, axis=-2)
        crossed -= turns.take(_LAST, axis=-2) * r.take(_NEXT, axis=-2)
        np.add(twists[..., 3:, :], crossed, out=moves)
        return found

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """As :class:`Posed` has it; the frames at these angles come with it."""
        if not (np.array_equal(q, self._q) and np.array_equal(speed, self._speed)):
            self._speed = self._data.qvel[:] = speed.copy()
            self._place(q, mujoco.mjtStage.mjSTAGE_VEL)
        return self._torque.copy()

    def _place(
        self, q: Vector, stage: mujoco.mjtStage, worlds: NDArray[np.int_] | None = None
    ) -> None:
        """Place some worlds; None: all."""
        self._q = self._data.qpos[:] = q.copy()
        self._data.forward(worlds, stage)
        sites = self._sites
        self._frames = self._places.take(sites, axis=1), self._axes.take(sites, axis=1)


def _reach(robots: mujoco.MjModel, sites: NDArray[np.int_]) -> float:
    """Return how far the first site of an arm can be from its joints' axes [m], at least 1.

    That is from joint to joint and on to the site, with the travel of slides.
    """
    data, slides = mujoco.MjData(robots), robots.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
    mujoco.mj_kinematics(robots, data)
    travel = np.abs(robots.jnt_range - robots.qpos0[:, np.newaxis]).max(axis=1) * slides
    ends = data.site_xpos[sites[: len(SIDES)], np.newaxis]
    joints = np.concatenate((data.xanchor.reshape(len(SIDES), -1, 3), ends), axis=1)
    lengths = np.linalg.norm(np.diff(joints, axis=1), axis=-1).sum(axis=-1)
    return max(1.0, float((lengths + travel.reshape(len(SIDES), -1).sum(axis=-1)).max()))


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


def moving_only(robots: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy that has no weight, touches nothing and is not held at its joints' limits."""
    model = robots.__copy__()
    model.opt.gravity[:] = 0.0
    disabled = mujoco.mjtDisableBit
    model.opt.disableflags |= int(disabled.mjDSBL_CONTACT | disabled.mjDSBL_CONSTRAINT)
    return model
