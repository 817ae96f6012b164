"""Two position-controlled arms bend a flexible sheet, on validated beam physics.

What a script needs is here; it is imported when it is asked for.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dualbend.control.controller import Observation
    from dualbend.errors import InputError
    from dualbend.evaluation.metrics import summary
    from dualbend.report.results import write_results
    from dualbend.run.make import make_run
    from dualbend.run.saved import load_run
    from dualbend.scenario.load import load_scenario
    from dualbend.task.bending.run import BendingRun

__all__ = [
    "BendingRun",
    "InputError",
    "Observation",
    "load_run",
    "load_scenario",
    "make_run",
    "summary",
    "write_results",
]

_HOMES = {
    "BendingRun": "task.bending.run",
    "InputError": "errors",
    "Observation": "control.controller",
    "load_run": "run.saved",
    "load_scenario": "scenario.load",
    "make_run": "run.make",
    "summary": "evaluation.metrics",
    "write_results": "report.results",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    """Import a public name from its home: the command line's help must not wait for MuJoCo."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
