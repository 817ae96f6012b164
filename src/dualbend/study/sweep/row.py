"""One run of a sweep: its scenario, and what became of it, whatever that is."""

from __future__ import annotations

import msgspec

from dualbend.errors import DualbendError, InputError
from dualbend.evaluation.metrics import WALL_CLOCK, versions
from dualbend.run.make import make_run
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep

REFUSED, RAISED = "refused", "error"
"""Outcomes beside those of a run: it cannot be made ready, or is broken."""

_MAY_DIFFER = ("python", "rerun-sdk")


class RunRow(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a run: no metrics where it was refused or broke; none of the machine."""

    index: int
    outcome: str
    reason: str = ""
    metrics: dict[str, Metric] = {}


def resolved(sweep: Sweep, design: Design, index: int) -> Scenario | RunRow:
    """Return a run's scenario, or the row of one that is refused."""
    try:
        return sweep.resolve(design.settings(index), design.seed(index))
    except InputError as error:
        return RunRow(index=index, outcome=REFUSED, reason=str(error))


def run_row(index: int, scenario: Scenario) -> RunRow:
    """Run a scenario here; one that is refused or raises is a row as well.

    Raises
    ------
    KeyboardInterrupt
        The user ended it; half a run is no result.
    """
    try:
        result = make_run(scenario).run()
        metrics = _metrics(result)
    except DualbendError as error:
        return RunRow(index=index, outcome=REFUSED, reason=str(error))
    except Exception as error:  # one bad run must not end the sweep
        return RunRow(index=index, outcome=RAISED, reason=f"{type(error).__name__}: {error}")
    if result.reason.startswith("interrupted"):
        raise KeyboardInterrupt
    return RunRow(index=index, outcome=result.outcome, reason=result.reason, metrics=metrics)


def _metrics(result: RunRecord) -> dict[str, Metric]:
    return {name: metric for name, metric in result.metrics.items() if name not in WALL_CLOCK}


def result_versions() -> dict[str, str]:
    """Return the versions that must be the same wherever a sweep's runs are made."""
    return {name: v for name, v in versions().items() if name not in _MAY_DIFFER}
