"""What a finished sweep leaves and says: table, pictures, and the lines that are printed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.run import RunRow
from dualbend.study.sweep.sensitivity import CONFIDENCE, Sensitivity, sensitivities
from dualbend.study.sweep.table import make_table, numbers, shown_metrics, unit_of, write_table
from dualbend.table import Columns, Table, quantity

SENSITIVITY = "sensitivity.png"
_LISTED = 5
_COMPLETED = "completed"


@dataclass(frozen=True, kw_only=True)
class Report:
    """A sweep's table, its shown metrics, their sensitivities if it asks for them, the files."""

    table: pa.Table
    metrics: list[str]
    sensitivities: list[Sensitivity]
    files: list[Path]


def write_report(sweep: Sweep, design: Design, rows: Sequence[RunRow], folder: Path) -> Report:
    """Write table and pictures of a sweep into its folder."""
    from dualbend.study.sweep.figures import (  # noqa: PLC0415 - matplotlib on use only
        heat_map_file,
        plot_heat_map,
        plot_sensitivity,
    )

    table = make_table(sweep, design, rows)
    write_table(table, folder)
    metrics = shown_metrics(sweep, table)
    found = sensitivities(sweep, design, table, metrics) if sweep.sample.sensitivity else []
    files = []
    if sweep.sample.kind == "grid" and len(design.names) == 2:
        for name in metrics:
            files.append(folder / heat_map_file(name))
            plot_heat_map(sweep, design, table, name, files[-1])
    if any(not one.why for one in found):
        files.append(folder / SENSITIVITY)
        plot_sensitivity(sweep, design, found, files[-1])
    return Report(table=table, metrics=metrics, sensitivities=found, files=files)


def report_lines(sweep: Sweep, design: Design, rows: Sequence[RunRow], report: Report) -> list[str]:
    """Return what is printed: how the runs ended, the metrics, the indices."""
    counts = Counter(row.outcome for row in rows)
    ended = ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common())
    lines = [f"{sweep.name}: {len(rows)} runs ({sweep.sample.kind}): {ended}"]
    lines += _failed_lines(design, rows)
    lines += _metric_lines(report.table, report.metrics)
    return lines + _sensitivity_lines(design, report.sensitivities, counts)


def _failed_lines(design: Design, rows: Sequence[RunRow]) -> list[str]:
    failed = [row for row in rows if row.outcome != _COMPLETED]
    lines = [
        f"  run {row.index} ({', '.join(design.settings(row.index))}): {row.outcome}: {row.reason}"
        for row in failed[:_LISTED]
    ]
    more = len(failed) - _LISTED
    return [*lines, f"  and {more} more, see the table"] if more > 0 else lines


def _metric_lines(table: pa.Table, metrics: Sequence[str]) -> list[str]:
    if not metrics:
        return []
    numeric = [quantity(name, width=10) for name in ("min", "median", "max")]
    columns: Columns = ["metric", quantity("runs"), *numeric, "of runs"]
    return [Table(columns, [_metric_row(table, name) for name in metrics]).text()]


def _metric_row(table: pa.Table, name: str) -> tuple[object, ...]:
    values = numbers(table, name)
    if not np.isfinite(values).any():
        return name, 0
    low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
    runs = str(np.count_nonzero(np.isfinite(values)))
    where = f"{low}, {high}  [{unit_of(table, name)}]"
    return name, runs, values[low], np.nanmedian(values), values[high], where


def _sensitivity_lines(
    design: Design, found: Sequence[Sensitivity], counts: Counter[str]
) -> list[str]:
    if not found:
        return []
    first, total = (quantity(name, spec=".3f") for name in ("first", "total"))
    columns: Columns = ["metric", "key", first, quantity(""), total, quantity("")]
    rows = [row for one in found if not one.why for row in _index_rows(design, one)]
    lines = [f"Sobol's indices, {100.0 * CONFIDENCE:g} % intervals"]
    lines += [Table(columns, rows).text()] if rows else []
    lines += [f"{one.metric}: none: {one.why}" for one in found if one.why]
    others = sum(counts.values()) - counts[_COMPLETED]
    if others:
        lines.append(f"{others} runs did not complete: theirs are the metrics of what they did")
    return lines


def _index_rows(design: Design, one: Sensitivity) -> Iterator[tuple[object, ...]]:
    for i, name in enumerate(design.names):
        (a, c), (b, d) = one.ends[:, :, i]
        first, total = one.indices[:, i]
        yield one.metric, name, first, f"({a:.2f},{b:6.2f})", total, f"({c:.2f},{d:6.2f})"
