"""Two position-controlled arms bend a flexible sheet, on validated beam physics.

All that a script needs is here, each name imported when it is asked for; ``docs/api.md`` says what
each one is.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dualbend.batch.many import run_many
    from dualbend.beam import elastica
    from dualbend.beam.path import (
        ApproximatePath,
        BendingPath,
        ExactPath,
        PiecewiseLinearPath,
        TablePath,
    )
    from dualbend.beam.rod.path_moment import worst_moment
    from dualbend.beam.rod.planar import solve_planar, solve_symmetric
    from dualbend.beam.sheet import Sheet
    from dualbend.control.clock import COMMAND_PERIOD_S
    from dualbend.control.compliance.object import critical_rate
    from dualbend.control.controller import Observation
    from dualbend.env.arms import parallel_env
    from dualbend.errors import InputError
    from dualbend.planning.plan import plan_assembly
    from dualbend.registry import TASKS, Task
    from dualbend.report.results import write_results
    from dualbend.run.arms import arm_pair
    from dualbend.run.disk.saved import load_run
    from dualbend.run.make import make_run
    from dualbend.run.planar import PlanarRun
    from dualbend.run.record import Metric, RunRecord
    from dualbend.run.stepped import Cell, open_cell
    from dualbend.scenario.load import list_scenarios, load_scenario
    from dualbend.scenario.motion import NominalMotion
    from dualbend.scenario.scenario import Scenario
    from dualbend.scenario.task import TaskConfig
    from dualbend.stability.prediction import predict
    from dualbend.stability.sampled import LoopElements

__all__ = [
    "COMMAND_PERIOD_S",
    "TASKS",
    "ApproximatePath",
    "BendingPath",
    "Cell",
    "ExactPath",
    "InputError",
    "LoopElements",
    "Metric",
    "NominalMotion",
    "Observation",
    "PiecewiseLinearPath",
    "PlanarRun",
    "RunRecord",
    "Scenario",
    "Sheet",
    "TablePath",
    "Task",
    "TaskConfig",
    "arm_pair",
    "critical_rate",
    "elastica",
    "list_scenarios",
    "load_run",
    "load_scenario",
    "make_run",
    "open_cell",
    "parallel_env",
    "plan_assembly",
    "predict",
    "run_many",
    "solve_planar",
    "solve_symmetric",
    "worst_moment",
    "write_results",
]

_HOMES = {
    "COMMAND_PERIOD_S": "control.clock",
    "TASKS": "registry",
    "ApproximatePath": "beam.path",
    "BendingPath": "beam.path",
    "Cell": "run.stepped",
    "ExactPath": "beam.path",
    "InputError": "errors",
    "LoopElements": "stability.sampled",
    "Metric": "run.record",
    "NominalMotion": "scenario.motion",
    "Observation": "control.controller",
    "PiecewiseLinearPath": "beam.path",
    "PlanarRun": "run.planar",
    "RunRecord": "run.record",
    "Scenario": "scenario.scenario",
    "Sheet": "beam.sheet",
    "TablePath": "beam.path",
    "Task": "registry",
    "TaskConfig": "scenario.task",
    "arm_pair": "run.arms",
    "critical_rate": "control.compliance.object",
    "elastica": "beam.elastica",
    "list_scenarios": "scenario.load",
    "load_run": "run.disk.saved",
    "load_scenario": "scenario.load",
    "make_run": "run.make",
    "open_cell": "run.stepped",
    "parallel_env": "env.arms",
    "plan_assembly": "planning.plan",
    "predict": "stability.prediction",
    "run_many": "batch.many",
    "solve_planar": "beam.rod.planar",
    "solve_symmetric": "beam.rod.planar",
    "worst_moment": "beam.rod.path_moment",
    "write_results": "report.results",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    """Import a public name from its home: the command line's help must not wait for MuJoCo."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = importlib.import_module(f"{__name__}.{_HOMES[name]}")
    return home if _HOMES[name].endswith(f".{name}") else getattr(home, name)
