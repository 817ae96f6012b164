"""The run that a scenario asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dualbend.control.controller import Controller
from dualbend.errors import InputError
from dualbend.run.arms import shown_placements
from dualbend.run.known_sheet import make_compliance
from dualbend.run.loop import Run
from dualbend.run.record import task_of
from dualbend.scenario.scenario import Scenario


def make_run(
    scenario: Scenario,
    *,
    compliance: Callable[[Scenario], Controller] = make_compliance,
    **parts: Any,  # noqa: ANN401 - each task has its own
) -> Run:
    """Return the scenario made ready to run by its task; ``parts`` replace parts of the run.

    ``compliance`` makes what takes the place of the scenario's ``[compliance]``, again for each
    run: it may have a memory. The record and its summary name it.

    Raises InputError where the task refuses it, its controller cannot be made, or two bodies touch
    at its start.
    """
    run: Run = task_of(scenario).part("run")(scenario, **parts)
    run.compliance = compliance
    if compliance is make_compliance:
        run.controller()
    run.start()
    for contact in run.cell.simulation.contacts:
        raise InputError(
            f"scenario {scenario.name!r}: at the start {contact}; look at "
            f"cell.sheet_height_m = {scenario.cell.sheet_height_m:g}, "
            f"{shown_placements(run.scenario)}"
        )
    return run
