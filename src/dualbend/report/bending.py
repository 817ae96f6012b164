"""Sections of a bending run: the paper's figure, the path, the shape of the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from dualbend.beam import elastica
from dualbend.evaluation.sheet import no_theory
from dualbend.report.data import (
    Line,
    Shape,
    bending_rows,
    has_shape,
    nominal_lines,
    oracle_at_edges,
    shapes,
)
from dualbend.report.html import Html, join, table
from dualbend.report.parts import Pictures, Section, note, number, side_by_side
from dualbend.report.plots import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    Axis,
    Curve,
    Plot,
    Ranges,
)
from dualbend.run.record import RunRecord
from dualbend.scenario.path import make_path

ANGLE = Axis(label="bending angle α", unit="rad")
MOMENT = Axis(label="moment", unit="mN m")

_LOOKS: dict[str, tuple[str, float, Literal["solid", "dashed", "dotted"]]] = {
    "raw": (GREY, 0.8, "solid"),
    "filtered": (ORANGE, 1.2, "solid"),
    "true": (BLUE, 2.2, "solid"),
    "oracle, nominal": (GREEN, 1.4, "dashed"),
    "oracle, recorded": (PURPLE, 1.4, "dotted"),
}
_ORACLE = (
    "The oracle is the rod with weight: between grips that follow the nominal path exactly and do "
    "not comply, and where the sheet's ends really were."
)
_PALE = "#94a3b866"
_SIMULATED = {
    "strips": "the simulated strips",
    "shell": "the simulated plate along its mid-line",
}
_NOT_BENT = "The run ended before it bent the sheet."


def knots_of(run: RunRecord) -> list[float]:
    """Return the end slopes where the pieces of the run's path meet [rad]."""
    knots: list[float] = make_path(run.scenario.path, run.scenario.sheet.length_m).knots.tolist()
    return knots


def moment_plot(
    lines: Sequence[Line], run: RunRecord, ranges: Ranges | None = None, title: str = ""
) -> Plot:
    """Return the paper's figure: moment over bending angle, with the path's knots."""
    curves = [
        Curve(name=line.name, x=line.x, y=line.y, colour=colour, width=width, dash=dash)
        for line in lines
        for colour, width, dash in [_LOOKS[line.name]]
    ]
    return Plot(
        curves=curves,
        x=ANGLE,
        y=MOMENT,
        ranges=ranges or Ranges(),
        knots=knots_of(run),
        levels=[0.0],
        title=title,
    )


def describe_peak(line: Line) -> str:
    """Return where a line's largest size is, in words."""
    if not np.isfinite(line.y).any():
        return f"{line.name}: nothing recorded"
    at = int(np.nanargmax(np.abs(line.y)))
    return f"{line.name}: at most {abs(line.y[at]):.1f} mN m, at {line.x[at]:.2f} rad"


def moment_section(run: RunRecord, pictures: Pictures) -> Section:
    """Return the paper's figure of the run with the oracle's prediction."""
    title = "Moment over bending angle"
    if not bending_rows(run).size:
        return Section(title=title, body=note(_NOT_BENT))
    without = no_theory(run.scenario)
    lines = nominal_lines(run) if without else [*nominal_lines(run), oracle_at_edges(run)]
    caption = (
        f"Moment on the {run.sensing_side} gripper about the bending axis. Raw and filtered: the "
        "sensor's reading, moved to the gripper's centre, before and after the low-pass; true: "
        f"what the sheet exerts. {without or _ORACLE} Vertical lines: the path's knots."
    )
    alt = "Moment over bending angle. " + "; ".join(describe_peak(line) for line in lines)
    return Section(title=title, body=pictures.add(moment_plot(lines, run), caption, alt))


