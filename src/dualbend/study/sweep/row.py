"""One run of a sweep: its scenario, and what became of it, whatever that is."""

from __future__ import annotations

import msgspec

from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.record import Metric
from dualbend.scenario.scenario import Scenario
from dualbend.study.ending import metrics_of, outcome_of, result_of
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep


class RunRow(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a run: no metrics where it was refused or broke; none of the machine."""

    index: int
    outcome: str
    reason: str = ""
    metrics: dict[str, Metric] = {}

    @classmethod
    def without_result(cls, index: int, error: Exception) -> RunRow:
        """Return the row of a run that an exception ended."""
        outcome, reason = outcome_of(error)
        return cls(index=index, outcome=outcome, reason=reason)


def task(sweep: Sweep, design: Design, index: int) -> tuple[int, Scenario] | RunRow:
    """Return a run's number and scenario, or the row of one that is refused."""
    try:
        return index, sweep.resolve(design.settings(index), design.seed(index))
    except InputError as error:
        return RunRow.without_result(index, error)


def run_row(index: int, scenario: Scenario) -> RunRow:
    """Run a scenario here; one that is refused or raises is a row as well.

    Raises
    ------
    KeyboardInterrupt
        The user ended it; half a run is no result.
    """
    try:
        result = result_of(make_run(scenario))
        metrics = metrics_of(result)
    except Exception as error:  # one bad run must not end the sweep
        return RunRow.without_result(index, error)
    return RunRow(index=index, outcome=result.outcome, reason=result.reason, metrics=metrics)
