"""What a part found: a table of its cases, and every run that is not as it must be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from assembly.case import Ran
from dualbend.study.robustness.summary import success_interval
from dualbend.table import Columns, Table, quantity

ALL = "all"


def case_table(runs: Sequence[Ran]) -> Table:
    """Return a row for each name of a case, and one for all: counts, intervals, peaks."""
    columns: Columns = [
        *("case", quantity("runs")),
        *("laid", "95 % interval", "safe", "95 % interval"),
        *(quantity(name) for name in ("let go unseated", "stopped though seated")),
        *(quantity(f"pin force, {said}", "N", ".0f") for said in ("median", "largest")),
        quantity("strain over yield, largest", "", ".2f"),
        quantity("time, median", "s", ".0f"),
        "ended",
    ]
    names = list(dict.fromkeys(run.case.name for run in runs))
    groups = [(name, [run for run in runs if run.case.name == name]) for name in names]
    if len(groups) > 1:
        groups.append((ALL, list(runs)))
    return Table(columns, [_row(name, group) for name, group in groups])


def _row(name: str, runs: Sequence[Ran]) -> list[object]:
    n = len(runs)
    forces = [run.pin_force_n for run in runs if run.pin_force_n is not None]
    strains = [run.strain_over_yield for run in runs if run.strain_over_yield is not None]
    times = [run.simulated_s for run in runs if run.simulated_s is not None]
    rates = [
        said
        for count in (sum(run.outcome == "completed" for run in runs), sum(r.safe for r in runs))
        for said in (f"{count}/{n}", _interval(count, n))
    ]
    ended = Counter(run.ended for run in runs).most_common()
    return [
        *(name, n, *rates),
        *(sum(run.false_seated for run in runs), sum(run.false_unseated for run in runs)),
        float(np.median(forces)) if forces else None,
        max(forces, default=None),
        max(strains, default=None),
        float(np.median(times)) if times else None,
        "" if name == ALL else "; ".join(f"{count} {said}" for said, count in ended),
    ]


def _interval(count: int, n: int) -> str:
    low, high = success_interval(count, n)
    return f"{100 * low:.1f}-{100 * high:.1f} %"


def wrong(runs: Sequence[Ran], *, lays: bool) -> Iterator[str]:
    """Yield a Markdown item for each run that is not as it must be, with its command.

    ``lays``: every sheet must be laid, or refused before the run. A run that failed is told also
    where nothing was broken: the sheet was let go unseated, say, or the simulated contact was none.
    """
    for run in runs:
        problems = [
            said
            for said, holds in (
                ("unsafe", not run.safe),
                ("let go unseated", run.false_seated),
                ("stopped though seated", run.false_unseated),
                ("failed", run.safe and run.outcome == "failed"),
                ("not laid", lays and run.outcome not in ("completed", "refused")),
            )
            if holds
        ]
        if problems:
            yield (
                f"* {run.case.name}, seed {run.case.seed}: {', '.join(problems)}: {run.outcome}, "
                f"{run.reason}{_over(run)}\n  `{run.case.command}`"
            )


def _over(run: Ran) -> str:
    """Return what was above its limit, and by which factor."""
    over = {
        "pin force": run.pin_force_over_limit,
        "force on a hole's edge": run.edge_force_over_limit,
        "strain": run.strain_over_yield,
    }
    found = [f"{name} {v:.2f} of its limit" for name, v in over.items() if v is not None and v > 1]
    return f" ({', '.join(found)})" if found else ""
