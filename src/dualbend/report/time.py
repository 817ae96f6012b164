"""Sections over time: the wrench on both arms, what the compliance gave, the phases."""

from __future__ import annotations

import numpy as np

from dualbend.report.data import Phase, phases
from dualbend.report.html import join, table
from dualbend.report.parts import Pictures, Section, note, number, side_by_side
from dualbend.report.plots import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    Axis,
    Curve,
    Plot,
    Range,
    Ranges,
    common,
    every_second,
    phase_lanes,
)
from dualbend.run.record import RunRecord
from dualbend.types import SIDES, Vector

TIME = Axis(label="time", unit="s")

_WIDTHS = (3.2, 1.4)
"""Left and right: where both are equal, the second is seen on the first."""


def time_range(run: RunRecord) -> Range:
    """Return the range that a run's plots over time share."""
    return common([run["time"]], margin=0.01)


def wrench_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section:
    """Return the forces and moments on both arms over time."""
    bands, time = phases(run), run["time"]
    looks = ((BLUE, ORANGE), (GREEN, PURPLE))
    force = [
        Curve(
            name=f"{side} {axis}",
            x=time,
            y=run[f"{side}_true_force_{axis}"],
            colour=colour,
            width=w,
        )
        for side, w, pair in zip(SIDES, _WIDTHS, looks, strict=True)
        for axis, colour in zip("xz", pair, strict=True)
    ]
    moment = [
        Curve(name=side, x=time, y=1e3 * run[f"{side}_true_moment_y"], colour=pair[0], width=w)
        for side, w, pair in zip(SIDES, _WIDTHS, looks, strict=True)
    ]
    ranges = Ranges(x=shared)
    figures = []
    for name, unit, curves in (("force", "N", force), ("moment", "mN m", moment)):
        drawn = Plot(
            curves=curves,
            x=TIME,
            y=Axis(label=name, unit=unit),
            ranges=ranges,
            bands=every_second(bands),
        )
        words = "; ".join(f"{c.name}: {_span(c.y)} {unit}" for c in curves)
        figures.append(pictures.add(drawn, _WRENCH_CAPTIONS[name], f"{name} over time. {words}"))
    return Section(title="Wrench on both arms", body=side_by_side(*figures))


_WRENCH_CAPTIONS = {
    "force": "True force of the sheet on each gripper, along x (inward) and z (up) of that arm's "
    "bending frame. Shaded: every second phase.",
    "moment": "True moment about each arm's bending axis, at the gripper's centre; positive turns "
    "the gripper towards a larger angle.",
}


def misalignment_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section | None:
    """Return what misaligned grips feel out of the bending plane; None where none is misaligned."""
    if run.scenario.misalignment is None:
        return None
    bands, time = phases(run), run["time"]
    figures = []
    for name, unit, factor, columns, caption in _OUT_OF_PLANE:
        curves = [
            Curve(
                name=f"{side} {label}",
                x=time,
                y=factor * run[f"{side}_true_{column}"],
                colour=colour,
                width=w,
            )
            for side, w, pair in zip(SIDES, _WIDTHS, ((BLUE, ORANGE), (GREEN, PURPLE)), strict=True)
            for (label, column), colour in zip(columns, pair, strict=False)
        ]
        axis = Axis(label=name, unit=unit)
        drawn = Plot(
            curves=curves, x=TIME, y=axis, ranges=Ranges(x=shared), bands=every_second(bands)
        )
        words = "; ".join(f"{c.name}: {_span(c.y)} {unit}" for c in curves)
        figures.append(pictures.add(drawn, caption, f"{name} over time. {words}"))
    return Section(title="Misaligned grips", body=side_by_side(*figures))


_OUT_OF_PLANE = (
    (
        "lateral force",
        "N",
        1.0,
        (("across", "force_y"),),
        "True force across the sheet on each gripper, along y of that arm's bending frame. "
        "Shaded: every second phase.",
    ),
    (
        "moment out of the plane",
        "mN m",
        1e3,
        (("about x (twist)", "moment_x"), ("about z (yaw)", "moment_z")),
        "True moment on each gripper about x (inward: it twists the sheet) and z (up) of that "
        "arm's bending frame, at the gripper's centre.",
    ),
)


def _span(values: Vector) -> str:
    finite = values[np.isfinite(values)]
    return f"{finite.min():.3g} to {finite.max():.3g}" if finite.size else "none"


def deviation_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section | None:
    """Return what the compliance added to the path; None where no arm complied."""
    sides = [side for side in SIDES if np.nan_to_num(run[f"{side}_deviation_x"]).any()]
    sides = sides or [s for s in SIDES if np.nan_to_num(run[f"{s}_deviation_alpha"]).any()]
    if not sides:
        return None
    time, bands, ranges = run["time"], phases(run), Ranges(x=shared)
    figures = []
    for part, label, unit, factor in (
        ("x", "deviation along x", "mm", 1e3),
        ("alpha", "deviation of the angle", "mrad", 1e3),
    ):
        curves = [
            Curve(name=side, x=time, y=factor * run[f"{side}_deviation_{part}"], colour=colour)
            for side, colour in zip(sides, (BLUE, GREEN), strict=False)
        ]
        drawn = Plot(
            curves=curves,
            x=TIME,
            y=Axis(label=label, unit=unit),
            ranges=ranges,
            bands=every_second(bands),
        )
        words = "; ".join(f"{c.name}: {_span(c.y)} {unit}" for c in curves)
        figures.append(pictures.add(drawn, f"{label.capitalize()}.", f"{label}. {words}"))
    return Section(title="What the compliance gave", body=side_by_side(*figures))


def phase_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section:
    """Return the phases as bars over time and as a table."""
    found = phases(run)
    if not found:
        return Section(title="Phases", body=note("The run has no cycle."))
    drawn = phase_lanes(found, shared)
    alt = "Phases over time: " + ", ".join(
        f"{p.name} from {p.start_s:.1f} to {p.end_s:.1f} s" for p in found
    )
    picture = pictures.add(drawn, "Phases over time; the plots over time are zoomed together.", alt)
    return Section(title="Phases", body=join([picture, _phase_table(run, found)]))


def _phase_table(run: RunRecord, found: list[Phase]) -> str:
    several = run.scenario.assembly is not None
    peaks = [("peak_moment_nm", 1e3), ("peak_force_n", 1.0), ("peak_pin_force_n", 1.0)]
    head = ["phase", "from [s]", "takes [s]"]
    saved = run.summary.tables.get("phases", []) if several else []
    if several:
        head += ["sheet", "attempt"]
    if saved:
        head += ["peak moment [mN m]", "peak force [N]", "peak pin force [N]"]
    rows = []
    for i, phase in enumerate(found):
        row = [phase.name, number(phase.start_s), number(phase.end_s - phase.start_s)]
        if several:
            row += [str(phase.sheet + 1), str(phase.attempt + 1)]
        if saved:
            known = saved[i] if i < len(saved) else {}
            row += [_scaled(known.get(name), factor) for name, factor in peaks]
        rows.append(row)
    return table("Phases in the order in which they were run", head, rows, range(1, len(head)))


def _scaled(value: object, factor: float) -> str:
    return number(factor * value if isinstance(value, int | float) else value)
