"""A sweep as a study: its runs and the folder that they are kept in.

The folder holds the sweep and its scenario, complete (``sweep.toml``, ``scenario.toml``), what
:mod:`dualbend.study.folder` keeps, and ``table.parquet``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeAlias

from dualbend.errors import InputError
from dualbend.evaluation.metrics import versions
from dualbend.scenario.scenario import Scenario
from dualbend.study.ending import RAISED
from dualbend.study.engine import Place, Study
from dualbend.study.folder import StudyFolder
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import SCENARIO, SWEEP, Sweep
from dualbend.study.sweep.row import RunRow, run_row, task

RunOne: TypeAlias = Callable[[int, Scenario], RunRow]


def run_sweep(
    sweep: Sweep,
    design: Design,
    folder: Path,
    place: Place,
    *,
    run: RunOne = run_row,
    on_run: Callable[[int, int, RunRow | None], None] = lambda *_: None,
) -> list[RunRow]:
    """Make the runs that the folder does not have yet; return all, by index.

    ``on_run`` as :meth:`dualbend.study.engine.Study.run` has it.

    Raises
    ------
    InputError
        The folder is another sweep's or cannot be used; or every run's scenario is refused.
    KeyboardInterrupt
        Interrupted; the runs that were done are in the folder, and the same call goes on.
    """
    _refuse_hopeless(sweep, design)
    text, complete = sweep.scenario_toml(), sweep.to_toml()

    def finish(rows: list[RunRow]) -> list[RunRow]:
        (folder / SWEEP).write_text(complete, encoding="utf-8")  # its metrics may be others
        return rows

    study = Study(
        design=range(len(design.rows)),
        task=partial(task, sweep, design),
        run_one=run,
        key=lambda row: row.index,
        summarise=finish,
        lost=lambda index, reason: RunRow(index=index, outcome=RAISED, reason=reason),
    )
    kept = StudyFolder(
        folder=folder,
        row=RunRow,
        study={"versions": versions(), "scenario": text, "sweep": sweep.to_toml(all_of_it=False)},
        files={SCENARIO: text, SWEEP: complete},
        name="sweep",
    )
    return study.run(place, kept, on_run)


def _refuse_hopeless(sweep: Sweep, design: Design) -> None:
    """Refuse a sweep, before it has a folder, none of whose scenarios can be loaded."""
    first = None
    for index in range(len(design.rows)):
        found = task(sweep, design, index)
        if not isinstance(found, RunRow):
            return
        first = first or found
    reason = "" if first is None else first.reason
    raise InputError(f"{sweep.source}: all {len(design.rows)} runs are refused; run 0: {reason}")
