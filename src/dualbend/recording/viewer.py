"""A run in MuJoCo's own viewer, at the speed of the clock on the wall."""

from __future__ import annotations

import time

import mujoco
import mujoco.viewer

from dualbend.run.loop import Run
from dualbend.run.record import RunRecord

_CLOSING_S = 1.0


def run_in_viewer(run: Run) -> RunRecord:
    """Run with a window open; closing the window does not end the run, only its picture."""
    shown = mujoco.MjData(run.cell.model)
    with mujoco.viewer.launch_passive(run.cell.model, shown) as window:
        started = time.perf_counter()

        def show(cycle: int) -> None:
            if not window.is_running():
                return
            simulated = run.cell.simulation.data
            shown.qpos[:] = simulated.qpos
            shown.mocap_pos[:], shown.mocap_quat[:] = simulated.mocap_pos, simulated.mocap_quat
            mujoco.mj_forward(run.cell.model, shown)
            window.sync()
            ahead = cycle * run.scenario.period_s - (time.perf_counter() - started)
            if ahead > 0.0:
                time.sleep(ahead)

        result = run.run(on_cycle=show)
    # The viewer's thread frees its window after it was closed: a process that ends before crashes.
    time.sleep(_CLOSING_S)
    return result
