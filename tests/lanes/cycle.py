"""Where the time of a command cycle goes: ``python tests/lanes/cycle.py fig8``.

A clock around each part, less what other parts take within it: the lower quartile over the cycles
of three runs. Each of the 22 calls that are timed costs some 0.5 µs more for it, which the part
around it bears. Further arguments are settings: ``imperfections=none``.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from dualbend import load_scenario, make_run
from dualbend.control.controller import ControlledPath
from dualbend.control.controller import Observation as Observed
from dualbend.control.guard import Guard, SensorGuard
from dualbend.control.wrist import WristSensors
from dualbend.imperfection.link import CommandLink
from dualbend.run.cell import RobotCell
from dualbend.run.loop import Run
from dualbend.run.planar import PlanarRun
from dualbend.run.trace import TraceRecorder
from dualbend.scene.believed import BelievedArms, Measured
from dualbend.scene.observation import Observer
from dualbend.scene.simulation import Simulation

PARTS: dict[str, list[tuple[Any, str]]] = {
    "physics, and what follows each of its steps": [(mujoco, "mj_step1"), (Simulation, "advance")],
    "grips, edges, loads and samples": [
        *((Observer, name) for name in ("pad_loads", "observation", "sample", "roll_and_yaw")),
        (Simulation, "observe"),
    ],
    "wrist sensors, compensation, filter": [(WristSensors, "read")],
    "arms as the controller believes them": [
        *((Measured, name) for name in ("sensor_axes", "grips", "aside")),
        (BelievedArms, "coriolis"),
    ],
    "observation, compliance, delay": [(Observed, "of"), (ControlledPath, "command")],
    "set-points": [(PlanarRun, "_setpoint"), (Run, "solve")],
    "link, response, servos": [(CommandLink, "deliver"), (RobotCell, "send")],
    "guards": [(Guard, "check"), (SensorGuard, "check")],
    "trace": [
        (TraceRecorder, name)
        for name in ("observe", "record_reading", "record_task", "record_control")
    ],
}
REST = "the rest of the loop"


def main(scenario: str, settings: list[str]) -> None:
    """Time the runs of a scenario and print a table."""
    spent: Counter[str] = Counter()
    within = [0]

    def timed(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def around(*given: Any, **named: Any) -> Any:
            within.append(0)
            started = time.perf_counter_ns()
            try:
                return call(*given, **named)
            finally:
                passed = time.perf_counter_ns() - started
                spent[part] += passed - within.pop()
                within[-1] += passed

        return around

    for part, calls in PARTS.items():
        for owner, name in calls:
            own = vars(owner)[name]
            bound = classmethod if isinstance(own, classmethod) else lambda call: call
            setattr(owner, name, bound(timed(getattr(own, "__func__", own), part)))
    rows: list[list[int]] = []
    for _ in range(3):
        since = [time.perf_counter_ns()]

        def note(_: int, since: list[int] = since) -> None:
            now = time.perf_counter_ns()
            spent[REST] = now - since[0] - sum(spent.values())
            rows.append([spent[part] for part in (*PARTS, REST)])
            spent.clear()
            since[0] = time.perf_counter_ns()

        make_run(load_scenario(scenario, settings)).run(note)
        spent.clear()
    quartile = np.quantile(rows, 0.25, axis=0) / 1e3
    for part, used_us in zip((*PARTS, REST), quartile, strict=True):
        print(f"{part:<45}{used_us:8.1f}")
    print(f"{'sum [µs]':<45}{quartile.sum():8.1f}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "fig8", sys.argv[2:])
