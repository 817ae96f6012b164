"""Runs made of rows that are written down: the numbers of a run on signals with known answers."""

from typing import Any

import mujoco
import numpy as np

from dualbend.run.record import RunRecord, Scene
from dualbend.run.trace import Trace, TraceRecorder
from dualbend.scenario.scenario import Scenario
from dualbend.types import Vector


def _no_model() -> mujoco.MjModel:
    raise AssertionError


def written_run(
    scenario: Scenario,
    columns: dict[str, Any],
    task_columns: tuple[tuple[str, str], ...] = (),
    bend_stiffness: float | None = None,
    **parts: Any,
) -> RunRecord:
    """Return a run of these columns, each a number or one for each row; the others are 0."""
    sensing = [i for i, side in enumerate(("left", "right")) if side in scenario.compliance.sensing]
    hinges = scenario.sheet.model.sections
    named = TraceRecorder(
        0, sensing, 0, hinges, {"left_joint1": False, "right_joint1": False}, task_columns
    )
    rows = max(np.size(value) for value in columns.values())
    names = [name for name, _ in named.columns]
    values: Vector = np.zeros((rows, len(names)))
    for name, value in columns.items():
        values[:, names.index(name)] = value
    scene = None
    if bend_stiffness is not None:
        stiffness = np.full(hinges, bend_stiffness)
        scene = Scene(compiled=_no_model, bend_stiffness=stiffness)
    ended = {"outcome": "completed", "simulated_s": 0.028 * rows, "wall_time_s": 2.0, **parts}
    return RunRecord(scenario=scenario, trace=Trace(named.columns, values), scene=scene, **ended)
