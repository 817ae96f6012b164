"""What each imperfection of a preset does to a scenario alone, and what all of them do together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from dualbend.evaluation.metrics import versions
from dualbend.imperfection.config import PresetName
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.scenario import Scenario, variants
from dualbend.study.ending import Ended, metrics_of, outcome_of
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.runs import RunEach, in_batches
from dualbend.table import Column, Table, quantity

NONE = "none"

METRICS = (
    *("peak_moment", "rms_moment", "mean_moment_hold", "peak_force"),
    *("holes_seated", "peak_pin_force", "worst_hole_offset"),
)
"""Metrics that are shown, of those that the task has."""


class PartRow(msgspec.Struct, frozen=True, kw_only=True):
    """What became of one run: with which imperfection, and which seed."""

    part: str
    seed: int
    outcome: Ended
    reason: str = ""
    metrics: dict[str, Metric] = {}


def _make(_: str, scenario: Scenario) -> Run:
    return make_run(scenario)


def _row(result: RunRecord, part: str, scenario: Scenario) -> PartRow:
    return PartRow(
        part=part,
        seed=scenario.seed,
        outcome=result.outcome,
        reason=result.reason,
        metrics=metrics_of(result),
    )


def _without_result(error: Exception, part: str, scenario: Scenario) -> PartRow:
    outcome, reason = outcome_of(error)
    return PartRow(part=part, seed=scenario.seed, outcome=outcome, reason=reason)


run_part = RunEach(make=_make, row=_row, failed=_without_result)
"""Runs a scenario here; one that is refused or raises is a row as well."""


def run_study(
    scenario: Scenario,
    preset: PresetName,
    folder: Path,
    *,
    seeds: int,
    workers: int | None = None,
    on_run: Callable[[int, int, PartRow | None], None] = lambda *_: None,
) -> list[PartRow]:
    """Run each variant with so many seeds, from the scenario's on; return the rows in order.

    Raises InputError where the folder is another study's or cannot be used; KeyboardInterrupt
    where it is interrupted: the runs that were done are kept, and the same call goes on.
    """
    cases = variants(scenario, preset)
    study = Study(
        design=[(part, scenario.seed + i) for part in cases for i in range(seeds)],
        task=lambda key: (key[0], msgspec.structs.replace(cases[key[0]], seed=key[1])),
        run_one=run_part,
        key=lambda row: (row.part, row.seed),
    )
    about = {"preset": preset, "versions": versions(), "scenario": scenario.to_toml()}
    kept = StudyFolder(folder=folder, row=PartRow, study=about)
    return study.run(in_batches(workers), kept, on_run)


def table(rows: Sequence[PartRow]) -> Table:
    """Return a line for each variant: how runs ended, the median of each metric and its ratio.

    The ratio is the median over the seeds of a metric over that of the same seed without
    imperfections.
    """
    value: dict[tuple[str, int, str], float] = {
        (row.part, row.seed, name): float(metric.value)
        for row in rows
        for name, metric in row.metrics.items()
        if isinstance(metric.value, int | float)
    }
    units = {name: metric.unit for row in rows for name, metric in row.metrics.items()}
    shown = [name for name in METRICS if name in units]
    columns: list[Column | str] = ["imperfection", quantity("completed")]
    for name in shown:
        columns += [quantity(name, units[name]), quantity("ratio", "", ".2f")]
    lines = []
    for part in dict.fromkeys(row.part for row in rows):
        mine = [row for row in rows if row.part == part]
        completed = [row for row in mine if row.outcome == "completed"]
        line: list[object] = [part, f"{len(completed)}/{len(mine)}"]
        for name in shown:
            pairs = [
                (value[part, row.seed, name], value.get((NONE, row.seed, name), 0.0))
                for row in completed
                if (part, row.seed, name) in value
            ]
            ratios = [new / old for new, old in pairs if old]
            line.append(float(np.median([new for new, _ in pairs])) if pairs else None)
            line.append(float(np.median(ratios)) if ratios else None)
        lines.append(line)
    return Table(columns, lines)
