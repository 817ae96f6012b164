"""A Monte Carlo study: many trials in parallel processes, each kept as soon as it is done.

The folder holds ``study.json`` (what the study is), ``scenario.toml`` (resolved, before any draw)
and ``runs.jsonl`` (one trial a line, in the order in which they ended).
"""

from __future__ import annotations

import itertools
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from dualbend.analysis.metrics import versions
from dualbend.analysis.robustness import Trial, assembly_of, run_one
from dualbend.errors import DualbendError, InputError
from dualbend.run.output import prepare_folder, uninterrupted
from dualbend.run.scenario import Scenario

STUDY, SCENARIO, RUNS = "study.json", "scenario.toml", "runs.jsonl"

_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

RunTrial: TypeAlias = Callable[[Scenario, int, int, bool], Trial]
_Task: TypeAlias = tuple[int, bool]


def run_study(
    scenario: Scenario,
    folder: Path,
    *,
    runs: int,
    seed: int = 1,
    workers: int = 2,
    run: RunTrial = run_one,
    on_trial: Callable[[int, int], None] | None = None,
) -> list[Trial]:
    """Run what the folder does not have yet; return the trials of the first ``runs`` draws.

    They are ordered by draw, with compliance first, and do not depend on ``workers``. A scenario
    without compliance has only the trials without. ``run`` must be importable in another process;
    ``on_trial`` is told the number of trials that are done and that there will be, at the start
    and after each.

    Raises
    ------
    InputError
        The scenario has no assembly, or the folder is another study's or cannot be used.
    DualbendError
        A worker process died.
    KeyboardInterrupt
        Interrupted; the trials that were done are in the folder, and the same call goes on.
    """
    if runs < 1 or workers < 1:
        raise InputError(f"runs = {runs}, workers = {workers}: both must be at least 1")
    wanted = [(index, case) for index in range(runs) for case in cases(scenario)]
    done = open_folder(folder, scenario, seed)
    left = [task for task in wanted if task not in done]

    count = len(wanted) - len(left)
    if on_trial is not None:
        on_trial(count, len(wanted))
    with (
        (folder / RUNS).open("ab") as file,
        # Closed also where an interrupt comes between two trials.
        closing(_trials(scenario, seed, left, min(workers, len(left)), run)) as trials,
    ):
        for trial in trials:
            with uninterrupted():
                file.write(msgspec.json.encode(trial) + b"\n")
                file.flush()
            done[trial.index, trial.compliance] = trial
            count += 1
            if on_trial is not None:
                on_trial(count, len(wanted))
    return [done[task] for task in wanted]


def cases(scenario: Scenario) -> tuple[bool, ...]:
    """Return the cases of each draw: with compliance, if the scenario has one, and without."""
    return (False,) if assembly_of(scenario).compliance is None else (True, False)


def open_folder(folder: Path, scenario: Scenario, seed: int) -> dict[_Task, Trial]:
    """Make the folder or go on with it; return the trials that it has.

    InputError where it holds another study, or a line that is no trial.
    """
    prepare_folder(folder)
    study = {"seed": seed, "versions": versions(), "scenario": scenario.to_toml()}
    path = folder / STUDY
    try:
        if path.exists():
            _refuse_other(folder, study, json.loads(path.read_text(encoding="utf-8")))
        else:
            if (folder / RUNS).exists():
                raise InputError(f"--out {folder}: has {RUNS} but no {STUDY}: whose runs are they?")
            (folder / SCENARIO).write_text(scenario.to_toml(), encoding="utf-8")
            path.write_text(json.dumps(study, indent=2) + "\n", encoding="utf-8")
        return _read_trials(folder / RUNS)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(f"{path}: no valid JSON: {error}") from error


def _refuse_other(folder: Path, study: dict[str, Any], found: Any) -> None:  # noqa: ANN401
    for key, value in study.items():
        other = found.get(key) if isinstance(found, dict) else None
        if other != value:
            change = "" if key == "scenario" else f" ({key} = {other!r}, now {value!r})"
            raise InputError(
                f"--out {folder}: holds a study of another {key}{change}; give another folder, "
                "or remove this one"
            )


def _read_trials(path: Path) -> dict[_Task, Trial]:
    """Read the trials; cut off a last line that was not written to its end."""
    if not path.exists():
        return {}
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        os.truncate(path, whole)
    trials = {}
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        try:
            trial = msgspec.json.decode(line, type=Trial)
        except msgspec.DecodeError as error:
            raise InputError(f"{path}: line {number} is no trial: {error}") from error
        trials[trial.index, trial.compliance] = trial
    return trials


def _trials(
    scenario: Scenario, seed: int, tasks: Sequence[_Task], workers: int, run: RunTrial
) -> Generator[Trial]:
    """Yield the trials as they end."""
    if not tasks:
        return
    strangers = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), initializer=_leave_interrupts_to_the_parent
    )
    left = iter(tasks)
    running: set[Future[Trial]] = set()

    def submit(count: int) -> None:
        # A new process must not be interrupted before it can say that it is not to be.
        with uninterrupted():
            for index, case in itertools.islice(left, count):
                running.add(pool.submit(run, scenario, seed, index, case))

    with _one_thread_each():
        try:
            # No more than can run: what waits in the pool's queue cannot be called back.
            submit(workers)
            while running:
                ended, _ = wait(running, return_when=FIRST_COMPLETED)
                running -= ended
                submit(len(ended))
                for future in ended:
                    yield future.result()
        except BrokenProcessPool as error:
            raise DualbendError(
                "a worker process died, out of memory perhaps; the runs that were done are kept, "
                "the same command goes on"
            ) from error
        finally:
            if running:  # interrupted, or given up
                for process in set(multiprocessing.active_children()) - strangers:
                    process.terminate()
            pool.shutdown(cancel_futures=True)


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let the processes that are started meanwhile compute in one thread each."""
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
