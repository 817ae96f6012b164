"""The result of a check, for a terminal, for a CI's test report (JUnit XML) and for a web page."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

from dualbend.check.verdict import Finding, Verdicts
from dualbend.errors import writing
from dualbend.files import write_whole
from dualbend.table import Column, Table, escaped, percent, shown

_HEADINGS = ("scenario", "metric", "old", "new", "unit", "change", "allowed", "verdict", "where")


def table(verdicts: Verdicts, *, everything: bool = True) -> str:
    """Return rows of text, the failures alone unless ``everything``."""
    return _table(verdicts.findings if everything else verdicts.failures).text()


def _table(found: Sequence[Finding]) -> Table:
    columns = [Column(name, format=".5g") for name in _HEADINGS]
    return Table(columns, [_cells(finding) for finding in found])


def sentence(finding: Finding) -> str:
    """Say one failure in words: scenario, metric, old, new, change, time and phase, cause."""
    old, new = (shown(value, ".5g") for value in (finding.old, finding.new))
    unit = f" {finding.unit}" if finding.unit not in {"", "1"} else ""
    parts = [f"{finding.scenario}: {finding.metric} {finding.verdict}: {old} → {new}{unit}"]
    if finding.change is not None:
        parts.append(f" ({percent(finding.change)}, allowed {finding.allowed})")
    elif finding.allowed:
        parts.append(f" (allowed {finding.allowed})")
    parts.append(f" {finding.place}" if finding.place else "")
    parts.append(f"; {finding.reason}" if isinstance(finding.new, str) and finding.reason else "")
    parts.append(f"; {finding.cause}" if finding.cause else "")
    return "".join(parts)


def explanations(verdicts: Verdicts) -> list[str]:
    """Return why values moved and what else is not the baseline's.

    Each once, with the scenarios that it is true of.
    """
    scenarios: dict[str, list[str]] = {}
    for name, notes in verdicts.notes.items():
        failed = [finding for finding in verdicts.failures if finding.scenario == name]
        ended = [f"{f.new}: {f.reason}" for f in failed if isinstance(f.new, str) and f.reason]
        causes = [finding.cause for finding in failed if finding.cause]
        for text in dict.fromkeys([*ended, *causes, *notes]):
            scenarios.setdefault(text, []).append(name)
    return [
        text if len(names) == len(verdicts.notes) > 1 else f"{', '.join(names)}: {text}"
        for text, names in scenarios.items()
    ]


def conclusion(verdicts: Verdicts, *, updated: bool = False) -> str:
    """Return the last line: how many values of how many scenarios are not the baseline's."""
    gated = sum(not f.skipped for f in verdicts.findings)
    failed, new = verdicts.failures, sum(f.verdict == "new" for f in verdicts.findings)
    scenarios = f"{len(verdicts.notes)} scenario{'' if len(verdicts.notes) == 1 else 's'}"
    if updated:
        return (
            f"baseline written, {scenarios}: {len(failed)} values moved beyond their tolerance, "
            f"{new} are new"
        )
    text = f"{gated - len(failed)} of {gated} values of {scenarios} are the baseline's"
    if new:
        text += f"; {new} are new: --update takes them in"
    if failed:
        text += f"; {len(failed)} are not: where that is meant, --update"
    return text


def write_markdown(verdicts: Verdicts, path: Path) -> None:
    """Write failures and their causes, then all values folded away, as a pull request shows it.

    Raises InputError where ``path`` cannot be written.
    """
    failed = bool(verdicts.failures)
    lines = [f"## dualbend check: {'failed' if failed else 'passed'}", "", conclusion(verdicts), ""]
    if failed:
        lines += [_table(verdicts.failures).markdown(), ""]
    lines += [*(f"* {escaped(line)}" for line in explanations(verdicts)), ""]
    lines += ["<details><summary>All values</summary>", "", _table(verdicts.findings).markdown()]
    lines += ["", "</details>", ""]
    with writing(path, "--markdown"):
        write_whole(path, "\n".join(lines))


def write_junit(verdicts: Verdicts, path: Path) -> None:
    """Write JUnit XML: a suite a scenario, a case a value.

    Raises InputError where ``path`` cannot be written.
    """
    root = ElementTree.Element("testsuites", name="dualbend check")
    for scenario, group in groupby(verdicts.findings, key=lambda finding: finding.scenario):
        found = list(group)
        counts = {
            "tests": len(found),
            "failures": sum(finding.failed for finding in found),
            "errors": 0,
            "skipped": sum(finding.skipped for finding in found),
        }
        texts = {name: str(count) for name, count in counts.items()}
        suite = ElementTree.SubElement(root, "testsuite", {"name": scenario, **texts})
        for finding in found:
            _case(suite, finding)
        notes = verdicts.notes[scenario]
        if notes:
            ElementTree.SubElement(suite, "system-out").text = "\n".join(notes)
    for key in ("tests", "failures", "errors", "skipped"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in root)))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode", xml_declaration=False)
    with writing(path, "--junit"):
        write_whole(path, f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n')


def _case(suite: ElementTree.Element, finding: Finding) -> None:
    name = f"dualbend.{finding.scenario}"
    case = ElementTree.SubElement(suite, "testcase", classname=name, name=finding.metric)
    if finding.failed:
        words = sentence(finding)
        failure = ElementTree.SubElement(case, "failure", type=finding.verdict, message=words)
        failure.text = f"{words}\nallowed {finding.allowed}: {finding.reason}"
    elif finding.skipped:
        ElementTree.SubElement(case, "skipped", message=finding.verdict)


def _cells(finding: Finding) -> tuple[float | str | None, ...]:
    return (
        finding.scenario,
        finding.metric,
        finding.old,
        finding.new,
        finding.unit,
        percent(finding.change),
        finding.allowed,
        finding.verdict if not finding.failed else finding.verdict.upper(),
        str(finding.place or ""),
    )
