"""Interactive plots of a report: the only home of Bokeh, whose script is put into the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import contourpy
import numpy as np
from bokeh.embed import components
from bokeh.models import (
    BoxAnnotation,
    ColumnDataSource,
    CrosshairTool,
    FactorRange,
    HoverTool,
    Legend,
    LegendItem,
    Range1d,
    Span,
)
from bokeh.plotting import figure
from bokeh.resources import Resources
from numpy.typing import NDArray

from dualbend.analysis.report_data import Phase
from dualbend.analysis.stability_map import Panel

Vector = NDArray[np.float64]
Plot: TypeAlias = figure
Range: TypeAlias = Range1d

BLUE, ORANGE, GREY, GREEN, RED, PURPLE = (
    *("#3b82f6", "#e8790c", "#94a3b8", "#10a37f", "#e5484d", "#a259e6"),
)
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED, GREY)
"""Seen on white and on black."""

_TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
_HEIGHT_PX = 340
_BAND = "#808080"


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What is plotted along an axis, its unit, and its scale."""

    label: str
    unit: str
    scale: Literal["linear", "log"] = "linear"

    @property
    def text(self) -> str:
        """Label with unit."""
        return f"{self.label} [{self.unit}]"


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A line, or points where ``marker`` is given; NaN is a gap; without a name in no legend."""

    name: str
    x: Vector
    y: Vector
    colour: str = BLUE
    width: float = 1.6
    dash: str = "solid"
    marker: str | None = None


@dataclass(frozen=True, kw_only=True)
class Ranges:
    """Ranges that several plots have in common: zooming one zooms all."""

    x: Range1d | None = None
    y: Range1d | None = None


def common(values: Sequence[Vector], margin: float = 0.04) -> Range1d:
    """Return a range that holds all values, with a margin."""
    finite = np.concatenate([np.asarray(v)[np.isfinite(v)] for v in values] or [np.zeros(0)])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    room = margin * ((high - low) or 1.0)
    return Range1d(low - room, high + room)


def plot(
    curves: Sequence[Curve],
    x: Axis,
    y: Axis,
    *,
    ranges: Ranges | None = None,
    bands: Sequence[Phase] = (),
    knots: Sequence[float] = (),
    levels: Sequence[float] = (),
    title: str = "",
    height_px: int = _HEIGHT_PX,
    true_to_scale: bool = False,
) -> Plot:
    """Return a plot of curves with a legend that switches them, hover with units, zoom.

    ``bands``: phases, every second one shaded; ``knots``: vertical lines; ``levels``: horizontal.
    """
    drawn = _frame(x, y, ranges or Ranges(), title, height_px)
    drawn.match_aspect = true_to_scale
    for band in bands[::2]:
        box = BoxAnnotation(left=band.start_s, right=band.end_s, fill_color=_BAND, fill_alpha=0.12)
        drawn.add_layout(box)
    for knot in knots:
        drawn.add_layout(Span(location=knot, dimension="height", line_color=_BAND, line_alpha=0.35))
    for level in levels:
        drawn.add_layout(Span(location=level, dimension="width", line_color=_BAND, line_alpha=0.8))
    items = []
    for curve in curves:
        renderer = _draw(drawn, curve)
        if curve.name:
            items.append(LegendItem(label=curve.name, renderers=[renderer]))
    _finish(drawn, items, x, y)
    return drawn


def _frame(x: Axis, y: Axis, ranges: Ranges, title: str, height_px: int) -> Plot:
    given = {"x_range": ranges.x, "y_range": ranges.y}
    drawn = figure(
        height=height_px,
        sizing_mode="stretch_width",
        min_width=200,
        tools=_TOOLS,
        active_drag="box_zoom",
        toolbar_location="above",
        title=title or None,
        x_axis_type=x.scale,
        y_axis_type=y.scale,
        x_axis_label=x.text,
        y_axis_label=y.text,
        **{name: value for name, value in given.items() if value is not None},
    )
    drawn.toolbar.logo = None
    drawn.axis.axis_label_text_font_style = "normal"
    drawn.outline_line_color = None
    return drawn


def _draw(drawn: Plot, curve: Curve) -> object:
    # Seven digits are more than a screen shows and half the bytes.
    data = {"x": np.asarray(curve.x, np.float32), "y": np.asarray(curve.y, np.float32)}
    source = ColumnDataSource(data)
    if curve.marker is not None:
        return drawn.scatter(
            source=source, name=curve.name, marker=curve.marker, size=11, color=curve.colour
        )
    return drawn.line(
        source=source,
        name=curve.name,
        color=curve.colour,
        line_width=curve.width,
        line_dash=curve.dash,
        line_join="round",
    )


def _finish(drawn: Plot, items: Sequence[LegendItem], x: Axis, y: Axis) -> None:
    """Add legend and hover."""
    tips = [("", "$name"), (x.label, f"@x{{%.4g}} {x.unit}"), (y.label, f"@y{{%.4g}} {y.unit}")]
    hover = HoverTool(tooltips=tips, formatters={"@x": "printf", "@y": "printf"})
    drawn.add_tools(hover, CrosshairTool(line_alpha=0.3, line_color=_BAND))
    if items:
        legend = Legend(
            items=list(items),
            orientation="horizontal",
            click_policy="hide",
            border_line_color=None,
            background_fill_alpha=0.0,
            label_text_font_size="12px",
            margin=0,
            ncols=len(items),
        )
        drawn.add_layout(legend, "below")


def phase_lanes(phases: Sequence[Phase], x_range: Range1d) -> Plot:
    """Return the phases as bars over time, a lane a name."""
    names = list(dict.fromkeys(phase.name for phase in phases))
    drawn = figure(
        height=90 + 17 * len(names),
        sizing_mode="stretch_width",
        min_width=200,
        tools=_TOOLS,
        active_drag="box_zoom",
        toolbar_location="above",
        x_range=x_range,
        y_range=FactorRange(*reversed(names)),
        x_axis_label="time [s]",
    )
    drawn.toolbar.logo = None
    drawn.axis.axis_label_text_font_style = "normal"
    drawn.outline_line_color = None
    source = ColumnDataSource(
        {
            "name": [phase.name for phase in phases],
            "start": [phase.start_s for phase in phases],
            "end": [phase.end_s for phase in phases],
            "time": [phase.end_s - phase.start_s for phase in phases],
            "which": [f"{phase.sheet + 1}, {phase.attempt + 1}" for phase in phases],
            "colour": [COLOURS[names.index(phase.name) % len(COLOURS)] for phase in phases],
        }
    )
    bars = drawn.hbar(
        y="name", left="start", right="end", height=0.7, color="colour", source=source
    )
    tips = [
        ("phase", "@name"),
        ("from", "@start{0.00} s"),
        ("to", "@end{0.00} s"),
        ("takes", "@time{0.00} s"),
        ("sheet, attempt", "@which"),
    ]
    drawn.add_tools(HoverTool(renderers=[bars], tooltips=tips))
    return drawn


def stability_panel(panel: Panel) -> Plot:
    """Return a map of one axis: boundaries in (b, k) at some angles, unstable part shaded."""
    b, k = (np.log10(values) for values in (panel.b, panel.k))
    curves = []
    for i, (alpha, stiffness) in enumerate(panel.stiffness.items()):
        for field, dash, name in (
            (panel.sampled[alpha], "solid", f"{alpha:.2f} rad"),
            (panel.paper / max(stiffness, 1e-12), "dashed", ""),
        ):
            ratio = np.log(np.clip(field, 1e-12, 1e12)).T
            x, y = _boundary(b, k, ratio)
            curves.append(Curve(name=name, x=x, y=y, colour=COLOURS[i % len(COLOURS)], dash=dash))
    star = Curve(
        name="this run",
        x=np.array([panel.gains[0]]),
        y=np.array([panel.gains[1]]),
        colour=RED,
        marker="star",
    )
    axes = (
        Axis(label="damping b", unit=panel.units[0], scale="log"),
        Axis(label="stiffness k", unit=panel.units[1], scale="log"),
    )
    limits = Ranges(x=Range1d(panel.b[0], panel.b[-1]), y=Range1d(panel.k[0], panel.k[-1]))
    drawn = plot([*curves, star], *axes, ranges=limits, title=f"{panel.axis} alone")
    worst = np.minimum.reduce(list(panel.sampled.values()))
    if worst.min() < 1.0:
        drawn.contour(
            panel.b,
            panel.k,
            worst.T,
            levels=[0.0, 1.0],
            fill_color=_BAND,
            fill_alpha=0.2,
        )
    return drawn


def _boundary(b: Vector, k: Vector, ratio: Vector) -> tuple[Vector, Vector]:
    """Return where a field is 0, pieces apart by NaN; b, k as logarithms, returned as gains."""
    gap = np.full((1, 2), np.nan)
    pieces = contourpy.contour_generator(b, k, ratio).lines(0.0)
    points = np.concatenate(
        [part for piece in pieces for part in (np.asarray(piece), gap)] or [gap]
    )
    return 10.0 ** points[:, 0], 10.0 ** points[:, 1]


def embed(plots: Mapping[str, Plot]) -> tuple[str, dict[str, str]]:
    """Return the script that draws the plots, and for each name the element that it is drawn in."""
    script, places = components(dict(plots), wrap_script=False)
    return str(script), {name: str(place) for name, place in places.items()}


def library() -> str:
    """Return Bokeh's own script, its core alone: it asks nothing of any host."""
    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)
