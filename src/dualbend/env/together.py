"""Worlds that began in the same cycle as one batch, each as its environment is alone."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from dualbend.batch.loop import BatchLoop
from dualbend.control.controller import Observation
from dualbend.env.base import Info, end_of
from dualbend.env.bend import BendEnv
from dualbend.run.record import RunRecord, whole
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Mask, Vector

Step = tuple[Vector, float, bool, Info]
"""What a world is told of a step: observation, reward, whether it is terminated, info."""


class Together:
    """Runs of one structure that begin together, stepped as one batch.

    ``worlds``: the number of each among all worlds; ``env`` knows how they are observed and
    rewarded. ``going`` (m,): those that have not ended.
    """

    def __init__(
        self, env: BendEnv, worlds: NDArray[np.int_], runs: Sequence[BendingRun], threads: int
    ) -> None:
        self._env, self.worlds, self._runs = env, worlds, runs
        self._loop = BatchLoop(runs, min(threads, len(runs)))
        self._actions: list[Vector] = []
        self._started = time.perf_counter()
        self.seen = env.flat(self._loop.look())
        self.going: Mask = self._loop.active.copy()

    def leave(self, left: Mask) -> None:
        """Go on without those that are among the ``left`` ones of all worlds."""
        self.going &= ~left[self.worlds]
        self._loop.active &= self.going  # in place: the loop's parts hold it

    def step(self, actions: Vector) -> Iterator[tuple[int, Step]]:
        """Run one command cycle with the actions of all worlds; yield what each is told."""
        loop, env, went = self._loop, self._env, self.going.copy()
        deviation = np.zeros((len(self.worlds), len(SIDES), 6))
        deviation[..., ::2] = env.inside(actions[self.worlds])
        loop.act(deviation)
        self._actions.append(deviation)
        done = loop.trace.rows >= int(loop.cycles.max())
        if not done and loop.active.any():
            seen = env.flat(loop.look())
            # What ends a world comes before its next observation.
            self.seen = np.where(loop.active[:, np.newaxis], seen, self.seen)
        self.going &= loop.active & (not done)
        moment_nm = np.stack([loop.trace.last(f"{side}_true_moment_y") for side in SIDES], axis=-1)
        for i in np.flatnonzero(went).tolist():
            yield int(self.worlds[i]), self._told(i, moment_nm[i])

    def _told(self, i: int, moment_nm: Vector) -> Step:
        env, seen = self._env, self.seen[i]
        if self.going[i]:
            return seen, float(env.reward(moment_nm)), False, {"moment_nm": moment_nm}
        record = self._played(i) if self._loop.left[i] else self._loop.record(i, self._wall_s())
        last: Vector = np.array([record.trace[f"{side}_true_moment_y"][-1] for side in SIDES])
        cost = env.failure_cost * (record.outcome != "completed")
        return seen, float(env.reward(last)) - cost, True, {"moment_nm": last} | end_of(record)

    def _wall_s(self) -> float:
        return (time.perf_counter() - self._started) / len(self.worlds)

    def _played(self, i: int) -> RunRecord:
        """Return the record of a world that ended early: played again alone, to say why."""
        actions, run = [action[i] for action in self._actions], self._runs[i]
        run.compliance = lambda _: _Player(actions)
        return whole(run.run())


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
