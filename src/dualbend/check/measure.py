"""Scenarios run side by side, each in a fresh process with one thread of linear algebra."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence

import msgspec

from dualbend.check.baseline import CRASHED, REFUSED, EndedAs
from dualbend.errors import InputError
from dualbend.evaluation.fingerprint import model_fingerprint
from dualbend.evaluation.metrics import WALL_CLOCK, versions
from dualbend.evaluation.peaks import Place, last_place, peak_places
from dualbend.run.make import make_run
from dualbend.run.record import Metric
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.engine import WorkerDiedError, in_processes

_NOT_OF_A_RESULT = ("rerun-sdk",)


class Measured(msgspec.Struct, frozen=True, kw_only=True):
    """What a scenario came to now; ``places`` has the time and phase of each metric's peak.

    A scenario that is refused before its run has no model and no metrics, and its reason.
    """

    name: str
    source: str
    assembly: bool
    outcome: EndedAs
    reason: str = ""
    end: Place | None = None
    model_sha256: str = ""
    scenario_sha256: str
    versions: dict[str, str]
    metrics: dict[str, Metric] = {}
    places: dict[str, list[Place | None]] = {}


def measure(source: str) -> Measured:
    """Run a scenario here and return what a baseline compares.

    Raises
    ------
    InputError
        The scenario cannot be read. One that can be and is refused is an outcome.
    KeyboardInterrupt
        The user ended it; half a run is no measurement.
    """
    scenario = load_scenario(source)
    measured = Measured(
        name=scenario.name,
        source=source,
        assembly=scenario.assembly is not None,
        outcome=REFUSED,
        scenario_sha256=scenario_hash(scenario),
        versions={k: v for k, v in versions().items() if k not in _NOT_OF_A_RESULT},
    )
    try:
        return _measure_run(scenario, measured)
    except InputError as refusal:
        return msgspec.structs.replace(measured, reason=str(refusal))
    except Exception as fault:
        reason = f"{type(fault).__name__}: {fault}"
        return msgspec.structs.replace(measured, outcome=CRASHED, reason=reason)


def _measure_run(scenario: Scenario, measured: Measured) -> Measured:
    result = make_run(scenario).run()
    if result.reason.startswith("interrupted"):
        raise KeyboardInterrupt
    metrics = result.metrics
    return msgspec.structs.replace(
        measured,
        outcome=result.outcome,
        reason=result.reason,
        end=last_place(result),
        model_sha256=model_fingerprint(result.model),
        metrics={name: metric for name, metric in metrics.items() if name not in WALL_CLOCK},
        places=peak_places(result, metrics),
    )


def scenario_hash(scenario: Scenario) -> str:
    """Return the SHA-256 of what the resolved scenario asks for, its description apart."""
    plain = msgspec.structs.replace(scenario, description="")
    return hashlib.sha256(plain.to_toml().encode()).hexdigest()


def measure_all(
    sources: Sequence[str],
    workers: int | None = None,
    on_done: Callable[[Measured], None] = lambda _: None,
) -> list[Measured]:
    """Measure scenarios in parallel, in the order given; the results depend on no ``workers``.

    Put the longest first: a worker takes the next one when it is free.

    Raises
    ------
    InputError
        A scenario cannot be read, two have one name, or a process died.
    """
    refuse_doubles(sources)
    found = {}
    try:
        for source, measured in in_processes(
            [(source,) for source in sources], _measure_one, workers or os.cpu_count() or 1
        ):
            found[source] = measured
            on_done(measured)
    except WorkerDiedError as error:
        raise InputError(
            "a process was ended from outside, by too little memory perhaps: try --workers 1"
        ) from error
    return [found[source] for source in sources]


def _measure_one(source: str) -> tuple[str, Measured]:
    return source, measure(source)


def refuse_doubles(sources: Sequence[str]) -> None:
    """Refuse two scenarios of one name: a baseline tells them apart by it."""
    found: dict[str, str] = {}
    for source in sources:
        name = load_scenario(source).name
        if name in found:
            raise InputError(
                f"{found[name]} and {source} are both named {name!r}; "
                "a baseline tells scenarios apart by their names"
            )
        found[name] = source
