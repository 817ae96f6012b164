"""A task of your own: hold the bent sheet still and weigh it with both arms.

The two grips together carry the weight of the sheet, whatever it pushes them apart with:

    W = −(F_z,left + F_z,right), averaged over the phase in which it is weighed.

Run: python docs/examples/own_task.py
"""

import sys
from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np

from dualbend import (
    COMMAND_PERIOD_S,
    TASKS,
    Metric,
    NominalMotion,
    PlanarRun,
    RunRecord,
    Scenario,
    Task,
    TaskConfig,
    load_scenario,
    make_run,
)

PHASES = ("settle", "weigh")


class WeighConfig(TaskConfig, tag="weigh"):
    """Hold the sheet at one bending angle and weigh it."""

    hold_rad: Annotated[float, msgspec.Meta(gt=0, lt=1, description="bending angle")] = 0.3
    weigh_s: Annotated[float, msgspec.Meta(gt=0.1, le=60, description="time of weighing")] = 1.0


class WeighRun(PlanarRun):
    """Both grips stand still on the scenario's path, first to settle and then to weigh."""

    def __init__(self, scenario: Scenario) -> None:
        task, seconds = scenario.task, (scenario.motion.settle_s, scenario.task.weigh_s)
        phase = np.repeat([0, 1], [round(s / COMMAND_PERIOD_S) for s in seconds])
        alpha = np.full(len(phase), task.hold_rad)
        half_distance, rise = scenario.path.make(scenario.sheet.length_m).at(alpha)
        motion = NominalMotion(
            phase=phase, alpha_rad=alpha, half_distance_m=half_distance, rise_m=rise
        )
        super().__init__(scenario, motion)


def metrics(record: RunRecord) -> dict[str, Metric]:
    """Return the weight and how far it is from that of the scenario's sheet [N]."""
    weighed = record["phase"] == PHASES.index("weigh")
    force = record["left_true_force_z"] + record["right_true_force_z"]
    weight = -float(force[weighed].mean())
    expected = 9.80665 * record.scenario.sheet.sheet().mass_kg
    return {"weight": Metric(weight, "N"), "weight_error": Metric(weight - expected, "N")}


WEIGH = TASKS.register(
    Task(kind="weigh", config=WeighConfig, phases=PHASES, run=WeighRun, metrics=metrics)
)


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Weigh the sheet of `exact` as it is believed; print and return weight and error [N]."""
    scenario = load_scenario("exact", ["imperfections=none", "task.kind=weigh", *settings])
    result = make_run(scenario).run()
    found = {name: metric.value for name, metric in result.metrics.items()}
    print(f"{result.outcome}: {found['weight']:.4f} N, {found['weight_error']:+.1e} N off")
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
