"""Tables of a report: metrics, settings, how the run came about."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence

from dualbend.report.section import Block, Details, Section
from dualbend.report.sections.settings import Setting, settings_of
from dualbend.run.record import Metric, RunRecord
from dualbend.table import Code, Column, Columns, Table, quantity, shown


def metrics_section(runs: Sequence[RunRecord], names: Sequence[str], of: str) -> Section:
    """Return the metrics, a column a run, the unit last; ``of``: over which phases they are."""
    shown = metrics_table(runs, names, f"Metrics; moments and forces are true ones, {of}")
    return Section("Metrics", [shown if shown.rows else "The run left no metrics."])


def metrics_table(runs: Sequence[RunRecord], names: Sequence[str], caption: str) -> Table:
    """Return the table of the metrics, a column a run, the unit last."""
    known: dict[str, str] = {}
    for run in runs:
        known.update({name: m.unit for name, m in run.summary.metrics.items() if name not in known})
    rows = [
        (
            name.replace("_", " "),
            *(_value(run.summary.metrics.get(name), unit) for run in runs),
            None if unit == "1" else _unbroken(unit),
        )
        for name, unit in known.items()
    ]
    columns: Columns = ["metric", *(quantity(name) for name in names), "unit"]
    return Table(columns, rows, caption)


def _unbroken(unit: str) -> str:
    return unit.replace(" ", "\u00a0")


def _value(metric: Metric | None, unit: str) -> object:
    if metric is None:
        return None
    if metric.unit == unit:
        return metric.note or None if metric.value is None else metric.value
    return f"{shown(metric.value, missing='–')} {metric.unit}"


def settings_section(run: RunRecord) -> Section:
    """Return what is set otherwise than the defaults, and folded away, everything."""
    settings = settings_of(run.scenario)
    changed = [setting for setting in settings if setting.changed]
    everything = _settings("The resolved scenario", settings)
    return Section(
        "Settings",
        [
            _settings("Set otherwise than the default, or without one", changed),
            Details(f"All {len(settings)} settings", everything),
        ],
    )


def _settings(caption: str, settings: Sequence[Setting]) -> Table:
    rows = [
        (
            Code(setting.key),
            setting.value,
            _unbroken(setting.unit),
            setting.default,
            setting.description,
        )
        for setting in settings
    ]
    columns: Columns = ["key", quantity("value"), "unit", "default", "what it is"]
    return Table(columns, rows, caption)


def origin_section(run: RunRecord) -> Section:
    """Return outcome, seed, versions and model of a run."""
    summary = run.summary
    made, here = summary.versions.get("dualbend"), importlib.metadata.version("dualbend")
    rows: list[tuple[str, object]] = [
        ("scenario", run.scenario.name),
        ("folder", str(run.folder)),
        ("outcome", ended(run)),
        *([] if summary.run is None else [("run", summary.run.id)]),
        ("seed", summary.seed),
        ("controller", summary.controller or "the scenario's own"),
        *([("learned", summary.learned)] if summary.learned else []),
        ("cycles", run.trace.rows),
        *summary.versions.items(),
    ]
    if run.model_sha256:
        rows.append(("model (SHA-256)", Code(run.model_sha256)))
    columns: Columns = ["what", Column("value", format="d")]
    blocks: list[Block] = [Table(columns, rows, "How this run came about")]
    if made is not None and made != here:
        blocks.insert(
            0,
            f"The run was made by dualbend {made}; its predictions on this page are those of "
            f"dualbend {here}.",
        )
    return Section("Versions, seed and outcome", blocks)


def ended(run: RunRecord) -> str:
    """Return how a run ended, and why where that is said."""
    words = run.outcome.replace("_", " ")
    return f"{words}: {run.reason}" if run.reason else words
