"""Scenarios run side by side, each in a fresh process with one thread of linear algebra."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from dualbend.check.baseline import CRASHED, EndedAs
from dualbend.check.settings import Settings, settings_of
from dualbend.errors import InputError
from dualbend.evaluation.fingerprint import model_fingerprint
from dualbend.evaluation.metrics import versions
from dualbend.evaluation.peaks import Place, last_place, peak_places
from dualbend.report.results import write_results
from dualbend.run.make import make_run
from dualbend.run.record import Metric, RunRecord, task_of, whole
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.serve.cell import ServedCell
from dualbend.serve.client import FOLDER, run_by_client
from dualbend.study.ending import REFUSED, metrics_of, outcome_of, result_of
from dualbend.study.engine import Study
from dualbend.study.processes import in_processes

_NOT_OF_A_RESULT = ("rerun-sdk",)


class Measured(msgspec.Struct, frozen=True, kw_only=True):
    """What a scenario came to now; ``places`` has the time and phase of each metric's peak.

    A scenario that is refused before its run has no model and no metrics, and its reason.
    """

    name: str
    source: str
    task: str
    outcome: EndedAs
    reason: str = ""
    end: Place | None = None
    model_sha256: str = ""
    settings: Settings
    versions: dict[str, str]
    metrics: dict[str, Metric] = {}
    places: dict[str, list[Place | None]] = {}


def measure(source: str, out: Path | None = None) -> Measured:
    """Run a scenario here and return what a baseline compares.

    A scenario with ``serve.client`` is run by that; where nobody answers any more, it crashed.
    ``out``: where the run is kept, in a folder of the scenario's name.

    Raises InputError where the scenario cannot be read (one that can be and is refused is an
    outcome); KeyboardInterrupt where the user ended it: half a run is no measurement.
    """
    scenario = load_scenario(source)
    what: dict[str, Any] = {
        "name": scenario.name,
        "source": source,
        "task": task_of(scenario).kind,
        "settings": settings_of(scenario),
        "versions": {k: v for k, v in versions().items() if k not in _NOT_OF_A_RESULT},
    }
    try:
        result, failure = _carried_out(scenario, None if out is None else out / scenario.name)
        metrics = {} if failure else metrics_of(result)
        what |= {
            "outcome": CRASHED if failure else result.outcome,
            "reason": failure or result.reason,
            "end": last_place(result),
            "model_sha256": model_fingerprint(result.model),
            "metrics": metrics,
            "places": peak_places(result, metrics),
        }
    except Exception as error:  # one bad run must not end the check
        outcome, reason = outcome_of(error)
        what |= {"outcome": REFUSED if outcome == REFUSED else CRASHED, "reason": reason}
    return Measured(**what)


def _carried_out(scenario: Scenario, folder: Path | None) -> tuple[RunRecord, str]:
    """Return a run, and why its client failed, if it did; kept in a folder where one is given."""
    run, failure = make_run(scenario), ""
    command = scenario.serve and scenario.serve.client
    if not command:
        result = result_of(run)
    else:
        with TemporaryDirectory() if folder is None else nullcontext(folder) as kept:
            cell = ServedCell(run, own_ports=True)
            with cell.open() as lockstep:
                result = whole(run_by_client(cell, lockstep, command, Path(kept) / FOLDER))
                failure = lockstep.failure
    if folder is not None:
        write_results(result, folder, record=False)
    return result, failure


def measure_all(
    sources: Sequence[str],
    workers: int | None = None,
    out: Path | None = None,
    on_done: Callable[[Measured], None] = lambda _: None,
) -> list[Measured]:
    """Measure scenarios in parallel, in the order given; the results depend on no ``workers``.

    Put the longest first: a worker takes the next one when it is free. Raises InputError where a
    scenario cannot be read, or two have one name; WorkerDiedError where a process died.
    """
    _refuse_doubles(sources)
    study = Study(
        design=sources,
        task=lambda source: (source, out),
        run_one=measure,
        key=lambda measured: measured.source,
    )

    def tell(_: int, __: int, measured: Measured | None) -> None:
        if measured is not None:
            on_done(measured)

    return study.run(in_processes(workers), on_run=tell)


def _refuse_doubles(sources: Sequence[str]) -> None:
    found: dict[str, str] = {}
    for source in sources:
        name = load_scenario(source).name
        if name in found:
            raise InputError(
                f"{found[name]} and {source} are both named {name!r}; "
                "a baseline tells scenarios apart by their names"
            )
        found[name] = source
