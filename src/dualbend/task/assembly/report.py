"""The report of an assembly: holes over pins, forces on the pins, the held sheet's compliance."""

from __future__ import annotations

from itertools import cycle

import numpy as np

from dualbend.report.over_time import OverTime
from dualbend.report.plot import COLOURS, Axis, Colour, Curve, Plot
from dualbend.report.section import Block, Figure, Panels, Section
from dualbend.report.sections.bent_sheet import moment_section, path_section, shape_section
from dualbend.report.sections.tables import metrics_section
from dualbend.report.sections.time import phase_section, wrench_section
from dualbend.run.record import RunRecord
from dualbend.table import Columns, Table, quantity
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.metrics import holes_of

_TURN = np.linspace(0.0, 2.0 * np.pi, 73)
_OBJECT_COLOURS: tuple[Colour, ...] = ("blue", "orange", "purple")

_SMALLEST_MM = 1e-4
"""Below this a distance is drawn as this: a logarithm has no zero."""


def sections_of(run: RunRecord) -> list[Section | None]:
    """Return the sections of an assembly; None where it has not what one would show."""
    over_time = OverTime(run)
    return [
        holes_section(over_time),
        sheets_section(run),
        metrics_section([run], ["value"], "over all phases"),
        pins_section(over_time),
        phase_section(over_time),
        wrench_section(over_time),
        object_section(over_time),
        moment_section(run),
        path_section(run),
        shape_section(run),
    ]


def holes_section(over_time: OverTime) -> Section:
    """Return how the holes came over their pins, and where they lie."""
    run, layout = over_time.run, assembly_of(over_time.run.scenario).layout
    allowed = 0.5e3 * layout.holes.clearance_m
    away, high = [], []
    for hole, name, colour in _holes(run):
        x, y, z = (1e3 * run[f"hole_{hole}_{axis}"] for axis in "xyz")
        distance = np.maximum(np.hypot(x, y), _SMALLEST_MM)
        away.append(Curve(name=name, x=run["time"], y=distance, colour=colour))
        high.append(Curve(name=name, x=run["time"], y=z, colour=colour))
    figures = [
        over_time.figure(
            Axis("hole from its pin's axis", "mm", scale="log"),
            away,
            "Distance of each hole's centre from its pin's axis. The line is half the clearance, "
            f"{allowed:.3g} mm: below it the hole is over its pin.",
            f"Distance of the holes from their pins over time, at the end in mm: {_last(away)}",
            levels=[allowed],
        ),
        over_time.figure(
            Axis("hole above the bed", "mm"),
            high,
            "Height of the sheet's lower face at each hole; the line is the pins' tip.",
            f"Height of the holes above the bed over time, at the end in mm: {_last(high)}",
            levels=[1e3 * layout.pins.height_m],
        ),
    ]
    return Section("Holes over pins", [Panels(figures), *_final(run, allowed)])


def _holes(run: RunRecord) -> list[tuple[str, str, Colour]]:
    """Return each hole's name, that in words, and its colour."""
    return [(h, _name(h), c) for h, c in zip(holes_of(run), cycle(COLOURS), strict=False)]


def _last(curves: list[Curve]) -> str:
    return ", ".join(f"{curve.name} {curve.y[-1]:.3g}" for curve in curves)


def _final(run: RunRecord, allowed_mm: float) -> list[Block]:
    """Return where the holes lie at the end, as a picture and as a table."""
    holes = run.summary.tables.get("holes", [])
    if not holes:
        return ["The run left no final places of its holes."]
    x, y = 1e3 * allowed_mm * np.cos(_TURN), 1e3 * allowed_mm * np.sin(_TURN)
    curves = [Curve(name="half the clearance", x=x, y=y, colour="grey")]
    for hole, name, colour in _holes(run):
        of = [row for row in holes if row.get("hole") == hole]
        x, y = 1e6 * np.array(
            [[_float(row.get(f"offset_{axis}_m")) for row in of] for axis in "xy"]
        )
        curves.append(Curve(name=name, x=x, y=y, colour=colour, marker="circle_cross"))
    x_axis, y_axis = (Axis(f"along {axis}", "µm") for axis in "xy")
    drawn = Plot(curves=curves, x=x_axis, y=y_axis, true_to_scale=True, height_px=420)
    seated = sum(bool(row.get("seated")) for row in holes)
    picture = Figure(
        drawn,
        "Centres of the holes from their pins' axes at the end, every sheet. Inside the circle a "
        "hole goes over its pin.",
        f"Final places of {len(holes)} holes: {seated} seated",
    )
    rows = [
        (
            f"{_name(row.get('hole'))}, sheet {_count(row.get('sheet'))}",
            1e6 * _float(row.get("offset_m")),
            1e6 * _float(row.get("height_m")),
            row.get("seated"),
        )
        for row in holes
    ]
    columns: Columns = [
        *("hole", quantity("off its pin's axis", "µm"), quantity("above its rest", "µm"), "seated")
    ]
    return [picture, Table(columns, rows, "Holes at the end of the run")]


