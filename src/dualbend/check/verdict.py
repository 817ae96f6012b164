"""The verdict on each value; an improvement beyond the tolerance fails as well.

It means that the baseline no longer says what the code does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, TypeVar

import msgspec

from dualbend.check.baseline import Baseline, Entry, Gate, Value
from dualbend.check.measure import Measured
from dualbend.check.tolerances import better_where
from dualbend.evaluation.peaks import Place
from dualbend.run.record import Metric

_T = TypeVar("_T")

ENGINE = "mujoco"
"""The package whose version is the physics engine's."""

OUTCOME = "outcome"
"""The row of a scenario that says how its run ended."""

Verdict = Literal["ok", "worse", "better", "changed", "new", "not gated"]


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """One value against its baseline's.

    ``metric`` has its index where the metric has several values. ``place``: of the new value, where
    it is a peak's. ``cause``: of a failure, as far as the baseline's versions tell.
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
    def change(self) -> float | None:
        """The relative change; None where the old value is 0 or one is no number."""
        if isinstance(self.old, float) and isinstance(self.new, float) and self.old:
            return (self.new - self.old) / abs(self.old)
        return None


class Verdicts(msgspec.Struct, frozen=True, kw_only=True):
    """What was found: a row a value, and of each scenario what else is not the baseline's."""

    findings: list[Finding]
    notes: dict[str, list[str]]

    @property
    def failures(self) -> list[Finding]:
        """The rows beyond their tolerance."""
        return [finding for finding in self.findings if finding.failed]


def compare(baseline: Baseline, measured: Sequence[Measured]) -> Verdicts:
    """Compare what was measured with the baseline; a scenario or metric that it lacks is new."""
    findings: list[Finding] = []
    notes: dict[str, list[str]] = {}
    for one in measured:
        entry = baseline.scenarios.get(one.name)
        notes[one.name] = [] if entry is None else _differences(entry, one)
        cause = "" if entry is None else _cause(entry, one)
        for finding in (_outcome(entry, one), *_metrics(entry, one)):
            blamed = msgspec.structs.replace(finding, cause=cause) if finding.failed else finding
            findings.append(blamed)
    return Verdicts(findings=findings, notes=notes)


def _outcome(entry: Entry | None, one: Measured) -> Finding:
    old = None if entry is None else entry.outcome
    verdict: Verdict = "new" if old is None else "ok" if old == one.outcome else "changed"
    return Finding(
        scenario=one.name,
        metric=OUTCOME,
        unit="",
        old=old,
        new=one.outcome,
        allowed="the same",
        reason=one.reason,
        verdict=verdict,
        place=one.end,
    )


def _metrics(entry: Entry | None, one: Measured) -> Iterator[Finding]:
    gates = {} if entry is None else entry.metrics
    # A refused scenario has no metrics, and its outcome has said so.
    gone = [name for name in gates if name not in one.metrics] if one.metrics else []
    for name in sorted([*one.metrics, *gone]):
        gate, metric = gates.get(name), one.metrics.get(name)
        old, new = gate.value if gate else None, metric.value if metric else None
        several = isinstance(old, list) or isinstance(new, list)
        olds, news, places = _values(old), _values(new), one.places.get(name, [])
        for i in range(max(len(olds), len(news))):
            finding = _element(gate, metric, _item(olds, i), _item(news, i), name)
            yield msgspec.structs.replace(
                finding,
                scenario=one.name,
                metric=f"{name}[{i}]" if several else name,
                place=_item(places, i),
            )


def _element(
    gate: Gate | None, metric: Metric | None, old: float | None, new: float | None, name: str
) -> Finding:
    """Judge one value of a metric; where it is from is added by the caller."""
    unit = metric.unit if metric else gate.unit if gate else ""
    verdict: Verdict = "new"
    if gate is not None:
        verdict = _verdict(gate, metric, old, new, name)
    return Finding(
        scenario="",
        metric=name,
        unit=unit,
        old=old,
        new=new,
        allowed=gate.tolerance.in_words(gate.unit) if gate else "",
        reason=gate.tolerance.reason if gate else "",
        verdict=verdict,
    )


def _verdict(
    gate: Gate, metric: Metric | None, old: float | None, new: float | None, name: str
) -> Verdict:
    if gate.tolerance.kind == "none":
        return "not gated"
    if metric is None or metric.unit != gate.unit or (old is None) != (new is None):
        return "changed"
    if old is None or new is None or gate.tolerance.allows(old, new):
        return "ok"
    better = better_where(name)
    if better == "neither":
        return "changed"
    return "better" if (abs(new) < abs(old)) == (better == "lower") else "worse"


def _values(value: Value) -> Sequence[float | None]:
    return value if isinstance(value, list) else [value]


def _item(items: Sequence[_T | None], i: int) -> _T | None:
    return items[i] if i < len(items) else None


def _differences(entry: Entry, one: Measured) -> list[str]:
    """Say what else is not as it was when the baseline was written."""
    changed = _version_changes(entry, one)
    notes = [f"engine change: {changed.pop(ENGINE)}"] if ENGINE in changed else []
    if changed:
        notes.append(f"library change: {', '.join(changed.values())}")
    if one.scenario_sha256 != entry.scenario_sha256:
        notes.append("scenario change: its resolved settings are not the baseline's")
    if one.model_sha256 != entry.model_sha256:
        notes.append("model change: the compiled model is not the baseline's")
    return notes


def _cause(entry: Entry, one: Measured) -> str:
    """Tell a change of engine from one of libraries, of the scenario, and of code."""
    changed = _version_changes(entry, one)
    code = changed.pop("dualbend", None)
    if ENGINE in changed:
        return (
            f"engine change ({changed[ENGINE]}): update the engine and the baseline in a commit "
            "of their own, then a change of code shows"
        )
    if one.scenario_sha256 != entry.scenario_sha256:
        return "change of the scenario's settings (or of the code's defaults)"
    hints = [f"libraries differ too: {', '.join(changed.values())}"] if changed else []
    hints += [f"of {code}"] if code else []
    hints += ["the model too"] if one.model_sha256 != entry.model_sha256 else []
    return f"change of code ({'; '.join(hints)})" if hints else "change of code, same engine"


def _version_changes(entry: Entry, one: Measured) -> dict[str, str]:
    names = sorted({*entry.versions, *one.versions})
    pairs = {
        name: (entry.versions.get(name, "none"), one.versions.get(name, "none")) for name in names
    }
    return {name: f"{name} {old} → {new}" for name, (old, new) in pairs.items() if old != new}
