"""Two position-controlled arms bend a flexible sheet, on validated beam physics.

What a script needs is here; it is imported when it is asked for.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dualbend.analysis.metrics import summary
    from dualbend.analysis.results import write_results
    from dualbend.control.admittance import Deviation
    from dualbend.errors import InputError
    from dualbend.run.make import make_run
    from dualbend.run.runner import BendingRun
    from dualbend.run.saved import load_run
    from dualbend.run.scenario import load_scenario

__all__ = [
    "BendingRun",
    "Deviation",
    "InputError",
    "load_run",
    "load_scenario",
    "make_run",
    "summary",
    "write_results",
]

_HOMES = {
    "BendingRun": "run.runner",
    "Deviation": "control.admittance",
    "InputError": "errors",
    "load_run": "run.saved",
    "load_scenario": "run.scenario",
    "make_run": "run.make",
    "summary": "analysis.metrics",
    "write_results": "analysis.results",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    """Import a public name from its home: the command line's help must not wait for MuJoCo."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
