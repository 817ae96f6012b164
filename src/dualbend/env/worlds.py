"""Bending in many worlds as one vectorised environment: a batch, each world as it is alone."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from dualbend.batch.group import alone, grouped
from dualbend.batch.loop import BatchLoop
from dualbend.control.controller import Observation
from dualbend.env.base import SENSING, Info, end_of
from dualbend.env.bend import BendEnv
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import Settings
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Mask, Vector


class BendWorlds(VectorEnv[Vector, Vector, Any]):
    """``num_envs`` worlds of :class:`dualbend.env.bend.BendEnv`, stepped at once.

    Observations, actions and rewards of each are those that it has as an environment of its own,
    with one more axis. All are reset together: a world whose run has ended waits, its reward is 0,
    until the others' have, too (``AutoresetMode.DISABLED``). ``threads`` for the physics, by
    default as many as there are cores.

    Raises InputError where the scenario's runs can be no batch.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.DISABLED}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str = "fig6",
        settings: Settings = SENSING,
        *,
        moment_scale_nm: float = 0.5,
        failure_cost: float = 1000.0,
        threads: int | None = None,
    ) -> None:
        self._one = BendEnv(
            scenario, settings, moment_scale_nm=moment_scale_nm, failure_cost=failure_cost
        )
        for name, given in (("num_envs", num_envs), ("threads", threads)):
            if given is not None and given < 1:
                raise InputError(f"{name} = {given}: must be at least 1")
        self.num_envs, self._threads = num_envs, threads or os.cpu_count() or 1
        self._loop: BatchLoop | None = None
        self.single_action_space = self._one.action_space
        self.single_observation_space = self._one.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Vector, Info]:
        """Begin a run in every world; from one ``seed`` on each has the next one.

        Raises InputError where only some worlds are to be reset.
        """
        mask = (options or {}).get("reset_mask")
        if mask is not None and (np.shape(mask) != (self.num_envs,) or not np.all(mask)):
            raise InputError("reset_mask: the worlds of a batch are reset together")
        if isinstance(seed, int | np.integer):
            seed = int(seed)
        super().reset(seed=seed if isinstance(seed, int) else None)
        seeds = self._seeds(seed)
        scenario = self._one.cell.scenario
        self._scenarios = [msgspec.structs.replace(scenario, seed=one) for one in seeds]
        runs = [make_run(one) for one in self._scenarios]
        whole = [run for run in runs if isinstance(run, BendingRun)]
        if len(grouped(runs, self.num_envs)) > 1 or alone(runs[0]):
            raise InputError(f"scenario {scenario.name!r}: {alone(runs[0]) or 'no one structure'}")
        self._loop = BatchLoop(whole, self._threads)
        self._ended: Mask = np.zeros(self.num_envs, dtype=np.bool_)
        self._actions: list[Vector] = []
        self._started = time.perf_counter()
        self._seen = self._one.flat(self._loop.look())
        return self._seen.copy(), {"seed": np.array(seeds)}

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int]:
        if isinstance(seed, int):
            return [seed + i for i in range(self.num_envs)]
        drawn = self.np_random.integers(2**31, size=self.num_envs).tolist()
        given = [None] * self.num_envs if seed is None else list(seed)
        if len(given) != self.num_envs:
            raise InputError(f"seed: {len(given)} of them for {self.num_envs} worlds")
        return [d if one is None else int(one) for d, one in zip(drawn, given, strict=True)]

    def step(self, actions: Vector) -> tuple[Vector, Vector, Mask, Mask, Info]:
        """Run one command cycle in every world that has not ended."""
        loop, n = self._begun(), self.num_envs
        deviation = np.zeros((n, len(SIDES), 6))
        deviation[..., ::2] = self._one.inside(self._numbers(actions))
        loop.act(deviation)
        self._actions.append(deviation)
        done = loop.trace.rows >= int(loop.cycles.max())
        if not done and loop.active.any():
            seen = self._one.flat(loop.look())
            # What ends a world comes before its next observation.
            self._seen = np.where(loop.active[:, np.newaxis], seen, self._seen)
        moment_nm = np.stack([loop.trace.last(f"{side}_true_moment_y") for side in SIDES], axis=-1)
        ends = ~self._ended & (loop.left | done)
        records = {world: self._record(world) for world in np.flatnonzero(ends).tolist()}
        for world, record in records.items():
            moment_nm[world] = [record.trace[f"{side}_true_moment_y"][-1] for side in SIDES]
        rewards = np.where(self._ended, 0.0, self._one.reward(moment_nm))
        infos: Info = {"moment_nm": moment_nm}
        for world, record in records.items():
            if record.outcome != "completed":
                rewards[world] -= self._one.failure_cost
            infos = self._add_info(infos, end_of(record), world)
        self._ended |= ends
        seen = self._seen.copy()
        return seen, rewards, self._ended.copy(), np.zeros(n, dtype=np.bool_), infos

    def _begun(self) -> BatchLoop:
        if self._loop is None:
            raise InputError("the worlds have not begun: call reset first")
        return self._loop

    def _numbers(self, actions: Vector) -> Vector:
        given = np.asarray(actions, dtype=np.float64)
        wanted = (self.num_envs, *self._one.action_space.shape)
        if given.shape != wanted or not np.isfinite(given).all():
            raise InputError(f"actions: need {wanted} finite numbers, got {given.tolist()}")
        return given

    def _record(self, world: int) -> RunRecord:
        loop = self._begun()
        return self._played(world) if loop.left[world] else loop.record(world, self._wall_s())

    def _wall_s(self) -> float:
        return (time.perf_counter() - self._started) / self.num_envs

    def _played(self, world: int) -> RunRecord:
        """Return the record of a world that ended early: played again alone, to say why."""
        actions = [action[world] for action in self._actions]
        run = make_run(self._scenarios[world], compliance=lambda _: _Player(actions))
        return run.run()


class _Player:
    """A controller that answers what it was given, one cycle after the other."""

    def __init__(self, deviations: Sequence[Vector]) -> None:
        self._left = iter(deviations)
        self._last: Vector = np.zeros((len(SIDES), 6))

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation (2, 6) of the next cycle; the last one again after it."""
        del observation
        self._last = next(self._left, self._last)
        return self._last
