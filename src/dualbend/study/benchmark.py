"""How fast the loop is, as ratios taken in one process: times depend on the machine."""

from __future__ import annotations

import platform
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.evaluation.metrics import versions
from dualbend.imperfection.config import ImperfectionsConfig
from dualbend.recording.write import write_recording
from dualbend.resources import usable_cores
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.types import Vector


def benchmark(scenario: Scenario, repetitions: int) -> dict[str, str | float]:
    """Run a scenario several times, in turn with bare physics, recording and the perfect cell.

    ``realtime_factor``: simulated time over wall time of the loop, recording off, the median of the
    repetitions; ``realtime_factor_best``: the largest. What follows goes by processor time, for
    each cycle the least of the repetitions, since what else a machine does only adds to it.
    ``cycle_us``: a command cycle of the loop [µs], the mean. ``over_mj_step``: that over the
    cycle's physics steps alone, bare ``mj_step`` calls over the same trajectory;
    ``over_mj_step_at_rest``: over as many calls in the last state, where less moves. ``replayed``:
    part of the cycles after which the bare steps are where the run was, within 1 nm and 1 nrad.
    ``over_perfect_cell``: the loop over that without imperfections and, in a task in which nothing
    is to touch, without collision detection. ``recording_share``: time to write the recording over
    wall time of the loop.

    Raises
    ------
    InputError
        The run ends in its first two cycles.
    """
    replay = _Replay(make_run(scenario))
    factors, shares, times = [], [], []
    for _ in range(repetitions):
        run = make_run(scenario)
        result, loop_s = _timed(run)
        with tempfile.TemporaryDirectory() as folder:
            started = time.perf_counter()
            write_recording(result, Path(folder) / "run.rrd")
            shares.append((time.perf_counter() - started) / result.wall_time_s)
        factors.append(result.simulated_s / result.wall_time_s)
        perfect_s = _timed(_perfect_cell(scenario))[1]
        times.append((loop_s, *replay.times_s(), _at_rest_s(run, len(loop_s)), perfect_s))
    loop, bare, writing, at_rest, perfect = (
        float(np.min(of_cycles, axis=0).mean()) for of_cycles in zip(*times, strict=True)
    )
    return {
        "scenario": scenario.name,
        "repetitions": repetitions,
        "realtime_factor": statistics.median(factors),
        "realtime_factor_best": max(factors),
        "cycle_us": 1e6 * loop,
        "over_mj_step": loop / (bare - writing),
        "over_mj_step_at_rest": loop / at_rest,
        "replayed": replay.share,
        "over_perfect_cell": loop / perfect,
        "recording_share": min(shares),
        **machine(),
    }


def machine() -> dict[str, str]:
    """Return what a time depends on: processor, cores that the process may use, versions."""
    model = platform.processor() or platform.machine()
    with_names = Path("/proc/cpuinfo")
    if with_names.exists():
        rows = (line.partition(":") for line in with_names.read_text().splitlines())
        model = next((said.strip() for key, _, said in rows if key.strip() == "model name"), model)
    cores = usable_cores()
    named = ", ".join(f"{name} {version}" for name, version in versions().items())
    return {"processor": model, "cores": str(cores), "versions": named}


def _timed(run: Run) -> tuple[RunRecord, Vector]:
    """Run to the end; return also the processor time of each cycle after the first [s]."""
    stamps: list[float] = []
    result = run.run(lambda _: stamps.append(time.process_time()))
    if len(stamps) < 2:
        raise InputError(
            f"scenario {run.scenario.name!r}: {result.outcome} after {len(stamps)} cycles "
            f"({result.reason}): too short to be measured"
        )
    return result, np.diff(stamps)


def _perfect_cell(scenario: Scenario) -> Run:
    """Return the run in the cell in which nothing is wrong."""
    run = make_run(msgspec.structs.replace(scenario, imperfections=ImperfectionsConfig()))
    if scenario.task.workplace is None:
        options = run.cell.simulation.model.opt
        options.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return run


def _at_rest_s(run: Run, cycles: int) -> Vector:
    """Return the processor times of cycles of physics steps in the run's last state [s]."""
    simulation, stamps = run.cell.simulation, [time.process_time()]
    for _ in range(cycles):
        mujoco.mj_step(simulation.model, simulation.data, nstep=simulation.steps)
        stamps.append(time.process_time())
    return np.diff(stamps)


_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_SAME = 1e-9
"""How near positions [m, rad] of a replayed cycle are to be to the run's."""
_EDITED = ("dof_frictionloss", "jnt_actfrcrange", "site_pos", "site_quat", "geom_conaffinity")
"""What friction, misalignment and grippers change in the model during a run."""


class _Replay:
    """The physics steps of a run, done again by bare ``mj_step`` calls.

    Each cycle starts where the run's did; controls, length and model of each step are the run's.
    ``share``: of the cycles that end where the run's did; a task that puts its sheet elsewhere
    between two steps has others.
    """

    def __init__(self, run: Run) -> None:
        simulation = run.cell.simulation
        self._model, self._data = simulation.model, simulation.data
        self._edited = [getattr(self._model, name) for name in _EDITED]
        self._now = [values.copy() for values in self._edited]
        self._steps: list[list[tuple[Vector, float, list[NDArray[Any]]]]] = [[]]
        self._states: list[Vector] = []
        simulation.on_step.append(self._note_step)
        parts = simulation.parts

        def looked() -> int:
            self._look()
            return parts()

        simulation.parts = looked
        run.run(self._note_cycle)
        self.share = 1.0

    def _note_step(self) -> None:
        self._steps[-1].append((self._data.ctrl.copy(), self._model.opt.timestep, self._now))
        self._look()

    def _look(self) -> None:
        if not all(map(np.array_equal, self._edited, self._now)):
            self._now = [values.copy() for values in self._edited]

    def _note_cycle(self, _: int) -> None:
        state = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._model, self._data, state, _STATE)
        self._states.append(state)
        self._steps.append([])

    def times_s(self) -> tuple[Vector, Vector]:
        """Return the processor time of each cycle after the first [s], with its steps and without.

        Writing states and controls, which is left without them, is no part of the physics.
        """
        used_s, same = self._pass(mujoco.mj_step)
        self.share = same / max(len(used_s), 1)
        return used_s, self._pass(lambda _, __: None)[0]

    def _pass(self, step: Callable[[mujoco.MjModel, mujoco.MjData], None]) -> tuple[Vector, int]:
        """Return processor times [s] and how many cycles end where the run's did."""
        model, data, timestep_s = self._model, self._data, self._model.opt.timestep
        ctrl, place = data.ctrl, slice(1, 1 + model.nq)
        same, stamps = 0, [time.process_time()]
        for steps, state, end in zip(self._steps[1:], self._states, self._states[1:], strict=False):
            mujoco.mj_setState(model, data, state, _STATE)
            for setpoints, part_s, edits in steps:
                ctrl[:], model.opt.timestep = setpoints, part_s
                for values, edit in zip(self._edited, edits, strict=True):
                    values[:] = edit
                step(model, data)
            same += bool((np.abs(data.qpos - end[place]) < _SAME).all())
            stamps.append(time.process_time())
        model.opt.timestep = timestep_s
        return np.diff(stamps), same
