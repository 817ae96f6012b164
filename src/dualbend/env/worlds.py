"""Bending in many worlds as one vectorised environment: batches, each world as it is alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from dualbend.batch.group import grouped
from dualbend.env.base import SENSING, Info
from dualbend.env.bend import BendEnv
from dualbend.env.together import Step, Together
from dualbend.errors import InputError, refuse_below_one
from dualbend.resources import usable_cores
from dualbend.run.make import make_run
from dualbend.scenario.load import Settings
from dualbend.task.bending.run import BendingRun
from dualbend.types import Mask, Vector


class BendWorlds(VectorEnv[Vector, Vector, Any]):
    """``num_envs`` worlds of :class:`dualbend.env.bend.BendEnv`, stepped at once.

    What is seen, done, rewarded and told is, to the bit, what Gymnasium's ``SyncVectorEnv`` of as
    many of these has. A world whose run has ended begins anew in the next step
    (``AutoresetMode.NEXT_STEP``), with a seed that follows from its own first one. Worlds that
    begin in the same step go on as one batch, if their runs can be one; a world that begins alone
    is an environment of its own, until its next end.

    ``threads`` for the physics of a batch, by default as many as there are cores.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

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
        self._threads = usable_cores() if threads is None else threads
        refuse_below_one(num_envs=num_envs, threads=self._threads)
        self.num_envs = num_envs
        self._envs = [
            BendEnv(scenario, settings, moment_scale_nm=moment_scale_nm, failure_cost=failure_cost)
            for _ in range(num_envs)
        ]
        one = self._envs[0]
        self.single_action_space = one.action_space
        self.single_observation_space = one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        self._seen: Vector = np.zeros(self.observation_space.shape or ())
        self._begun, self._ended, self._alone = np.zeros((3, num_envs), dtype=np.bool_)
        self._batches: list[Together] = []

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Vector, Info]:
        """Begin a run in every world, or in those of ``options["reset_mask"]`` (num_envs,).

        From one ``seed`` on each world has the next one; without one each draws its own.
        """
        every = np.ones(self.num_envs, dtype=np.bool_)
        mask = (options or {}).get("reset_mask", every)
        if np.shape(mask) != every.shape or np.asarray(mask).dtype != np.bool_ or not np.any(mask):
            raise InputError(
                f"reset_mask: need {self.num_envs} truth values, one of them true, got {mask}"
            )
        infos: Info = {}
        self._begin(np.flatnonzero(mask), self._seeds(seed), infos)
        return self._seen.copy(), infos

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        given = [None] * self.num_envs if seed is None else list(seed)
        if len(given) != self.num_envs:
            raise InputError(f"seed: {len(given)} of them for {self.num_envs} worlds")
        return [None if one is None else int(one) for one in given]

    def _begin(self, worlds: NDArray[np.int_], seeds: Sequence[int | None], infos: Info) -> None:
        """Begin a run in some worlds, as one batch where that is possible."""
        begin = np.isin(np.arange(self.num_envs), worlds)
        drawn = {int(i): self._envs[i].next_seed(seeds[i]) for i in worlds}
        for batch in self._batches:
            batch.leave(begin)
        self._batches = [batch for batch in self._batches if batch.going.any()]
        self._alone |= begin
        if len(drawn) > 1:
            self._begin_together(drawn)
        for i, one in drawn.items():
            if self._alone[i]:
                self._seen[i] = self._envs[i].begin(one)
            self._add_info(infos, {"seed": one}, i)
        self._begun |= begin
        self._ended &= ~begin

    def _begin_together(self, seeds: dict[int, int]) -> None:
        """Begin those runs of worlds that can be batches."""
        worlds, scenario = np.array(list(seeds)), self._envs[0].cell.scenario
        runs = [make_run(msgspec.structs.replace(scenario, seed=one)) for one in seeds.values()]
        for group in grouped(runs, len(runs)):
            of_group = [run for run in (runs[i] for i in group) if isinstance(run, BendingRun)]
            if len(of_group) > 1:
                batch = Together(self._envs[0], worlds[group], of_group, self._threads)
                self._batches.append(batch)
                self._seen[batch.worlds] = batch.seen
                # What ends before its first cycle says why itself.
                self._alone[batch.worlds] = ~batch.going

    def step(self, actions: Vector) -> tuple[Vector, Vector, Mask, Mask, Info]:
        """Run one command cycle in every world; one that ended in the last step begins anew."""
        given, begins = self._numbers(actions), np.flatnonzero(self._ended)
        infos: Info = {}
        rewards = np.zeros(self.num_envs)
        for i, (seen, reward, ended, info) in self._stepped(given):
            self._seen[i], rewards[i], self._ended[i] = seen, reward, ended
            self._add_info(infos, info, i)
        self._begin(begins, [None] * self.num_envs, infos)
        never: Mask = np.zeros(self.num_envs, dtype=np.bool_)
        return self._seen.copy(), rewards, self._ended.copy(), never, infos

    def _stepped(self, actions: Vector) -> Iterator[tuple[int, Step]]:
        """Run one command cycle in every world that has not ended."""
        alone = np.flatnonzero(self._alone & ~self._ended)
        for batch in self._batches:
            if batch.going.any():
                yield from batch.step(actions)
        for i in alone.tolist():
            seen, reward, ended, _, info = self._envs[i].step(actions[i])
            yield i, (seen, reward, ended, info)

    def _numbers(self, actions: Vector) -> Vector:
        if not self._begun.all():
            raise InputError("the worlds have not begun: call reset first")
        given = np.array(actions, dtype=np.float64)
        wanted = self.action_space.shape
        if given.shape == wanted:
            given[self._ended] = 0.0  # nobody acts in the step in which a world begins
        if given.shape != wanted or not np.isfinite(given).all():
            raise InputError(f"actions: need {wanted} finite numbers, got {given.tolist()}")
        return given
