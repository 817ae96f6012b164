"""The run that a scenario asks for."""

from __future__ import annotations

from typing import Any

from dualbend.run.loop import Run
from dualbend.run.record import task_of
from dualbend.scenario.scenario import Scenario


def make_run(scenario: Scenario, **parts: Any) -> Run:  # noqa: ANN401 - each task has its own
    """Return the scenario made ready to run by its task; ``parts`` replace parts of the run."""
    run: Run = task_of(scenario).part("run")(scenario, **parts)
    return run
