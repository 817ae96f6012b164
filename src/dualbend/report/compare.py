"""Two runs side by side: their metrics, what was set otherwise, one plot and one recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec

from dualbend.errors import writing
from dualbend.evaluation.metrics import side_by_side
from dualbend.files import write_whole
from dualbend.run.record import RunRecord
from dualbend.table import Column, Columns, Table, percent, relative_change


class Compared(msgspec.Struct, frozen=True, kw_only=True):
    """One value of both runs; None where a run has none."""

    name: str
    unit: str
    a: float | None
    b: float | None

    @property
    def change(self) -> float | None:
        """(b − a) / |a|; None where a is 0 or one is none."""
        return relative_change(self.a, self.b)


Differing = dict[str, tuple[str, str]]
"""Settings or versions, as texts, that the runs do not have in common."""


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """What two runs have in common and what not; ``labels`` are how they are called."""

    labels: tuple[str, str]
    outcomes: tuple[str, str]
    metrics: list[Compared]
    settings: Differing
    versions: Differing


def compare_runs(a: RunRecord, b: RunRecord) -> Comparison:
    """Return the metrics of two runs, a row a value, and the settings and versions that differ.

    A compliance brought along from Python is among the settings, as ``controller``.
    """
    values = side_by_side([a.summary.metrics, b.summary.metrics])
    return Comparison(
        labels=labels(a, b),
        outcomes=(_ended(a), _ended(b)),
        metrics=[
            Compared(name=name, unit=unit, a=first, b=second)
            for (name, unit), (first, second) in values.items()
        ],
        settings=_differing(*(_controller(run) for run in (a, b)))
        | _differing(*(_settings(run) for run in (a, b))),
        versions=_differing(a.summary.versions, b.summary.versions),
    )


def labels(a: RunRecord, b: RunRecord) -> tuple[str, str]:
    """Return the shortest ends of the runs' folders that tell them apart."""
    first, second = ((run.folder or Path(run.scenario.name)).resolve().parts for run in (a, b))
    if first == second:
        return f"{first[-1]} (a)", f"{second[-1]} (b)"
    for n in range(1, max(len(first), len(second)) + 1):
        ends = "/".join(first[-n:]), "/".join(second[-n:])
        if ends[0] != ends[1]:
            break
    return ends


def report_text(found: Comparison) -> str:
    """Return the comparison as text."""
    a, b = (Column(label, format=".5g") for label in found.labels)
    columns: Columns = ["", a, b, "change", "unit"]
    rows: list[tuple[object, ...]] = [("outcome", *found.outcomes)]
    rows += [(row.name, row.a, row.b, percent(row.change), row.unit) for row in found.metrics]
    parts = [Table(columns, rows).text()]
    for title, items in (("settings", found.settings), ("versions", found.versions)):
        differing = Table(
            [f"{title} that differ", a, b], [(name, *texts) for name, texts in items.items()]
        )
        parts.append(differing.text() if items else f"{title}: the same")
    return "\n\n".join(parts)


def write_comparison(
    a: RunRecord, b: RunRecord, found: Comparison, folder: Path, *, record: bool = True
) -> None:
    """Write ``compare.txt``, ``compare.png`` and, with ``record``, ``compare.rrd``.

    Raises InputError where the folder cannot be written to.
    """
    from dualbend.report.figures import plot_compared_moments  # noqa: PLC0415

    text = report_text(found)
    with writing(folder, "--out"):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / "compare.txt", text + "\n")
        plot_compared_moments((a, b), found.labels, folder / "compare.png")
        if record:
            from dualbend.recording.compare import write_compared_recording  # noqa: PLC0415

            write_compared_recording((a, b), found.labels, text, folder / "compare.rrd")


def _ended(run: RunRecord) -> str:
    return run.outcome.replace("_", " ")


def _controller(run: RunRecord) -> dict[str, str]:
    """Return whose compliance a run had, which no scenario says."""
    return {"controller": run.controller or "the scenario's own"}


def _settings(run: RunRecord) -> dict[str, str]:
    """Return what a scenario sets, without its description."""
    return dict(_leaves({**msgspec.to_builtins(run.scenario), "description": None}))


def _leaves(value: object, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield the leaves of a scenario with their keys, joined by dots; what is None is not set."""
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _leaves(item, f"{key}.{name}" if key else name)
    elif value is not None:
        yield key, str(list(value) if isinstance(value, tuple) else value)


def _differing(a: dict[str, str], b: dict[str, str]) -> Differing:
    pairs = {name: (a.get(name, "-"), b.get(name, "-")) for name in sorted({*a, *b})}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
