"""A run as a notebook shows it: how it ended, its moment over time, its metrics."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import replace

import numpy as np

from dualbend.report.figures import png_of
from dualbend.report.moment import is_bending, knots_of
from dualbend.report.over_time import OverTime
from dualbend.report.plot import Axis
from dualbend.report.section import Figure, Verdict, Warned
from dualbend.report.sections.tables import ended, metrics_table
from dualbend.report.template import render
from dualbend.run.record import RunRecord
from dualbend.types import Vector

_MOMENT = Axis("moment", "mN m")


def run_html(run: RunRecord) -> str:
    """Return a run as HTML that needs no file beside it: verdict, picture, table of metrics."""
    verdict = Verdict(ended(run), run.expected, run.summary.seed)
    figure = moment_over_time(run) if run.trace.rows else None
    return render(
        "notebook.html.j2",
        title=run.scenario.name,
        description=run.scenario.description,
        said=[verdict, *(Warned(warning) for warning in run.summary.warnings)],
        figure=figure,
        png="" if figure is None else b64encode(png_of(figure.plot)).decode(),
        metrics=metrics_table([run], ["value"], "Metrics; moments and forces are true ones"),
    )


def moment_over_time(run: RunRecord) -> Figure:
    """Return the moment on both grippers over time, with the phases and the path's pieces."""
    over_time, side = OverTime(run), run.sensing_side
    measured = over_time.curve(f"{side}_filtered_moment_y", f"{side}, filtered", "grey", 1e3)
    curves = over_time.curves_by_side([("", "true_moment_y")], 1e3)
    pieces = piece_starts(run)
    phases = ", ".join(dict.fromkeys(phase.name for phase in over_time.phases))
    caption = (
        f"True moment of the sheet on each gripper, and what the {side} sensor tells of it, "
        f"filtered. Shaded: every second phase ({phases})."
        + (" Lines: where a piece of the path ends." if pieces.size else "")
    )
    figure = over_time.figure(_MOMENT, [measured, *curves], caption)
    shown = replace(figure.plot, knots=pieces.tolist(), title=run.scenario.name)
    return Figure(shown, caption, figure.alt)


def piece_starts(run: RunRecord) -> Vector:
    """Return the times (n,) [s] at which the bending goes from a piece of the path to the next."""
    rows = is_bending(run)
    piece = np.searchsorted(knots_of(run.scenario)[1:-1], run["nominal_alpha"][rows], "right")
    return np.asarray(run["time"][rows][1:][np.diff(piece) != 0])
