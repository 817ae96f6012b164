"""How fast the loop is, as ratios taken in one process: times depend on the machine."""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

import msgspec
import mujoco

from dualbend.imperfection.config import ImperfectionsConfig
from dualbend.recording.write import write_recording
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario


def benchmark(scenario: Scenario, repetitions: int) -> dict[str, str | float]:
    """Run a scenario several times, bare physics, recording and the perfect cell in turn with it.

    Returns medians over the repetitions, and the best real-time factor. ``realtime_factor``:
    simulated time over wall time of the loop, recording off. ``over_mj_step``: wall time of the
    loop over that of the same number of bare ``mj_step`` calls on its model.
    ``over_perfect_cell``: processor time of the loop, per simulated second, over that without
    imperfections and, in a task in which nothing is to touch, without collision detection.
    ``recording_share``: time to write the recording over wall time of the loop.
    """
    factors, ratios, perfect, shares = [], [], [], []
    for _ in range(repetitions):
        run = make_run(scenario)
        started = time.process_time()
        result = run.run()
        used = (time.process_time() - started) / result.simulated_s
        factors.append(result.simulated_s / result.wall_time_s)
        perfect.append(used / _perfect_cell(scenario))
        ratios.append(result.wall_time_s / _bare_time(run, result.trace.rows))
        with tempfile.TemporaryDirectory() as folder:
            started = time.perf_counter()
            write_recording(result, Path(folder) / "run.rrd")
            shares.append((time.perf_counter() - started) / result.wall_time_s)
    return {
        "scenario": scenario.name,
        "repetitions": repetitions,
        "realtime_factor": statistics.median(factors),
        "realtime_factor_best": max(factors),
        "over_mj_step": statistics.median(ratios),
        "over_perfect_cell": statistics.median(perfect),
        "recording_share": statistics.median(shares),
    }


def _perfect_cell(scenario: Scenario) -> float:
    """Return the processor time of a simulated second in the cell in which nothing is wrong [s]."""
    run = make_run(msgspec.structs.replace(scenario, imperfections=ImperfectionsConfig()))
    if scenario.task.workplace is None:
        options = run.cell.simulation.model.opt
        options.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    started = time.process_time()
    simulated_s = run.run().simulated_s
    return (time.process_time() - started) / simulated_s


def _bare_time(run: Run, cycles: int) -> float:
    """Return the time that the run's physics steps take alone [s], in its last state."""
    simulation = run.cell.simulation
    started = time.perf_counter()
    mujoco.mj_step(simulation.model, simulation.data, nstep=cycles * simulation.steps)
    return time.perf_counter() - started
