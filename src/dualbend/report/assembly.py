"""Sections of an assembly: holes over pins, forces on the pins, the held sheet's compliance."""

from __future__ import annotations

import numpy as np

from dualbend.report.data import phases
from dualbend.report.html import Html, join, table
from dualbend.report.parts import Pictures, Section, note, number, side_by_side
from dualbend.report.plots import (
    BLUE,
    COLOURS,
    GREY,
    ORANGE,
    PURPLE,
    Axis,
    Curve,
    Plot,
    Range,
    Ranges,
    every_second,
)
from dualbend.report.time import TIME
from dualbend.run.record import RunRecord
from dualbend.scene.bed.config import HOLES

_TURN = np.linspace(0.0, 2.0 * np.pi, 73)
_NAMES = [hole.replace("_", " ") for hole in HOLES]
_LEAST_MM = 1e-4
"""Below this a distance is drawn as this: a logarithm has no zero."""


def holes_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section:
    """Return how the holes came over their pins, and where they lie."""
    time, bands = run["time"], phases(run)
    allowed = 0.5e3 * _clearance_m(run)
    away, high = [], []
    for hole, name, colour in zip(HOLES, _NAMES, COLOURS, strict=False):
        x, y, z = (1e3 * run[f"hole_{hole}_{axis}"] for axis in "xyz")
        distance = np.maximum(np.hypot(x, y), _LEAST_MM)
        away.append(Curve(name=name, x=time, y=distance, colour=colour))
        high.append(Curve(name=name, x=time, y=z, colour=colour))
    ranges = Ranges(x=shared)
    off = Axis(label="hole from its pin's axis", unit="mm", scale="log")
    up = Axis(label="hole above the bed", unit="mm")
    last = ", ".join(f"{c.name} {c.y[-1]:.3g}" for c in away)
    figures = side_by_side(
        pictures.add(
            Plot(
                curves=away,
                x=TIME,
                y=off,
                ranges=ranges,
                bands=every_second(bands),
                levels=[allowed],
            ),
            f"Distance of each hole's centre from its pin's axis. The line is half the clearance, "
            f"{allowed:.3g} mm: below it the hole is over its pin.",
            f"Distance of the holes from their pins over time, at the end in mm: {last}",
        ),
        pictures.add(
            Plot(
                curves=high,
                x=TIME,
                y=up,
                ranges=ranges,
                bands=every_second(bands),
                levels=[_pin_height_mm(run)],
            ),
            "Height of the sheet's lower face at each hole; the line is the pins' tip.",
            "Height of the holes above the bed over time, at the end in mm: "
            + ", ".join(f"{c.name} {c.y[-1]:.3g}" for c in high),
        ),
    )
    return Section(title="Holes over pins", body=join([figures, _final(run, pictures, allowed)]))


def _clearance_m(run: RunRecord) -> float:
    assert run.scenario.assembly is not None
    return run.scenario.assembly.layout.holes.clearance_m


def _pin_height_mm(run: RunRecord) -> float:
    assert run.scenario.assembly is not None
    return 1e3 * run.scenario.assembly.layout.pins.height_m


