"""What a finished sweep leaves and says: table, pictures, and the lines that are printed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.row import RunRow
from dualbend.study.sweep.sensitivity import CONFIDENCE, Sensitivity, sensitivities
from dualbend.study.sweep.table import make_table, numbers, shown_metrics, unit_of, write_table

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
    lines = [f"{'metric':<28}{'runs':>6}{'least':>12}{'median':>12}{'most':>12}  of runs"]
    for name in metrics:
        values = numbers(table, name)
        if not np.isfinite(values).any():
            lines.append(f"{name:<28}{0:>6}")
            continue
        low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
        shown = "".join(f"{v:>12.4g}" for v in (values[low], np.nanmedian(values), values[high]))
        lines.append(
            f"{name:<28}{np.count_nonzero(np.isfinite(values)):>6}{shown}  {low}, {high}  "
            f"[{unit_of(table, name)}]"
        )
    return lines


def _sensitivity_lines(
    design: Design, found: Sequence[Sensitivity], counts: Counter[str]
) -> list[str]:
    if not found:
        return []
    level = f"{100.0 * CONFIDENCE:g} %"
    width = max(len(name) for name in design.names)
    lines = [
        f"Sobol's indices, {level} intervals",
        f"{'metric':<28}{'key':<{width}}{'first':>8}{'':>17}{'total':>8}",
    ]
    for one in found:
        if one.why:
            lines.append(f"{one.metric:<28}none: {one.why}")
            continue
        for i, name in enumerate(design.names):
            (a, b), (c, d) = one.first_interval[:, i], one.total_interval[:, i]
            lines.append(
                f"{one.metric:<28}{name:<{width}}{one.first[i]:>8.3f} ({a:>6.2f},{b:>6.2f})"
                f"{one.total[i]:>9.3f} ({c:>6.2f},{d:>6.2f})"
            )
    others = sum(counts.values()) - counts[_COMPLETED]
    if others:
        lines.append(f"{others} runs did not complete: theirs are the metrics of what they did")
    return lines
