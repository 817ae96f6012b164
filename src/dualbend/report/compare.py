"""Two runs side by side: their metrics, what was set otherwise, one plot and one recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from dualbend.errors import writing
from dualbend.run.record import Metric, RunRecord
from dualbend.table import Column, Columns, Table

_NONE = "-"
_OWN_CONTROLLER = "the scenario's own"
_NO_SETTINGS = frozenset({"description"})


class Compared(msgspec.Struct, frozen=True, kw_only=True):
    """One value of both runs; None where a run has none."""

    name: str
    unit: str
    a: float | None
    b: float | None

    @property
    def change(self) -> float | None:
        """(b − a) / |a|; None where a is 0 or one is none."""
        if self.a is None or self.b is None or self.a == 0.0:
            return None
        return (self.b - self.a) / abs(self.a)


class Differing(msgspec.Struct, frozen=True, kw_only=True):
    """A setting or version, as text, that the runs do not have in common."""

    name: str
    a: str
    b: str


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """What two runs have in common and what not; ``labels`` are how they are called."""

    labels: tuple[str, str]
    outcomes: tuple[str, str]
    metrics: list[Compared]
    settings: list[Differing]
    versions: list[Differing]


def compare_runs(a: RunRecord, b: RunRecord) -> Comparison:
    """Return the metrics of two runs, a row a value, and the settings and versions that differ.

    A compliance brought along from Python is among the settings, as ``controller``.
    """
    first, second = (
        dict(_flat(msgspec.to_builtins(run.scenario), (), _NO_SETTINGS)) for run in (a, b)
    )
    return Comparison(
        labels=labels(a, b),
        outcomes=(_ended(a), _ended(b)),
        metrics=list(_metrics(a.summary.metrics, b.summary.metrics)),
        settings=[*_differing(*_controllers(a, b)), *_differing(first, second)],
        versions=list(_differing(a.summary.versions, b.summary.versions)),
    )


def _place(run: RunRecord) -> Path:
    return run.folder or Path(run.scenario.name)


def labels(a: RunRecord, b: RunRecord) -> tuple[str, str]:
    """Return the shortest ends of the runs' folders that tell them apart."""
    first, second = (_place(run).resolve().parts for run in (a, b))
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
    rows += [(row.name, row.a, row.b, _percent(row.change), row.unit) for row in found.metrics]
    parts = [Table(columns, rows).text()]
    for title, items in (("settings", found.settings), ("versions", found.versions)):
        differing = Table(
            [f"{title} that differ", a, b], [(item.name, item.a, item.b) for item in items]
        )
        parts.append(differing.text() if items else f"{title}: the same")
    return "\n\n".join(parts)


def write_comparison(
    a: RunRecord, b: RunRecord, found: Comparison, folder: Path, *, record: bool = True
) -> None:
    """Write ``compare.txt``, ``compare.png`` and, with ``record``, ``compare.rrd``.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    from dualbend.report.figures import plot_compared_moments  # noqa: PLC0415

    text = report_text(found)
    with writing(folder, "--out"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "compare.txt").write_text(text + "\n", encoding="utf-8")
        plot_compared_moments((a, b), found.labels, folder / "compare.png")
        if record:
            from dualbend.recording.compare import write_compared_recording  # noqa: PLC0415

            write_compared_recording((a, b), found.labels, text, folder / "compare.rrd")


def _controllers(a: RunRecord, b: RunRecord) -> list[dict[str, str]]:
    """Return whose compliance each run had, which no scenario says."""
    return [{"controller": run.controller or _OWN_CONTROLLER} for run in (a, b)]


def _ended(run: RunRecord) -> str:
    return run.outcome.replace("_", " ")


def _metrics(a: dict[str, Metric], b: dict[str, Metric]) -> Iterator[Compared]:
    for name in [*a, *(name for name in b if name not in a)]:
        first, second = a.get(name), b.get(name)
        known = first or second
        assert known is not None
        one, other = (_values(metric) for metric in (first, second))
        several = any(m is not None and isinstance(m.value, list) for m in (first, second))
        # Numbers of two units are not compared.
        if first is not None and second is not None and first.unit != second.unit:
            yield from (_row(f"{name}[{i}]", first.unit, one, (), i) for i in range(len(one)))
            yield from (_row(f"{name}[{i}]", second.unit, (), other, i) for i in range(len(other)))
            continue
        for i in range(max(len(one), len(other))):
            yield _row(f"{name}[{i}]" if several else name, known.unit, one, other, i)


def _row(
    name: str, unit: str, a: Sequence[float | None], b: Sequence[float | None], i: int
) -> Compared:
    first, second = (values[i] if i < len(values) else None for values in (a, b))
    return Compared(name=name, unit=unit, a=first, b=second)


def _values(metric: Metric | None) -> Sequence[float | None]:
    if metric is None:
        return ()
    return metric.value if isinstance(metric.value, list) else (metric.value,)


def _flat(
    value: object, keys: tuple[str, ...], without: frozenset[str] = frozenset()
) -> Iterator[tuple[str, str]]:
    """Yield the leaves of a scenario with their keys, joined by dots; what is None is not set."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in without:
                yield from _flat(item, (*keys, key))
    elif value is not None:
        shown = list(value) if isinstance(value, tuple) else value
        yield ".".join(keys), str(shown)


def _differing(a: dict[str, str], b: dict[str, str]) -> Iterator[Differing]:
    for name in sorted({*a, *b}):
        first, second = a.get(name, _NONE), b.get(name, _NONE)
        if first != second:
            yield Differing(name=name, a=first, b=second)


def _percent(change: float | None) -> str:
    return "" if change is None else f"{100 * change:+.3g} %"
