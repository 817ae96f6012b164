"""The verdict on each value; an improvement beyond the tolerance fails as well.

It means that the baseline no longer says what the code does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Literal

import msgspec

from dualbend.check.baseline import Baseline, Entry, Gate
from dualbend.check.measure import Measured
from dualbend.check.settings import changed_settings
from dualbend.check.tolerances import Better, better_where
from dualbend.evaluation.peaks import Place
from dualbend.run.record import Metric
from dualbend.table import relative_change

ENGINE = "mujoco"
"""The package whose version is the physics engine's."""

OUTCOME = "outcome"
"""The row of a scenario that says how its run ended."""

Verdict = Literal["ok", "worse", "better", "changed", "new", "not gated"]


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """One value against its baseline's.

    ``metric`` has its index where the metric has several values. ``place``: of the new value, where
    it is a peak's. ``cause``: of a change, as far as the baseline tells.
    """

    scenario: str
    metric: str
    unit: str
    old: float | str | None
    new: float | str | None
    allowed: str
    reason: str
    verdict: Verdict
    place: Place | None = None
    cause: str = ""

    @property
    def failed(self) -> bool:
        """The change is beyond the tolerance, for the better or for the worse."""
        return self.verdict in {"worse", "better", "changed"}

    @property
    def skipped(self) -> bool:
        """The value is gated by nothing."""
        return self.verdict in {"new", "not gated"}

    @property
    def change(self) -> float | None:
        """The relative change; None where the old value is 0 or one is no number."""
        return relative_change(self.old, self.new)


class Verdicts(msgspec.Struct, frozen=True, kw_only=True):
    """The findings, one per value, and what else of each scenario is not the baseline's."""

    findings: list[Finding]
    notes: dict[str, list[str]]

    @property
    def failures(self) -> list[Finding]:
        """The rows beyond their tolerance."""
        return [finding for finding in self.findings if finding.failed]


def compare(baseline: Baseline, measured: Sequence[Measured]) -> Verdicts:
    """Compare what was measured with the baseline; a scenario or metric that it lacks is new."""
    entries = [(baseline.scenarios.get(one.name), one) for one in measured]
    return Verdicts(
        findings=[finding for entry, one in entries for finding in _findings(entry, one)],
        notes={one.name: _differences(entry, one) if entry else [] for entry, one in entries},
    )


def _findings(entry: Entry | None, one: Measured) -> Iterator[Finding]:
    old = entry.outcome if entry else None
    cause = _cause(entry, one) if entry else ""
    yield Finding(
        scenario=one.name,
        metric=OUTCOME,
        unit="",
        old=old,
        new=one.outcome,
        allowed="the same",
        reason=one.reason,
        verdict="new" if old is None else "ok" if old == one.outcome else "changed",
        place=one.end,
        cause=cause,
    )
    gates = entry.metrics if entry else {}
    # A refused scenario has no metrics, and its outcome has said so.
    for name in sorted({*one.metrics, *(gates if one.metrics else ())}):
        gate, metric = gates.get(name), one.metrics.get(name)
        (olds, news), places = map(_listed, (gate, metric)), one.places.get(name, [])
        several = any(given and isinstance(given.value, list) for given in (gate, metric))
        for i, (before, now, place) in enumerate(zip_longest(olds, news, places)):
            improved = better_where(name, one.task)
            yield Finding(
                scenario=one.name,
                metric=f"{name}[{i}]" if several else name,
                unit=metric.unit if metric else gate.unit if gate else "",
                old=before,
                new=now,
                allowed=gate.tolerance.in_words(gate.unit) if gate else "",
                reason=gate.tolerance.reason if gate else "",
                verdict=_verdict(gate, metric, before, now, improved) if gate else "new",
                place=place,
                cause=cause,
            )


def _listed(given: Gate | Metric | None) -> Sequence[float | None]:
    value = given.value if given else None
    return value if isinstance(value, list) else [value]


def _verdict(
    gate: Gate, metric: Metric | None, old: float | None, new: float | None, improved: Better
) -> Verdict:
    if gate.tolerance.kind == "none":
        return "not gated"
    if metric is None or metric.unit != gate.unit or (old is None) != (new is None):
        return "changed"
    if old is None or new is None or gate.tolerance.allows(old, new):
        return "ok"
    if improved == "neither":
        return "changed"
    return "better" if (abs(new) < abs(old)) == (improved == "lower") else "worse"


def _differences(entry: Entry, one: Measured) -> list[str]:
    """Say what else is not as it was when the baseline was written."""
    changed = _version_changes(entry, one)
    notes = [_engine_change(changed.pop(ENGINE))] if ENGINE in changed else []
    if changed:
        notes.append(f"library change: {', '.join(changed.values())}")
    if scenario := _scenario_change(entry, one):
        notes.append(scenario)
    if not entry.settings:
        notes.append("no settings to compare: the baseline is of an earlier version")
    if one.model_sha256 != entry.model_sha256:
        notes.append("model change: the compiled model is not the baseline's")
    return notes


def _cause(entry: Entry, one: Measured) -> str:
    """Tell a change of engine from one of libraries, of the scenario, and of code."""
    changed = _version_changes(entry, one)
    code = changed.pop("dualbend", None)
    if ENGINE in changed:
        return _engine_change(changed[ENGINE])
    if scenario := _scenario_change(entry, one):
        return scenario
    hints = [f"libraries differ too: {', '.join(changed.values())}"] if changed else []
    hints += [f"of {code}"] if code else []
    hints += ["the model too"] if one.model_sha256 != entry.model_sha256 else []
    hints += [] if entry.settings else ["or of settings, which the baseline does not hold"]
    return f"change of code ({'; '.join(hints)})" if hints else "change of code, same engine"


def _engine_change(versions: str) -> str:
    return (
        f"engine change: {versions}; update the engine and the baseline in a commit of their own, "
        "then a change of code shows"
    )


def _scenario_change(entry: Entry, one: Measured) -> str:
    """Name the settings that differ, of the file or of the code's defaults; "" where none do."""
    changed = changed_settings(entry.settings, one.settings) if entry.settings else []
    return f"scenario change: {', '.join(changed)}" if changed else ""


def _version_changes(entry: Entry, one: Measured) -> dict[str, str]:
    names = sorted({*entry.versions, *one.versions})
    pairs = {
        name: (entry.versions.get(name, "none"), one.versions.get(name, "none")) for name in names
    }
    return {name: f"{name} {old} → {new}" for name, (old, new) in pairs.items() if old != new}
