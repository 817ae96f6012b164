"""Scenarios run side by side, each in a fresh process with one thread of linear algebra."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.process import BaseProcess

import msgspec

from dualbend.analysis.baseline import REFUSED, EndedAs
from dualbend.analysis.fingerprint import model_fingerprint
from dualbend.analysis.metrics import Metric, assembly_metrics, compute_metrics, versions
from dualbend.analysis.peaks import Place, last_place, peak_places
from dualbend.analysis.tolerances import WALL_CLOCK
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.scenario import Scenario, load_scenario

_THREADS = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"),
    *("VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"),
)

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
        run = make_run(scenario)
    except InputError as refusal:
        return msgspec.structs.replace(measured, reason=str(refusal))
    result = run.run()
    if result.reason.startswith("interrupted"):
        raise KeyboardInterrupt
    metrics = assembly_metrics(result) if measured.assembly else compute_metrics(result)
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
    context = multiprocessing.get_context("spawn")
    count = min(workers or os.cpu_count() or 1, max(len(sources), 1))
    with _one_thread_each():
        others = set(multiprocessing.active_children())
        pool = ProcessPoolExecutor(count, mp_context=context, initializer=_ignore_interrupts)
        try:
            futures = {pool.submit(measure, source): source for source in sources}
            for future in as_completed(futures):
                on_done(future.result())
        except BrokenProcessPool as error:
            raise InputError(
                f"a process was ended from outside, by too little memory perhaps: try --workers 1 "
                f"({error})"
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            _end(set(multiprocessing.active_children()) - others)
    return [future.result() for future in futures]


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


def _ignore_interrupts() -> None:
    """Leave the interrupt of the terminal, which all processes get, to the one that waits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _end(processes: Iterable[BaseProcess]) -> None:
    """End processes without waiting for what nobody asks for any more."""
    for process in processes:
        process.terminate()
    for process in processes:
        process.join()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that start now use one thread each: small matrices, shared cores."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