def path_section(run: RunRecord, pictures: Pictures) -> Section:
    """Return half distance and height over the angle: exact, nominal with knots, recorded."""
    title, rows = "Path", bending_rows(run)
    if not rows.size:
        return Section(title=title, body=note(_NOT_BENT))
    length, knots = run.scenario.sheet.length_m, np.array(knots_of(run))
    path = make_path(run.scenario.path, length)
    grid = np.union1d(np.linspace(knots[0], knots[-1], 200), knots)
    exact = np.stack([elastica.half_distance(grid, length), elastica.rise(grid, length)])
    nominal = np.stack(path.at(grid))
    slope = 0.5 * (run["left_grip_alpha"][rows] + run["right_grip_alpha"][rows])
    half = -0.5 * (run["left_grip_x"][rows] + run["right_grip_x"][rows])
    level = float(run["nominal_z"][rows[0]]) - float(path.at(run["nominal_alpha"][rows[0]])[1])
    rise = 0.5 * (run["left_grip_z"][rows] + run["right_grip_z"][rows]) - level
    at_knots = np.stack(path.at(knots))
    figures = []
    for i, (name, recorded) in enumerate((("half distance", half), ("height", rise))):
        curves = [
            Curve(name="exact path", x=grid, y=1e3 * exact[i], colour=GREEN, width=3.0),
            Curve(name="nominal", x=grid, y=1e3 * nominal[i], colour=ORANGE),
            Curve(name="recorded", x=slope, y=1e3 * recorded, colour=BLUE, dash="dashed"),
            Curve(name="knots", x=knots, y=1e3 * at_knots[i], colour=ORANGE, marker="circle_dot"),
        ]
        alt = f"{name} over angle: {1e3 * nominal[i][0]:.1f} to {1e3 * nominal[i][-1]:.1f} mm"
        drawn = Plot(curves=curves, x=ANGLE, y=Axis(label=name, unit="mm"), height_px=300)
        figures.append(pictures.add(drawn, f"{name.capitalize()} of the grips.", alt))
    within = np.clip(slope, 0.0, elastica.END_SLOPE_GRIPPERS_MEET)
    off = 1e3 * (half - elastica.half_distance(within, length))
    wanted = 1e3 * (nominal[0] - exact[0])
    curves = [
        Curve(name="nominal", x=grid, y=wanted, colour=ORANGE),
        Curve(name="recorded", x=slope, y=off, colour=BLUE),
    ]
    difference = Plot(
        curves=curves,
        x=ANGLE,
        y=Axis(label="half distance off", unit="mm"),
        knots=knots.tolist(),
        levels=[0.0],
    )
    caption = (
        "Half distance less that of the exact path at the same angle, for the recorded one at the "
        "grips' own mean angle. This difference is what bends the sheet's ends: 0 is no moment."
    )
    alt = (
        f"Half distance off the exact path: nominal up to {np.abs(wanted).max():.3f} mm, recorded "
        f"up to {np.abs(off).max():.3f} mm"
    )
    return Section(
        title=title,
        body=join([side_by_side(*figures), pictures.add(difference, caption, alt)]),
    )


def shape_section(run: RunRecord, pictures: Pictures) -> Section:
    """Return the sheet at several angles against the elastica, and the distances as a table."""
    title = "Shape of the sheet"
    if not has_shape(run):
        text = "The trace holds no shape: the run is of a version that did not keep it."
        return Section(title=title, body=note(text))
    found = shapes(run)
    if not found:
        return Section(title=title, body=note(_NOT_BENT))
    curves = []
    for i, shape in enumerate(found):
        colour = COLOURS[i % len(COLOURS)]
        name = f"{shape.alpha_rad:.2f} rad"
        theory = 1e3 * shape.elastica_x_m, 1e3 * shape.elastica_z_m
        curves += [
            Curve(name="", x=theory[0], y=theory[1], colour=_PALE, width=6.0),
            Curve(name=name, x=1e3 * shape.x_m, y=1e3 * shape.z_m, colour=colour, width=1.6),
        ]
    axes = (Axis(label="x", unit="mm"), Axis(label="z from the ends", unit="mm"))
    model = _SIMULATED[run.scenario.sheet.model]
    caption = (
        f"Side view, x and z not on one scale. Coloured: {model}; broad and grey: the "
        "zero-moment elastica of the sheet's own end slope. The arms lag behind the nominal angle, "
        "which names each shape."
    )
    elastic = not no_theory(run.scenario)
    if not elastic:
        caption += " The sheet may yield, the elastica does not: it is drawn to be compared with."
    worst = max(1e3 * shape.off_elastica_m for shape in found)
    alt = f"{len(found)} shapes of the sheet; within {worst:.2f} mm of the elastica"
    return Section(
        title=title,
        body=join(
            [
                pictures.add(Plot(curves=curves, x=axes[0], y=axes[1]), caption, alt),
                _distances(found, elastic=elastic),
            ]
        ),
    )


def _distances(found: Sequence[Shape], *, elastic: bool) -> Html:
    rows = [
        (
            number(shape.alpha_rad),
            number(shape.slope_rad),
            number(shape.time_s),
            number(1e3 * shape.off_elastica_m, 3),
            "not found" if np.isnan(shape.off_rod_m) else number(1e3 * shape.off_rod_m, 3),
        )
        for shape in found
    ]
    head = (
        *("nominal angle [rad]", "end slope [rad]", "time [s]"),
        *("off the elastica [mm]", "off the rod with weight [mm]"),
    )
    # Of a sheet that may yield there is no rod.
    columns = len(head) if elastic else len(head) - 1
    shown = [row[:columns] for row in rows]
    caption = "Largest distance of the sheet from theory"
    return table(caption, head[:columns], shown, numeric=range(columns))
