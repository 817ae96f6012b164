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
        self.num_envs, self._threads = num_envs, threads or os.cpu_count() or 1
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
        if mask is not None and not np.all(mask):
            raise InputError("reset_mask: the worlds of a batch are reset together")
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
        return self._one.flat(self._loop.look()), {"seed": np.array(seeds)}

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int]:
        if isinstance(seed, int):
            return [seed + i for i in range(self.num_envs)]
        drawn = self.np_random.integers(2**31, size=self.num_envs).tolist()
        given = [None] * self.num_envs if seed is None else list(seed)
        return [d if one is None else one for d, one in zip(drawn, given, strict=True)]

    def step(self, actions: Vector) -> tuple[Vector, Vector, Mask, Mask, Info]:
        """Run one command cycle in every world that has not ended."""
        loop, n = self._loop, self.num_envs
        deviation = np.zeros((n, len(SIDES), 6))
        deviation[..., ::2] = self._one.inside(actions)
        self._actions.append(deviation)
        loop.act(deviation)
        done = loop.trace.rows >= int(loop.cycles.max())
        if not done and loop.active.any():
            self._seen = self._one.flat(loop.look())
        moment_nm = np.stack([loop.trace.last(f"{side}_true_moment_y") for side in SIDES], axis=-1)
        ends = ~self._ended & (loop.left | done)
        rewards = np.where(self._ended, 0.0, self._one.reward(moment_nm))
        infos: Info = {"moment_nm": moment_nm}
        for world in np.flatnonzero(ends).tolist():
            record = self._played(world) if loop.left[world] else loop.record(world, self._wall_s())
            if record.outcome != "completed":
                rewards[world] -= self._one.failure_cost
            infos = self._add_info(infos, end_of(record), world)
        self._ended |= ends
        seen: Vector = self._seen.copy()
        return seen, rewards, self._ended.copy(), np.zeros(n, dtype=np.bool_), infos

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
