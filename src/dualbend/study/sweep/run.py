"""A sweep as a study: its runs, what became of each, and the folder that they are kept in.

The folder holds the sweep and its scenario, complete (``sweep.toml``, ``scenario.toml``), what
:mod:`dualbend.study.folder` keeps, and ``table.parquet``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

import msgspec

from dualbend.errors import InputError, brief, writing
from dualbend.evaluation.metrics import COMMON_METRICS, versions
from dualbend.files import write_whole
from dualbend.registry import TASKS
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.explain import nearest
from dualbend.scenario.scenario import Scenario
from dualbend.study.ending import RAISED, REFUSED, Ended, metrics_of, outcome_of
from dualbend.study.engine import Place, Study
from dualbend.study.folder import StudyFolder
from dualbend.study.runs import RunEach
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import SCENARIO, SWEEP, Sweep


class RunRow(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a run: no metrics where it was refused or broke; none of the machine."""

    index: int
    outcome: Ended
    reason: str = ""
    metrics: dict[str, Metric] = {}


RunOne: TypeAlias = Callable[[int, Scenario], RunRow]


def _make(_: int, scenario: Scenario) -> Run:
    return make_run(scenario)


def _row(result: RunRecord, index: int, _: Scenario) -> RunRow:
    metrics = metrics_of(result)
    return RunRow(index=index, outcome=result.outcome, reason=result.reason, metrics=metrics)


def _without_result(error: Exception, index: int, _: Scenario | None = None) -> RunRow:
    outcome, reason = outcome_of(error)
    return RunRow(index=index, outcome=outcome, reason=reason)


run_row = RunEach(make=_make, row=_row, failed=_without_result)
"""Runs a scenario here; one that is refused or raises is a row as well."""


def run_sweep(
    sweep: Sweep,
    design: Design,
    folder: Path,
    place: Place,
    *,
    run: RunOne = run_row,
    device: str | None = None,
    on_run: Callable[[int, int, RunRow | None], None] = lambda *_: None,
) -> list[RunRow]:
    """Make the runs that the folder does not have yet; return all, by index.

    ``device``: what ``place`` runs the physics on, if not the CPU; its rows are no others' rows.
    ``on_run`` as :meth:`dualbend.study.engine.Study.run` has it. Raises InputError where the folder
    is another sweep's or cannot be used, or every run's scenario is refused; KeyboardInterrupt
    where it is interrupted: the runs that were done are in the folder, and the same call goes on.
    """
    _refuse_hopeless(sweep, design)
    _refuse_unknown_metrics(sweep)
    text, complete = sweep.scenario_toml(), sweep.to_toml()
    study = Study(
        design=range(len(design.rows)),
        task=partial(_task, sweep, design),
        run_one=run,
        key=lambda row: row.index,
        lost=lambda index, reason: RunRow(index=index, outcome=RAISED, reason=reason),
    )
    kept = StudyFolder(
        folder=folder,
        row=RunRow,
        study={
            "versions": versions(),
            "scenario": text,
            "sweep": sweep.to_toml(all_of_it=False),
            **({} if device is None else {"device": device}),
        },
        files={SCENARIO: text, SWEEP: complete},
        check=partial(_refuse_strangers, len(design.rows)),
    )
    rows = study.run(place, kept, on_run)
    with writing(folder / SWEEP):
        write_whole(folder / SWEEP, complete)  # its metrics may be others
    return rows


def _refuse_strangers(runs: int, rows: Sequence[RunRow]) -> None:
    """Refuse rows of a run that the sweep does not have, or that say what no run does."""
    units: dict[str, tuple[str, int]] = {}
    for row in rows:
        at = f"run {row.index}"
        if not 0 <= row.index < runs:
            raise InputError(f"{at}: the sweep has runs 0 to {runs - 1}")
        if row.metrics and row.outcome in (REFUSED, RAISED):
            raise InputError(f"{at}: has metrics, and outcome {row.outcome!r}")
        for name, metric in row.metrics.items():
            unit, other = units.setdefault(name, (metric.unit, row.index))
            if metric.unit != unit:
                raise InputError(
                    f"{at}: metrics.{name} is in {metric.unit!r}, in run {other} in {unit!r}"
                )


def _task(sweep: Sweep, design: Design, index: int) -> tuple[int, Scenario] | RunRow:
    """Return a run's number and scenario, or the row of one that is refused."""
    try:
        return index, sweep.resolve(design.settings(index), design.seed(index))
    except InputError as error:
        return _without_result(error, index)


def _refuse_unknown_metrics(sweep: Sweep) -> None:
    """Refuse a metric that no run of the task has; a task of one's own may not say which it has."""
    kinds = list(TASKS) if {"task", "task.kind"} & set(sweep.keys) else [sweep.resolve().task.kind]
    own = [TASKS[kind].part("tolerances") for kind in kinds]
    known = sorted({*COMMON_METRICS, *(name for names in own for name in names)})
    for name in sweep.config.metrics if all(own) else ():
        if name.partition("[")[0] not in known:
            raise InputError(
                f"{sweep.source}: metrics = {brief(name)}: {nearest(name, known)}"
                f"there are {', '.join(known)}"
            )


def _refuse_hopeless(sweep: Sweep, design: Design) -> None:
    """Refuse a sweep, before it has a folder, none of whose scenarios can be loaded."""
    reasons = []
    for index in range(len(design.rows)):
        found = _task(sweep, design, index)
        if not isinstance(found, RunRow):
            return
        reasons.append(found.reason)
    raise InputError(f"{sweep.source}: all {len(reasons)} runs are refused; run 0: {reasons[0]}")
