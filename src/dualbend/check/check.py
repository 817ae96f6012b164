"""The check: runs scenarios, compares them with a baseline, and rewrites it where asked to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from dualbend.check.baseline import (
    CRASHED,
    Baseline,
    Entry,
    Gate,
    find_baseline,
    read_baseline,
    relative_source,
    resolve_source,
    rounded,
    sources,
    write_baseline,
)
from dualbend.check.measure import Measured, measure_all
from dualbend.check.tolerances import default_tolerance
from dualbend.check.verdict import Verdicts, compare
from dualbend.errors import InputError
from dualbend.scenario.load import list_scenarios


def check(
    asked: Sequence[str] = (),
    file: Path | None = None,
    *,
    update: bool = False,
    workers: int | None = None,
    out: Path | None = None,
    on_done: Callable[[Measured], None] = lambda _: None,
) -> Verdicts:
    """Run scenarios and compare them with the baseline, and rewrite it with ``update``.

    ``asked``: names or files; none are all that the baseline holds, all shipped ones where an
    update has none yet. ``file``: the baseline, ./baseline.json if None. ``out``: where the runs
    are kept, a folder each. Raises InputError where
    there is no baseline, or a scenario is not in it (and no ``update``) or cannot be read.
    """
    path = find_baseline(file, update=update)
    baseline = read_baseline(path) if path.is_file() else Baseline()
    wanted = sources(asked, baseline, path) or list(list_scenarios() if update else ())
    if not wanted:
        raise InputError(f"{path}: the baseline holds no scenario; name one, with --update")
    measured = measure_all(_longest_first(wanted, baseline, path), workers, out, on_done)
    measured.sort(key=lambda one: one.name)
    strangers = [one.name for one in measured if one.name not in baseline.scenarios]
    if strangers and not update:
        raise InputError(
            f"{path}: no baseline of {', '.join(strangers)}; "
            f"add it: dualbend check {' '.join(strangers)} --baseline {path} --update"
        )
    verdicts = compare(baseline, measured)
    crashed = [f"{one.name} ({one.reason})" for one in measured if one.outcome == CRASHED]
    if update and crashed:
        raise InputError(f"{path}: not written: {', '.join(crashed)} crashed")
    if update:
        write_baseline(updated(baseline, measured, path), path)
    return verdicts


def _longest_first(wanted: Sequence[str], baseline: Baseline, path: Path) -> list[str]:
    """Return the sources so that the longest runs begin first: the workers end together."""
    times = {}
    for entry in baseline.scenarios.values():
        gate = entry.metrics.get("simulated_time")
        time = gate.value if gate and isinstance(gate.value, float) else 0.0
        times[resolve_source(entry.source, path)] = time
    return sorted(wanted, key=lambda source: -times.get(source, float("inf")))


def updated(baseline: Baseline, measured: Sequence[Measured], path: Path) -> Baseline:
    """Return the baseline with what was measured; tolerances that were edited are kept."""
    entries = dict(baseline.scenarios)
    for one in measured:
        entries[one.name] = _entry(entries.get(one.name), one, path)
    return Baseline(scenarios=dict(sorted(entries.items())))


def _entry(old: Entry | None, one: Measured, path: Path) -> Entry:
    gates = {} if old is None else old.metrics
    metrics = {}
    for name, metric in one.metrics.items():
        value, gate = rounded(metric.value), gates.get(name)
        tolerance = default_tolerance(name, value, one.task)
        # What was edited stays; a default is of a value that is no more.
        if gate and gate.tolerance != default_tolerance(name, gate.value, one.task):
            tolerance = gate.tolerance
        metrics[name] = Gate(value=value, unit=metric.unit, tolerance=tolerance)
    return Entry(
        source=relative_source(one.source, path),
        outcome=one.outcome,
        model_sha256=one.model_sha256,
        settings=one.settings,
        versions=one.versions,
        metrics=metrics,
    )
