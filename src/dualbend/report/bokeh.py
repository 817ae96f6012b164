"""The interactive plots of a page: their descriptions for JSON, which Bokeh's script draws there.

Figures are put together in the browser (``report.js``): the same ones made by Bokeh's Python side
take several times as long as everything else in a report.
"""

from __future__ import annotations

import base64
import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dualbend.errors import DualbendError
from dualbend.report.plot import Bar, Colour, Curve, Plot, Range
from dualbend.types import Vector

PALETTE: dict[Colour, str] = {
    "blue": "#3b82f6",
    "orange": "#e8790c",
    "green": "#10a37f",
    "purple": "#a259e6",
    "red": "#e5484d",
    "grey": "#94a3b8",
}
"""Seen on white and on black."""

_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")


def plots_data(plots: Mapping[str, Plot]) -> dict[str, Any]:
    """Return what ``report.js`` draws, by name; ranges that plots share are named once."""
    ranges: dict[Range, int] = {}
    found = {name: _plain(plot, ranges) for name, plot in plots.items()}
    shared = [[shown.low, shown.high] for shown in ranges]
    return {"ranges": shared, "plots": found}


def _plain(plot: Plot, ranges: dict[Range, int]) -> dict[str, Any]:
    axes = {
        name: {**vars(axis), "range": axis.range and ranges.setdefault(axis.range, len(ranges))}
        for name, axis in (("x", plot.x), ("y", plot.y))
    }
    curves = [
        {**_coloured(curve), "x": _packed(curve.x), "y": _packed(curve.y)} for curve in plot.curves
    ]
    areas = [[[_packed(x), _packed(y)] for x, y in rings] for rings in plot.areas]
    bars = [_coloured(bar) for bar in plot.bars]
    return {**vars(plot), **axes, "curves": curves, "areas": areas, "bars": bars}


def _coloured(item: Curve | Bar) -> dict[str, Any]:
    return {**vars(item), "colour": PALETTE[item.colour]}


def _packed(values: Vector) -> str:
    """Return numbers as base64 of single precision: seven digits are more than a screen shows."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def library() -> str:
    """Return Bokeh's own scripts, from its installed package: they ask nothing of any host.

    Raises DualbendError where Bokeh is not installed as it should be.
    """
    # Found, not imported: its Python side is not needed, and takes a second.
    spec = importlib.util.find_spec("bokeh")
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    for folder in folders:
        scripts = [Path(folder, "server", "static", "js", name) for name in _SCRIPTS]
        if all(script.is_file() for script in scripts):
            return "\n".join(script.read_text(encoding="utf-8") for script in scripts)
    raise DualbendError(f"bokeh has no {' or '.join(_SCRIPTS)}: looked in {folders}; reinstall it")
