"""How fast the loop is, as ratios taken in one process: times depend on the machine."""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

import mujoco

from dualbend.recording.write import write_recording
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario


def benchmark(scenario: Scenario, repetitions: int) -> dict[str, str | float]:
    """Run a scenario several times, bare physics and recording in turn with it.

    Returns medians over the repetitions, and the best real-time factor. ``realtime_factor``:
    simulated time over wall time of the loop, recording off. ``over_mj_step``: wall time of the
    loop over that of the same number of bare ``mj_step`` calls on its model. ``recording_share``:
    time to write the recording over wall time of the loop.
    """
    factors, ratios, shares = [], [], []
    for _ in range(repetitions):
        run = make_run(scenario)
        result = run.run()
        factors.append(result.simulated_s / result.wall_time_s)
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
        "recording_share": statistics.median(shares),
    }


def _bare_time(run: Run, cycles: int) -> float:
    """Return the time that the run's physics steps take alone [s], in its last state."""
    simulation = run.cell.simulation
    started = time.perf_counter()
    mujoco.mj_step(simulation.model, simulation.data, nstep=cycles * simulation.steps)
    return time.perf_counter() - started
