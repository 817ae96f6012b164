"""A sweep: its runs in local processes or on a cluster, each kept as soon as it is done.

The folder holds the sweep and its scenario, complete (``sweep.toml``, ``scenario.toml``), what
:mod:`dualbend.study.engine` keeps, and ``table.parquet``.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import TypeAlias

from dualbend.errors import InputError
from dualbend.evaluation.metrics import versions
from dualbend.scenario.scenario import Scenario
from dualbend.study.engine import StudyFolder, WorkerDiedError, in_processes
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import SCENARIO, SWEEP, Sweep
from dualbend.study.sweep.row import RAISED, RunRow, resolved, run_row

Task: TypeAlias = tuple[int, Scenario]
RunOne: TypeAlias = Callable[[int, Scenario], RunRow]
Runs: TypeAlias = Callable[[Sequence[Task], RunOne], Generator[RunRow]]
"""Makes the runs somewhere and yields their rows as they end."""

DIED = "the process that ran it died, also when it ran alone"


def run_sweep(
    sweep: Sweep,
    design: Design,
    folder: Path,
    runs: Runs,
    *,
    run: RunOne = run_row,
    on_run: Callable[[int, int, str], None] = lambda *_: None,
) -> list[RunRow]:
    """Make the runs that the folder does not have yet; return all, by index.

    They depend neither on ``runs``, which is :func:`locally` or a cluster's, nor on the order in
    which they end. ``on_run`` is told the number of runs that are done and that there will be, and
    how the last one ended, "" at the start.

    Raises
    ------
    InputError
        The folder is another sweep's or cannot be used; or every run's scenario is refused.
    KeyboardInterrupt
        Interrupted; the runs that were done are in the folder, and the same call goes on.
    """
    total = len(design.rows)
    _refuse_hopeless(sweep, design)
    text = sweep.scenario_toml()
    study = {
        "versions": versions(),
        "scenario": text,
        "sweep": sweep.to_toml(all_of_it=False),
    }
    files = {SCENARIO: text, SWEEP: sweep.to_toml()}
    kept = StudyFolder(folder, RunRow, "run", lambda row: row.index)
    with kept.opened(study, files, "sweep") as (done, keep):
        on_run(len(done), total, "")

        def add(row: RunRow) -> None:
            keep(row)
            done[row.index] = row
            on_run(len(done), total, row.outcome)

        tasks = []
        for index in range(total):
            found = None if index in done else resolved(sweep, design, index)
            if isinstance(found, RunRow):
                add(found)
            elif found is not None:
                tasks.append((index, found))
        # Closed also where an interrupt comes between two runs.
        with closing(runs(tasks, run)) as rows:
            for row in rows:
                add(row)
        (folder / SWEEP).write_text(files[SWEEP], encoding="utf-8")  # its metrics may be others
    return [done[index] for index in range(total)]


def _refuse_hopeless(sweep: Sweep, design: Design) -> None:
    """Refuse a sweep, before it has a folder, none of whose scenarios can be loaded."""
    found = (resolved(sweep, design, index) for index in range(len(design.rows)))
    refused = list(itertools.takewhile(lambda one: isinstance(one, RunRow), found))
    if len(refused) == len(design.rows):
        first = refused[0]
        reason = first.reason if isinstance(first, RunRow) else ""
        raise InputError(f"{sweep.source}: all {len(refused)} runs are refused; run 0: {reason}")


def locally(workers: int) -> Runs:
    """Return what makes the runs in processes of this machine, each with one thread."""

    def runs(tasks: Sequence[Task], run: RunOne) -> Generator[RunRow]:
        left = {task[0]: task for task in tasks}
        while left:
            try:
                with closing(
                    in_processes(list(left.values()), run, workers, ProcessPoolExecutor)
                ) as rows:
                    for row in rows:
                        del left[row.index]
                        yield row
            except WorkerDiedError as died:
                for index, scenario in died.running:
                    del left[index]
                    yield _alone(index, scenario, run)

    return runs


def _alone(index: int, scenario: Scenario, run: RunOne) -> RunRow:
    """Make a run that a process died with: one that dies again is a row, not the sweep's end.

    WorkerDiedError where not even a process that does nothing lives.
    """
    try:
        return next(in_processes([(index, scenario)], run, 1))
    except WorkerDiedError:
        next(in_processes([(index,)], _live, 1))
        return RunRow(index=index, outcome=RAISED, reason=DIED)


def _live(index: int) -> int:
    return index