def _final(run: RunRecord, pictures: Pictures, allowed_mm: float) -> Html:
    """Return where the holes lie at the end, as a picture and as a table."""
    holes = run.summary.tables.get("holes", [])
    if not holes:
        return note("The run left no final places of its holes.")
    circle = Curve(
        name="half the clearance",
        x=1e3 * allowed_mm * np.cos(_TURN),
        y=1e3 * allowed_mm * np.sin(_TURN),
        colour=GREY,
    )
    curves = [circle]
    for hole, name, colour in zip(HOLES, _NAMES, COLOURS, strict=False):
        of = [row for row in holes if row.get("hole") == hole]
        x, y = (
            np.array([1e6 * _float(row.get(f"offset_{axis}_m")) for row in of]) for axis in "xy"
        )
        curves.append(Curve(name=name, x=x, y=y, colour=colour, marker="circle_cross"))
    drawn = Plot(
        curves=curves,
        x=Axis(label="along x", unit="µm"),
        y=Axis(label="along y", unit="µm"),
        true_to_scale=True,
        height_px=420,
    )
    seated = sum(bool(row.get("seated")) for row in holes)
    picture = pictures.add(
        drawn,
        "Centres of the holes from their pins' axes at the end, every sheet. Inside the circle a "
        "hole goes over its pin.",
        f"Final places of {len(holes)} holes: {seated} seated",
    )
    rows = [
        (
            f"{number(row.get('hole')).replace('_', ' ')}, sheet {_count(row.get('sheet'))}",
            number(1e6 * _float(row.get("offset_m"))),
            number(1e6 * _float(row.get("height_m"))),
            number(row.get("seated")),
        )
        for row in holes
    ]
    head = ("hole", "off its pin's axis [µm]", "above its rest [µm]", "seated")
    return join([picture, table("Holes at the end of the run", head, rows, numeric=(1, 2))])


def pins_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section:
    """Return the forces on pins and hole edges over time and their peaks."""
    time, bands, ranges = run["time"], phases(run), Ranges(x=shared)
    figures = []
    for kind, words in (("pin", "each pin"), ("edge", "one contact at each hole's edge")):
        curves = [
            Curve(name=name, x=time, y=run[f"{kind}_force_{hole}"], colour=colour)
            for hole, name, colour in zip(HOLES, _NAMES, COLOURS, strict=False)
        ]
        largest = max((float(np.nanmax(c.y, initial=0.0)) for c in curves), default=0.0)
        axis = Axis(label=f"{kind} force", unit="N")
        drawn = Plot(curves=curves, x=TIME, y=axis, ranges=ranges, bands=every_second(bands))
        caption = f"Force on {words}, the largest of every physics step since the row before."
        alt = f"Force on {words} over time, at most {largest:.3g} N"
        figures.append(pictures.add(drawn, caption, alt))
    rows = [
        (
            number(row.get("pin")).replace("_", " "),
            number(row.get("peak_force_n")),
            number(row.get("peak_edge_force_n")),
        )
        for row in run.summary.tables.get("pins", [])
    ]
    head = ("pin", "peak force [N]", "peak force of one contact [N]")
    peaks = table("Peak forces on the pins", head, rows, (1, 2)) if rows else Html("")
    return Section(title="Forces on the pins", body=join([side_by_side(*figures), peaks]))


def object_section(run: RunRecord, pictures: Pictures, shared: Range) -> Section | None:
    """Return what the held sheet's compliance gave; None where there is none."""
    assembly = run.scenario.assembly
    if assembly is None or assembly.compliance is None:
        return None
    time, ranges, bands = run["time"], Ranges(x=shared), phases(run)
    figures = []
    for parts, unit, factor in ((("x", "y"), "mm", 1e3), (("yaw",), "mrad", 1e3)):
        curves = [
            Curve(name=part, x=time, y=factor * run[f"object_deviation_{part}"], colour=colour)
            for part, colour in zip(
                parts, (BLUE, ORANGE) if len(parts) > 1 else (PURPLE,), strict=True
            )
        ]
        label = "place" if len(parts) > 1 else "turn"
        drawn = Plot(
            curves=curves,
            x=TIME,
            y=Axis(label=label, unit=unit),
            ranges=ranges,
            bands=every_second(bands),
        )
        largest = max(float(np.nanmax(np.abs(c.y), initial=0.0)) for c in curves)
        alt = f"Deviation of {label} over time, at most {largest:.3g} {unit}"
        figures.append(pictures.add(drawn, f"Deviation of the held sheet: {label}.", alt))
    return Section(title="What the held sheet's compliance gave", body=side_by_side(*figures))


def _float(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _count(value: object) -> str:
    return str(int(value) + 1) if isinstance(value, int | float) else "–"
