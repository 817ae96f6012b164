"""Tables of a report: metrics, settings, how the run came about."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence

from dualbend.report.html import Html, element, join, table
from dualbend.report.parts import Section, note, number
from dualbend.report.settings import Setting, settings_of
from dualbend.run.record import Metric, RunRecord


def metrics_table(runs: Sequence[RunRecord], names: Sequence[str]) -> Html:
    """Return the metrics, a column a run, the unit last."""
    known: dict[str, str] = {}
    for run in runs:
        known.update({name: m.unit for name, m in run.summary.metrics.items() if name not in known})
    if not known:
        return note("The run left no metrics.")
    rows = [
        (
            name.replace("_", " "),
            *(_value(run.summary.metrics.get(name), unit) for run in runs),
            "–" if unit == "1" else _unbroken(unit),
        )
        for name, unit in known.items()
    ]
    numeric = range(1, len(runs) + 1)
    laid = any(run.scenario.assembly is not None for run in runs)
    of = "of an assembly those of all phases, else of the bending" if laid else "while bending"
    caption = f"Metrics; moments and forces are true ones, {of}"
    return table(caption, ("metric", *names, "unit"), rows, numeric)


def _unbroken(unit: str) -> str:
    return unit.replace(" ", "\u00a0")


def _value(metric: Metric | None, unit: str) -> str:
    if metric is None:
        return "–"
    shown = number(metric.value)
    return shown if metric.unit == unit else f"{shown} {metric.unit}"


def settings_section(run: RunRecord) -> Section:
    """Return what is set otherwise than the defaults, and folded away, everything."""
    settings = settings_of(run.scenario)
    changed = [setting for setting in settings if setting.changed]
    everything = element(
        "details",
        element("summary", f"All {len(settings)} settings"),
        _settings("The resolved scenario", settings),
    )
    return Section(
        title="Settings",
        body=join(
            [_settings("Set otherwise than the default, or without one", changed), everything]
        ),
    )


def _settings(caption: str, settings: Sequence[Setting]) -> Html:
    head = ("key", "value", "unit", "default", "what it is")
    rows = [
        (
            element("code", setting.key),
            setting.value,
            _unbroken(setting.unit),
            "–" if setting.default == "required" else setting.default,
            setting.description,
        )
        for setting in settings
    ]
    return table(caption, head, rows, numeric=(1,))


def origin_section(run: RunRecord) -> Section:
    """Return outcome, seed, versions and model of a run."""
    summary = run.summary
    made, here = summary.versions.get("dualbend"), importlib.metadata.version("dualbend")
    rows = [
        ("scenario", run.scenario.name),
        ("folder", str(run.folder)),
        ("outcome", ended(run)),
        ("seed", str(summary.seed)),
        ("controller", summary.controller or "the scenario's own"),
        ("cycles", str(run.trace.rows)),
        *((name, version) for name, version in summary.versions.items()),
    ]
    if run.model_sha256:
        rows.append(("model (SHA-256)", element("code", run.model_sha256)))
    parts = [table("How this run came about", ("what", "value"), rows)]
    if made is not None and made != here:
        parts.insert(
            0,
            note(
                f"The run was made by dualbend {made}; its predictions on this page are those of "
                f"dualbend {here}."
            ),
        )
    return Section(title="Versions, seed and outcome", body=join(parts))


def ended(run: RunRecord) -> str:
    """Return how a run ended, and why where that is said."""
    words = run.outcome.replace("_", " ")
    return f"{words}: {run.reason}" if run.summary.reason else words
