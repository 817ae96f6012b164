"""Plots drawn by matplotlib: a run's moment, two runs' moments, stability maps, as PNG."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from dualbend.errors import writing
from dualbend.files import whole_file
from dualbend.report.canvas import Axes, Figure, FigureBase, Outline, PathPatch, mpl, own_style
from dualbend.report.moment import is_bending, knots_of, moment_plot, recorded_moments
from dualbend.report.plot import COLOURS, LEFT_RIGHT, Axis, Colour, Curve, Plot
from dualbend.report.sections.tables import ended
from dualbend.report.stability_map import stability_panel
from dualbend.run.record import RunRecord
from dualbend.stability.map import Panel

PALETTE: dict[Colour, Any] = {
    **{name: f"tab:{name}" for name in ("blue", "orange", "green", "purple", "red")},
    "grey": "0.75",
}
ANGLE = Axis("bending angle α, nominal", "rad")

_BESIDE = 55
"""Letters of a title that leaves room for a line at its right."""

_SIZE = (9.0, 5.0)
_DPI = 120
_WIDTH = 0.85
"""Points a unit of a curve's width, which is a pixel on a page."""
_MARKERS = {None: "", "star": "*", "circle_dot": "o", "circle_cross": "o"}


def save(
    figure: Figure,
    path: Path,
    option: str = "",
    **options: Any,  # noqa: ANN401 - matplotlib's own
) -> None:
    """Write a picture; InputError, which names the path's ``option``, where that fails."""
    with writing(path, option, also=ValueError), whole_file(path) as part:
        figure.savefig(part, dpi=_DPI, **options)


def draw(axes: Axes, shown: Plot, palette: Mapping[Colour, Any] = PALETTE) -> None:
    """Draw a plot as it is described; its legend is :func:`legend_below`'s."""
    for left, right in shown.bands:
        axes.axvspan(left, right, color="0.5", alpha=0.12, linewidth=0.0)
    for rings in shown.areas:
        outline = Outline.make_compound_path(*(Outline(np.column_stack(ring)) for ring in rings))
        axes.add_patch(PathPatch(outline, facecolor="0.9", edgecolor="none", zorder=0))
    for bar in shown.bars:
        axes.barh(bar.lane, bar.end - bar.start, left=bar.start, color=palette[bar.colour])
    for curve in shown.curves:
        axes.plot(
            curve.x,
            curve.y,
            label=curve.name or "_",
            color=palette[curve.colour],
            alpha=curve.opacity,
            linewidth=_WIDTH * curve.width,
            linestyle="none" if curve.marker else curve.dash,
            marker=_MARKERS[curve.marker],
            markersize=12,
        )
    for knot in shown.knots:
        axes.axvline(knot, color="0.85", linewidth=0.8, zorder=0)
    for level in shown.levels:
        axes.axhline(level, color="0.5", linewidth=0.8, zorder=0)
    axes.set(xscale=shown.x.scale, xlabel=shown.x.text, ylabel=shown.y.text)
    if not shown.bars:
        axes.set_yscale(shown.y.scale)
    axes.margins(x=0.01)
    axes.set_title(shown.title, loc="left")
    for axis, limit in ((shown.x, axes.set_xlim), (shown.y, axes.set_ylim)):
        if axis.range is not None:
            limit(axis.range.low, axis.range.high)
    if shown.true_to_scale:
        axes.set_aspect("equal", adjustable="datalim")


def legend_below(figure: FigureBase, axes: Axes, columns: int) -> None:
    """Name the curves of some axes below all that a figure or a part of one shows, off curves."""
    handles, labels = axes.get_legend_handles_labels()
    place: Any = {"loc": "outside lower center", "ncols": columns}
    figure.legend(handles, labels, fontsize="small", frameon=False, **place)


def _picture(shown: Plot) -> tuple[Figure, Axes]:
    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot()
    draw(axes, shown)
    legend_below(figure, axes, 3)
    return figure, axes


@own_style()
def png_of(shown: Plot) -> bytes:
    """Return the picture of a plot, as PNG."""
    with BytesIO() as part:
        _picture(shown)[0].savefig(part, dpi=_DPI)
        return part.getvalue()


@own_style()
def plot_moment(run: RunRecord, path: Path) -> None:
    """Write the moment at the sensing gripper, raw, filtered and true, as PNG."""
    curves = recorded_moments(run, is_bending(run))
    shown = moment_plot(
        curves,
        knots_of(run.scenario),
        axes=(ANGLE, Axis(f"moment at the {run.sensing_side} gripper", "mN m")),
        title=textwrap.fill(f"{run.scenario.name}  ({ended(run)})", _BESIDE, max_lines=4),
    )
    figure, axes = _picture(shown)
    axes.annotate(
        f"largest true moment {np.nanmax(np.abs(curves[-1].y), initial=0.0):.1f} mN m",
        xy=(1.0, 1.01),
        xycoords="axes fraction",
        ha="right",
        va="bottom",
    )
    save(figure, path, metadata={"Description": str(run.identity or "")})


@own_style()
def plot_compared_moments(
    runs: tuple[RunRecord, RunRecord], labels: tuple[str, str], path: Path
) -> None:
    """Write the moments at the sensing grippers during bending as PNG: true, and thin, filtered.

    Raises OSError where ``path`` cannot be written.
    """
    looks = zip(runs, labels, COLOURS, LEFT_RIGHT, strict=False)
    curves = [curve for look in looks for curve in _filtered_and_true(*look)]
    shown = moment_plot(
        curves,
        sorted({knot for run in runs for knot in knots_of(run.scenario)}),
        axes=(ANGLE, Axis("moment at the sensing gripper", "mN m")),
        title=f"{labels[0]} and {labels[1]}",
    )
    save(_picture(shown)[0], path)


def _filtered_and_true(
    run: RunRecord, label: str, colour: Colour, look: tuple[float, float]
) -> tuple[Curve, Curve]:
    _, filtered, true = recorded_moments(run, is_bending(run))
    name = f"{label}, {run.sensing_side}: largest {np.nanmax(np.abs(true.y), initial=0.0):.1f} mN m"
    return (
        replace(filtered, name="", colour=colour, width=0.7, opacity=0.5),
        replace(true, name=name, colour=colour, width=look[0], opacity=look[1]),
    )


@own_style()
def plot_stability_map(panels: Sequence[Panel], title: str, path: Path) -> None:
    """Write the boundaries in (b, k) at a few bending angles, with the scenario's gains, as PNG.

    Raises InputError where the file cannot be written.
    """
    viridis = mpl.colormaps["viridis"]
    angles = {colour: viridis(i / 4) for i, colour in enumerate(COLOURS[:4])}
    figure = Figure(figsize=(6.4 * len(panels), 6.2), layout="constrained")
    parts = figure.subfigures(1, len(panels), squeeze=False)[0]
    for part, panel in zip(parts, panels, strict=True):
        axes = part.add_subplot()
        draw(axes, stability_panel(panel, stiffness=True), {**PALETTE, **angles})
        axes.plot([], [], color="0.3", label="sampled loop")
        axes.plot([], [], color="0.3", linestyle="dashed", label="paper (23)")
        legend_below(part, axes, 2)
    figure.suptitle(f"{title}; shaded: unstable")
    save(figure, path, "--map")