_LEARNED = (
    *(
        (f"{which}_{axis}_m", f"{said} {axis}", "mm", 1e3)
        for which, said in (("start", "begun at"), ("found", "found at"))
        for axis in "xy"
    ),
    ("found_yaw_rad", "turned", "mrad", 1e3),
    ("found_height_m", "raised", "mm", 1e3),
    ("found_left_level_m", "raised left", "mm", 1e3),
    ("found_right_level_m", "raised right", "mm", 1e3),
)
"""Columns of the summary's sheets that only one of which something was found has."""


def sheets_section(run: RunRecord) -> Section | None:
    """Return how each sheet of a stack went, and what was learned with it; None of one sheet."""
    sheets = run.summary.tables.get("sheets", [])
    if len(sheets) < 2:
        return None
    rows = [
        (
            _count(row.get("sheet")),
            row.get("retries"),
            row.get("time_s"),
            row.get("peak_pin_force_n"),
            *(by * _float(row[key]) if key in row else None for key, _, _, by in _LEARNED),
            row.get("learned"),
        )
        for row in sheets
    ]
    columns: Columns = [
        *("sheet", quantity("retries"), quantity("time", "s"), quantity("peak pin force", "N")),
        *(quantity(said, unit) for _, said, unit, _ in _LEARNED),
        "learned from",
    ]
    caption = (
        "Each sheet: lowered again so often, and where the grips' middle was over that of the pins "
        "when it was lowered first and when it was found seated."
    )
    return Section("Sheet by sheet", [Table(columns, rows, caption)])


def pins_section(over_time: OverTime) -> Section:
    """Return the forces on pins and hole edges over time and their peaks."""
    figures = [
        over_time.figure(
            Axis(f"{kind} force", "N"),
            [
                over_time.curve(f"{kind}_force_{hole}", name, colour)
                for hole, name, colour in _holes(over_time.run)
            ],
            f"Force on {words}, the largest of every physics step since the row before.",
        )
        for kind, words in (("pin", "each pin"), ("edge", "one contact at each hole's edge"))
    ]
    rows = [
        (_name(row.get("pin")), row.get("peak_force_n"), row.get("peak_edge_force_n"))
        for row in over_time.run.summary.tables.get("pins", [])
    ]
    peaks = [quantity(f"peak force{of}", "N") for of in ("", " of one contact")]
    table = [Table(["pin", *peaks], rows, "Peak forces on the pins")] if rows else []
    return Section("Forces on the pins", [Panels(figures), *table])


def object_section(over_time: OverTime) -> Section | None:
    """Return the deviation of the held sheet by its compliance; None where there is none."""
    if assembly_of(over_time.run.scenario).compliance is None:
        return None
    x, y, yaw = (
        over_time.curve(f"object_deviation_{part}", part, colour, 1e3)
        for part, colour in zip(("x", "y", "yaw"), _OBJECT_COLOURS, strict=True)
    )
    figures = [
        over_time.figure(
            Axis(f"deviation of {what}", unit), curves, f"Deviation of {what} of the held sheet."
        )
        for what, unit, curves in (("place", "mm", [x, y]), ("turn", "mrad", [yaw]))
    ]
    return Section("Deviation by the held sheet's compliance", [Panels(figures)])


def _name(value: object) -> str:
    return str(value).replace("_", " ")


def _float(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _count(value: object) -> str:
    return str(int(value) + 1) if isinstance(value, int | float) else "–"
