"""An onset study in words and numbers: the table, the errors, the residual oscillation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from dualbend.errors import writing
from dualbend.files import write_whole
from dualbend.study.onset.results import Case, OnsetStudy, Simulated
from dualbend.table import Table, shown

_ANALYSES = {"sampled": "sampled", "delayed": "continuous with delay", "paper": "paper (23)"}


def describe_case(case: Case) -> str:
    """Return one line about a case, for a terminal."""
    return (
        f"{case.axis} {case.alpha_rad:.2f} rad, k/b = {case.ratio_per_s:g} /s: "
        f"b = {case.simulated.b:.4g} simulated, {case.sampled_b:.4g} sampled "
        f"({100 * case.error('sampled'):+.1f} %), {case.delayed_b:.3g} delayed, "
        f"{case.paper_b:.3g} paper; "
        f"{shown(case.simulated.frequency_hz, '.2f')} and {case.same_gains_hz:.2f} Hz"
    )


def report(found: OnsetStudy) -> str:
    """Return the whole result as Markdown."""
    head = f"# {found.scenario}: prediction against simulation"
    lines = [f"* {line}" for line in summary(found).splitlines()]
    return "\n".join([head, "", _table(found).markdown(), "", *lines, ""])


def write_report(found: OnsetStudy, folder: Path) -> None:
    """Write ``onset.md`` and ``onset.json``; InputError where that fails."""
    with writing(folder, "--out"):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / "onset.md", report(found))
        write_whole(folder / "onset.json", msgspec.json.format(msgspec.json.encode(found)))


def summary(found: OnsetStudy) -> str:
    """Return the errors over all cases and by axis, one line each."""
    lines = []
    for axis in dict.fromkeys(case.axis for case in found.cases):
        cases = [case for case in found.cases if case.axis == axis]
        for analysis, name in _ANALYSES.items():
            lines.append(f"{axis}, {name}: onset {_spread([c.error(analysis) for c in cases])}")
        lines.append(f"{axis}, frequency: {_spread([c.frequency_error for c in cases])}")
        smooth = [case.sampled_b / case.frictionless.b - 1.0 for case in cases]
        lines.append(f"{axis}, sampled, simulated without dry friction: {_spread(smooth)}")
    errors = [case.error("sampled") for case in found.cases]
    frequencies = [case.frequency_error for case in found.cases]
    lines.append(f"all, sampled: onset {_spread(errors)}; frequency {_spread(frequencies)}")
    gaps = [
        rate.predicted_per_s - rate.simulated_per_s
        for case in found.cases
        for rate in case.simulated.rates
        if rate.simulated_per_s is not None
    ]
    if gaps:
        size = np.abs(gaps)
        lines.append(
            f"growth rate, {len(gaps)} of {sum(len(c.simulated.rates) for c in found.cases)}: "
            f"off by {np.median(size):.2f} /s in the median, {size.max():.2f} /s at most"
        )
    return "\n".join(lines)


def _spread(errors: Sequence[float]) -> str:
    size = np.abs(errors)
    return (
        f"median error {100 * np.median(size):.1f} %, worst "
        f"{100 * errors[int(np.argmax(size))]:+.1f} % (n = {len(errors)})"
    )


def _table(found: OnsetStudy) -> Table:
    headings = (
        *("axis", "rad", "k/b [1/s]", "b simulated", "runs disagree"),
        *("sampled", "delayed", "paper"),
        *("without friction", "Hz simulated / sampled"),
        *("growth at 0.9 b, 1.1 b [1/s]: simulated / sampled", "residual"),
    )
    return Table(headings, [_cells(case) for case in found.cases])


def _cells(case: Case) -> tuple[object, ...]:
    growth = ", ".join(
        f"{shown(rate.simulated_per_s, '.2f')} / {rate.predicted_per_s:.2f}"
        for rate in case.simulated.rates
    )
    scale, unit = (1e6, "µm") if case.axis == "x" else (1e3, "mrad")
    residual = case.simulated.residual
    return (
        *(case.axis, f"{case.alpha_rad:g}", f"{case.ratio_per_s:g}", case.simulated.b),
        _disagreement(case.simulated),
        f"{case.sampled_b:.4g} ({100 * case.error('sampled'):+.1f} %)",
        f"{case.delayed_b:.3g} ({100 * case.error('delayed'):+.0f} %)",
        f"{case.paper_b:.2g} ({100 * case.error('paper'):+.0f} %)",
        case.frictionless.b,
        f"{shown(case.simulated.frequency_hz, '.2f')} / {case.same_gains_hz:.2f}",
        growth,
        None if residual is None else f"{scale * residual:.2g} {unit}",
    )


def _disagreement(found: Simulated) -> str:
    """Return from where to where runs with neighbouring b disagree, relative to the onset."""
    low, high = (100 * (b / found.b - 1.0) for b in (found.unstable_b, found.stable_b))
    return f"{low:+.0f} to {high:+.0f} %"
