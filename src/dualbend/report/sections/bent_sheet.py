"""Sections on a sheet that is bent between two grips: the moment, the path, the shape."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dualbend.beam import elastica
from dualbend.evaluation.sheet import no_theory
from dualbend.report.moment import (
    ANGLE,
    bending_rows,
    describe_peak,
    knots_of,
    moment_curves,
    moment_plot,
    reference_at_ends,
)
from dualbend.report.plot import COLOURS, Axis, Curve, Plot
from dualbend.report.section import Figure, Panels, Section
from dualbend.report.shape import Shape, has_shape, shapes
from dualbend.run.record import RunRecord
from dualbend.table import Table, quantity

_REFERENCE = (
    "The reference solution is the rod with weight: between grips that follow the nominal path "
    "exactly and do not comply, and where the sheet's ends really were."
)
_SIMULATED = {
    "strips": "the simulated strips",
    "shell": "the simulated plate along its mid-line",
}
_NOT_BENT = "The run ended before it bent the sheet."


def moment_section(run: RunRecord) -> Section:
    """Return the paper's figure of the run with the reference solution's moment."""
    title = "Moment over bending angle"
    if not bending_rows(run).size:
        return Section(title, [_NOT_BENT])
    without = no_theory(run.scenario)
    curves = moment_curves(run) if without else [*moment_curves(run), reference_at_ends(run)]
    caption = (
        f"Moment on the {run.sensing_side} gripper about the bending axis. Raw and filtered: the "
        "sensor's reading, moved to the gripper's centre, before and after the low-pass; true: "
        f"what the sheet exerts. {without or _REFERENCE} Vertical lines: the path's knots."
    )
    alt = "Moment over bending angle. " + "; ".join(describe_peak(curve) for curve in curves)
    return Section(title, [Figure(moment_plot(curves, knots_of(run.scenario)), caption, alt)])


def path_section(run: RunRecord) -> Section:
    """Return half distance and height over the angle: exact, nominal with knots, recorded."""
    title, rows = "Path", bending_rows(run)
    if not rows.size:
        return Section(title, [_NOT_BENT])
    length, knots = run.scenario.sheet.length_m, np.array(knots_of(run.scenario))
    path = run.scenario.path.make(length)
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
            Curve("exact path", grid, 1e3 * exact[i], colour="green", width=3.0),
            Curve("nominal", grid, 1e3 * nominal[i], colour="orange"),
            Curve("recorded", slope, 1e3 * recorded, dash="dashed"),
            Curve("knots", knots, 1e3 * at_knots[i], colour="orange", marker="circle_dot"),
        ]
        alt = f"{name} over angle: {1e3 * nominal[i][0]:.1f} to {1e3 * nominal[i][-1]:.1f} mm"
        drawn = Plot(curves=curves, x=ANGLE, y=Axis(name, "mm"), height_px=300)
        figures.append(Figure(drawn, f"{name.capitalize()} of the grips.", alt))
    within = np.clip(slope, 0.0, elastica.END_SLOPE_GRIPPERS_MEET)
    off = 1e3 * (half - elastica.half_distance(within, length))
    wanted = 1e3 * (nominal[0] - exact[0])
    difference = Plot(
        curves=[Curve("nominal", grid, wanted, colour="orange"), Curve("recorded", slope, off)],
        x=ANGLE,
        y=Axis("half distance off", "mm"),
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
    return Section(title, [Panels(figures), Figure(difference, caption, alt)])


def shape_section(run: RunRecord) -> Section:
    """Return the sheet at several angles against the elastica, and the distances as a table."""
    title = "Shape of the sheet"
    if not has_shape(run):
        return Section(
            title, ["The trace holds no shape: the run is of a version that did not keep it."]
        )
    found = shapes(run)
    if not found:
        return Section(title, [_NOT_BENT])
    curves = []
    for shape, colour in zip(found, COLOURS, strict=False):
        (x, z), (in_theory_x, in_theory_z) = 1e3 * shape.points_m, 1e3 * shape.elastica_m
        curves += [
            Curve("", in_theory_x, in_theory_z, colour="grey", width=6.0, opacity=0.4),
            Curve(f"{shape.alpha_rad:.2f} rad", x, z, colour),
        ]
    simulated = _SIMULATED[run.scenario.sheet.model.kind]
    caption = (
        f"Side view, x and z not on one scale. Coloured: {simulated}; "
        "broad and grey: the zero-moment elastica of the sheet's own end slope. The arms lag "
        "behind the nominal angle, which names each shape."
    )
    elastic = not no_theory(run.scenario)
    if not elastic:
        caption += " The sheet may yield, the elastica does not: it is drawn to be compared with."
    worst = max(1e3 * shape.off_elastica_m for shape in found)
    alt = f"{len(found)} shapes of the sheet; within {worst:.2f} mm of the elastica"
    drawn = Plot(curves=curves, x=Axis("x", "mm"), y=Axis("z from the ends", "mm"))
    return Section(title, [Figure(drawn, caption, alt), _distances(found, elastic=elastic)])


def _distances(found: Sequence[Shape], *, elastic: bool) -> Table:
    columns = [
        *(quantity("nominal angle", "rad"), quantity("end slope", "rad"), quantity("time", "s")),
        *(quantity(f"off the {name}", "mm", ".3g") for name in ("elastica", "rod with weight")),
    ]
    rows: list[tuple[float | str, ...]] = [
        (
            *(shape.alpha_rad, shape.slope_rad, shape.time_s, 1e3 * shape.off_elastica_m),
            "not found" if np.isnan(shape.off_rod_m) else 1e3 * shape.off_rod_m,
        )
        for shape in found
    ]
    if not elastic:  # a sheet that may yield has no rod
        columns, rows = columns[:-1], [row[:-1] for row in rows]
    return Table(columns, rows, "Largest distance of the sheet from theory")
