"""How fast closed loops of many worlds are, beside one alone: wall times of one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import msgspec

from dualbend.batch.group import alone, grouped
from dualbend.batch.loop import BatchLoop
from dualbend.batch.physics import CpuPhysics
from dualbend.errors import InputError
from dualbend.resources import usable_cores
from dualbend.run.cell import RobotCell
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario
from dualbend.scene.observation import Observation, SensorSample
from dualbend.task.bending.run import BendingRun
from dualbend.types import Mask, Vector

T = TypeVar("T")


def benchmark_batch(
    scenario: Scenario, worlds: int, threads: int | None = None
) -> dict[str, str | float]:
    """Run a scenario in many worlds, of as many seeds, as one batch, and once alone.

    ``ready_s``: wall time to make a world ready, before its first cycle. Of a command cycle, wall
    time over worlds: ``cycle_us`` in all, ``physics_us`` of MuJoCo and what is read of it on so
    many ``threads``, ``control_us`` of the rest; ``alone_us``: of the run alone.
    ``faster``: the run alone over a world of the batch, both made ready. ``left``: worlds that
    ended early.

    Raises InputError where the scenario's runs can be no batch.
    """
    count = threads or usable_cores()
    started = time.perf_counter()
    made = [
        make_run(msgspec.structs.replace(scenario, seed=scenario.seed + i)) for i in range(worlds)
    ]
    runs = [run for run in made if isinstance(run, BendingRun)]
    if alone(made[0]) or len(grouped(made, worlds)) > 1:
        why = alone(made[0]) or "its worlds differ in structure"
        raise InputError(f"scenario {scenario.name!r}: is run one by one: {why}")
    ready_s = (time.perf_counter() - started) / worlds
    physics: list[_Timed] = []

    def timed(cells: Sequence[RobotCell]) -> _Timed:
        physics.append(_Timed(cells, count))
        return physics[-1]

    loop = BatchLoop(runs, count, timed)
    started = time.perf_counter()
    for _ in loop.run():
        pass
    wall_s = time.perf_counter() - started
    started = time.perf_counter()
    single = make_run(scenario)
    single_ready_s = time.perf_counter() - started
    result = single.run()
    per = 1e6 / (worlds * loop.trace.rows)
    single_s = single_ready_s + result.wall_time_s
    return {
        "scenario": scenario.name,
        "worlds": worlds,
        "threads": count,
        "left": int(loop.left.sum()),
        "ready_s": ready_s,
        "cycle_us": per * wall_s,
        "physics_us": per * physics[0].used_s,
        "control_us": per * (wall_s - physics[0].used_s),
        "alone_us": 1e6 * result.wall_time_s / result.trace.rows,
        "faster": single_s / (ready_s + wall_s / worlds),
    }


class _Timed(CpuPhysics):
    """Physics that keeps the wall time that it takes [s]."""

    used_s = 0.0

    def observe(self, active: Mask) -> Observation:
        return self._timed(lambda: super(_Timed, self).observe(active))

    def advance(self, setpoints: Vector, active: Mask) -> SensorSample:
        return self._timed(lambda: super(_Timed, self).advance(setpoints, active))

    def _timed(self, call: Callable[[], T]) -> T:
        started = time.perf_counter()
        try:
            return call()
        finally:
            self.used_s += time.perf_counter() - started
