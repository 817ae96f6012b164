"""Interactive plots of a report: what is drawn, as data; Bokeh's script draws it in the page.

The only home of Bokeh. Its figures are put together in the browser (``report.js``): the same ones
made by its Python side take several times as long as everything else in a report.
"""

from __future__ import annotations

import base64
import importlib.util
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import contourpy
import numpy as np

from dualbend.errors import DualbendError
from dualbend.report.data import Phase
from dualbend.stability.map import Panel
from dualbend.types import Vector

BLUE, ORANGE, GREY, GREEN, RED, PURPLE = (
    *("#3b82f6", "#e8790c", "#94a3b8", "#10a37f", "#e5484d", "#a259e6"),
)
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED, GREY)
"""Seen on white and on black."""

_HEIGHT_PX = 340
_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What is plotted along an axis, its unit, and its scale."""

    label: str
    unit: str
    scale: Literal["linear", "log"] = "linear"


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A line, or points where ``marker`` is given; NaN is a gap; without a name in no legend."""

    name: str
    x: Vector
    y: Vector
    colour: str = BLUE
    width: float = 1.6
    dash: Literal["solid", "dashed", "dotted"] = "solid"
    marker: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Range:
    """What an axis shows at first; plots that have the same object are zoomed together."""

    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Ranges:
    """Ranges of a plot; None: what its curves need."""

    x: Range | None = None
    y: Range | None = None


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A bar from one time to another [s] in a lane, with what is told of it."""

    lane: str
    start: float
    end: float
    told: str
    colour: str


Ring = tuple[Vector, Vector]


@dataclass(frozen=True, kw_only=True)
class Plot:
    """A plot: curves, or bars in lanes; ``bands`` are shaded ranges of x.

    ``knots`` and ``levels``: vertical and horizontal lines; ``areas``: shaded polygons, each an
    outer ring and its holes; ``true_to_scale``: a unit is as long along y as along x.
    """

    x: Axis
    y: Axis
    curves: Sequence[Curve] = ()
    bars: Sequence[Bar] = ()
    ranges: Ranges = Ranges()
    bands: Sequence[tuple[float, float]] = ()
    knots: Sequence[float] = ()
    levels: Sequence[float] = ()
    areas: Sequence[Sequence[Ring]] = field(default=())
    title: str = ""
    height_px: int = _HEIGHT_PX
    true_to_scale: bool = False


def common(values: Sequence[Vector], margin: float = 0.04) -> Range:
    """Return a range that holds all values, with a margin."""
    finite = np.concatenate([np.asarray(v)[np.isfinite(v)] for v in values] or [np.zeros(0)])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    room = margin * ((high - low) or 1.0)
    return Range(low=low - room, high=high + room)


def every_second(phases: Sequence[Phase]) -> list[tuple[float, float]]:
    """Return the bands that tell phases apart."""
    return [(phase.start_s, phase.end_s) for phase in phases[::2]]


def phase_lanes(phases: Sequence[Phase], shared: Range) -> Plot:
    """Return the phases as bars over time, a lane a name."""
    names = list(dict.fromkeys(phase.name for phase in phases))
    several = any(phase.sheet or phase.attempt for phase in phases)
    bars = [
        Bar(
            lane=phase.name,
            start=phase.start_s,
            end=phase.end_s,
            told=phase.name
            + (f", sheet {phase.sheet + 1}, attempt {phase.attempt + 1}" if several else ""),
            colour=COLOURS[names.index(phase.name) % len(COLOURS)],
        )
        for phase in phases
    ]
    return Plot(
        x=Axis(label="time", unit="s"),
        y=Axis(label="", unit=""),
        bars=bars,
        ranges=Ranges(x=shared),
        height_px=90 + 17 * len(names),
    )


def stability_panel(panel: Panel) -> Plot:
    """Return a map of one axis: boundaries in (b, k) at some angles, unstable part shaded."""
    b, k = (np.log10(values) for values in (panel.b, panel.k))
    curves = []
    for i, (alpha, stiffness) in enumerate(panel.stiffness.items()):
        colour = COLOURS[i % len(COLOURS)]
        sampled = _boundary(b, k, panel.sampled[alpha])
        paper = _boundary(b, k, panel.paper / max(stiffness, 1e-12))
        drawn = np.isfinite(sampled[0]).any() or np.isfinite(paper[0]).any()
        name = f"{alpha:.2f} rad" if drawn else ""
        curves.append(Curve(name=name, x=sampled[0], y=sampled[1], colour=colour, width=2.0))
        curves.append(Curve(name="", x=paper[0], y=paper[1], colour=colour, dash="dashed"))
    gains = [np.array([gain]) for gain in panel.gains]
    curves.append(Curve(name="this run", x=gains[0], y=gains[1], colour=RED, marker="star"))
    limits = [Range(low=float(v[0]), high=float(v[-1])) for v in (panel.b, panel.k)]
    return Plot(
        x=Axis(label="damping b", unit=panel.units[0], scale="log"),
        y=Axis(label="stiffness k", unit=panel.units[1], scale="log"),
        curves=curves,
        ranges=Ranges(x=limits[0], y=limits[1]),
        areas=_unstable(b, k, np.minimum.reduce(list(panel.sampled.values()))),
        title=f"{panel.axis} alone",
    )


def _log_ratio(ratio: Vector) -> Vector:
    return np.asarray(np.log(np.clip(ratio, 1e-12, 1e12)).T)


def _boundary(b: Vector, k: Vector, ratio: Vector) -> Ring:
    """Return where a ratio is 1, pieces apart by NaN; b, k as logarithms, returned as gains."""
    gap = np.full((1, 2), np.nan)
    pieces = contourpy.contour_generator(b, k, _log_ratio(ratio)).lines(0.0)
    parts = [part for piece in pieces for part in (np.asarray(piece), gap)]
    points = np.concatenate(parts or [gap])
    return 10.0 ** points[:, 0], 10.0 ** points[:, 1]


def _unstable(b: Vector, k: Vector, margin: Vector) -> list[list[Ring]]:
    """Return the polygons in which a gain margin is below 1."""
    kind = contourpy.FillType.OuterOffset
    generator = contourpy.contour_generator(b, k, _log_ratio(margin), fill_type=kind)
    found: Any = generator.filled(-1e9, 0.0)
    areas = []
    for points, offsets in zip(*found, strict=True):
        rings = [points[i:j] for i, j in pairwise(offsets)]
        areas.append([(10.0 ** ring[:, 0], 10.0 ** ring[:, 1]) for ring in rings])
    return areas


def plots_json(plots: Mapping[str, Plot]) -> str:
    """Return what ``report.js`` draws, by name; ranges that plots share are named once."""
    ranges: dict[Range, int] = {}
    found = {name: _plain(plot, ranges) for name, plot in plots.items()}
    shared = [[shown.low, shown.high] for shown in ranges]
    return json.dumps({"ranges": shared, "plots": found}, allow_nan=False)


def _plain(plot: Plot, ranges: dict[Range, int]) -> dict[str, Any]:
    axes = {
        name: {
            "label": axis.label,
            "unit": axis.unit,
            "scale": axis.scale,
            "range": None if shown is None else ranges.setdefault(shown, len(ranges)),
        }
        for name, axis, shown in (("x", plot.x, plot.ranges.x), ("y", plot.y, plot.ranges.y))
    }
    curves = [
        {**vars(curve), "x": _packed(curve.x), "y": _packed(curve.y)} for curve in plot.curves
    ]
    areas = [[[_packed(x), _packed(y)] for x, y in rings] for rings in plot.areas]
    plain = {k: v for k, v in vars(plot).items() if k not in ("x", "y", "ranges")}
    bars = [vars(bar) for bar in plot.bars]
    return {**plain, **axes, "curves": curves, "areas": areas, "bars": bars}


def _packed(values: Vector) -> str:
    """Return numbers as base64 of single precision: seven digits are more than a screen shows."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def library() -> str:
    """Return Bokeh's own scripts, from its installed package: they ask nothing of any host.

    Raises
    ------
    DualbendError
        Bokeh is not installed as it should be.
    """
    # Found, not imported: its Python side is not needed, and takes a second.
    spec = importlib.util.find_spec("bokeh")
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    for folder in folders:
        scripts = [Path(folder, "server", "static", "js", name) for name in _SCRIPTS]
        if all(script.is_file() for script in scripts):
            return "\n".join(script.read_text(encoding="utf-8") for script in scripts)
    raise DualbendError(f"bokeh has no {' or '.join(_SCRIPTS)}: looked in {folders}; reinstall it")
