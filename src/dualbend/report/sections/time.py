"""Sections over time: the wrench on both arms, the deviation by compliance, the phases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dualbend.report.over_time import OverTime, Phase
from dualbend.report.plot import COLOURS, Axis, Bar, Plot
from dualbend.report.section import Figure, Panels, Section
from dualbend.run.record import RunRecord
from dualbend.table import Column, Table, quantity
from dualbend.types import SIDES

OnBothArms = tuple[Axis, float, tuple[tuple[str, str], ...], str]
"""Axis, its units in one of the trace, names and endings of the columns, caption."""

_WRENCH: tuple[OnBothArms, ...] = (
    (
        Axis("force", "N"),
        1.0,
        (("x", "true_force_x"), ("z", "true_force_z")),
        "True force of the sheet on each gripper, along x (inward) and z (up) of that arm's "
        "bending frame. Shaded: every second phase.",
    ),
    (
        Axis("moment", "mN m"),
        1e3,
        (("", "true_moment_y"),),
        "True moment about each arm's bending axis, at the gripper's centre; positive turns the "
        "gripper towards a larger angle.",
    ),
)


def wrench_section(over_time: OverTime) -> Section:
    """Return the forces and moments on both arms over time."""
    return Section("Wrench on both arms", [panels_by_side(over_time, _WRENCH)])


def panels_by_side(over_time: OverTime, shown: Sequence[OnBothArms]) -> Panels:
    """Return plots over time of both arms beside each other."""
    return Panels(
        [
            over_time.figure(axis, over_time.curves_by_side(columns, factor), caption)
            for axis, factor, columns, caption in shown
        ]
    )


def deviation_section(over_time: OverTime) -> Section | None:
    """Return what the compliance added to the path; None where no arm complied."""
    for part in ("x", "alpha"):
        sides = [s for s in SIDES if np.nan_to_num(over_time.run[f"{s}_deviation_{part}"]).any()]
        if sides:
            break
    else:
        return None
    figures = []
    for axis, column in (
        (Axis("deviation along x", "mm"), "deviation_x"),
        (Axis("deviation of the angle", "mrad"), "deviation_alpha"),
    ):
        curves = over_time.curves_by_side([("", column)], 1e3, sides)
        figures.append(over_time.figure(axis, curves, f"{axis.label.capitalize()}."))
    return Section("Deviation by compliance", [Panels(figures)])


def phase_section(over_time: OverTime) -> Section:
    """Return the phases as bars over time and as a table."""
    found = over_time.phases
    if not found:
        return Section("Phases", ["The run has no cycle."])
    words = (f"{p.name} from {p.start_s:.1f} to {p.end_s:.1f} s" for p in found)
    picture = Figure(
        _lanes(over_time),
        "Phases over time; the plots over time are zoomed together.",
        f"Phases over time: {', '.join(words)}",
    )
    return Section("Phases", [picture, _phase_table(over_time.run, found)])


def _lanes(over_time: OverTime) -> Plot:
    """Return the phases as bars over time, a lane a name."""
    names = list(dict.fromkeys(phase.name for phase in over_time.phases))
    bars = [
        Bar(
            lane=phase.name,
            start=phase.start_s,
            end=phase.end_s,
            label=", ".join([phase.name, *(f"{name} {count}" for name, count in _counts(phase))]),
            colour=COLOURS[names.index(phase.name) % len(COLOURS)],
        )
        for phase in over_time.phases
    ]
    return Plot(x=over_time.axis, y=Axis("", ""), bars=bars, height_px=90 + 17 * len(names))


def _counts(phase: Phase) -> list[tuple[str, int]]:
    """Return which sheet and attempt a phase is of, counted from 1, where there are several."""
    pairs = (("sheet", phase.sheet), ("attempt", phase.attempt))
    return [(name, count + 1) for name, count in pairs if count is not None]


def _phase_table(run: RunRecord, found: list[Phase]) -> Table:
    peaks = [
        ("peak_moment_nm", 1e3, quantity("peak moment", "mN m")),
        ("peak_force_n", 1.0, quantity("peak force", "N")),
        ("peak_pin_force_n", 1.0, quantity("peak pin force", "N")),
    ]
    saved = run.summary.tables.get("phases", [])
    columns: list[Column | str] = ["phase", quantity("from", "s"), quantity("takes", "s")]
    columns += [quantity(name) for name, _ in _counts(found[0])]
    columns += [column for _, _, column in peaks] if saved else []
    rows = []
    for i, phase in enumerate(found):
        row: list[object] = [phase.name, phase.start_s, phase.end_s - phase.start_s]
        row += [count for _, count in _counts(phase)]
        if saved:
            known = saved[i] if i < len(saved) else {}
            row += [_scaled(known.get(name), factor) for name, factor, _ in peaks]
        rows.append(row)
    return Table(columns, rows, "Phases in the order in which they were run")


def _scaled(value: object, factor: float) -> object:
    return factor * value if isinstance(value, int | float) else value
