"""What a plot shows, as data: axes with units, curves, bars; drawn by Bokeh or matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dualbend.types import Vector

Colour = Literal["blue", "orange", "green", "purple", "red", "grey"]
COLOURS: tuple[Colour, ...] = ("blue", "orange", "green", "purple", "red", "grey")
"""Names; whoever draws has a palette that is seen on its ground."""

LEFT_RIGHT = ((5.0, 0.45), (1.5, 1.0))
"""Width and opacity of two curves of a kind: where they are equal, the second lies in the first."""

_ALIKE = 3.0
"""How much longer a range may be than one that it is joined with."""


@dataclass(frozen=True)
class Curve:
    """A line, or points where ``marker`` is given; NaN is a gap; without a name in no legend."""

    name: str
    x: Vector
    y: Vector
    colour: Colour = "blue"
    width: float = 1.6
    dash: Literal["solid", "dashed", "dotted"] = "solid"
    opacity: float = 1.0
    marker: Literal["star", "circle_dot", "circle_cross"] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Range:
    """What an axis shows at first; plots that have the same object are zoomed together."""

    low: float
    high: float


@dataclass(frozen=True)
class Axis:
    """What is plotted along an axis, its unit, its scale and range; None: what the curves need."""

    label: str
    unit: str
    scale: Literal["linear", "log"] = "linear"
    range: Range | None = None

    @property
    def text(self) -> str:
        """The label, with the unit in brackets where there is one."""
        return f"{self.label} [{self.unit}]" if self.unit not in {"", "1"} else self.label


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A bar from one time to another [s] in a lane, with its label."""

    lane: str
    start: float
    end: float
    label: str
    colour: Colour


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
    bands: Sequence[tuple[float, float]] = ()
    knots: Sequence[float] = ()
    levels: Sequence[float] = ()
    areas: Sequence[Sequence[Ring]] = ()
    title: str = ""
    height_px: int = 340
    true_to_scale: bool = False


def common(values: Sequence[Vector], margin: float = 0.04) -> Range:
    """Return a range that holds all values, with a margin."""
    finite = np.concatenate([np.asarray(v)[np.isfinite(v)] for v in values] or [np.zeros(0)])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    room = margin * ((high - low) or 1.0)
    return Range(low=low - room, high=high + room)


def shared(ranges: Sequence[Range]) -> list[Range]:
    """Return for each range the one that it shares with those of like size.

    From the smallest on, those up to three times its length are joined: among curves that are ten
    times larger a small one would be a line.
    """
    found: dict[Range, Range] = {}
    left = sorted(ranges, key=_length)
    while left:
        alike = [one for one in left if _length(one) <= _ALIKE * _length(left[0])]
        joined = Range(low=min(r.low for r in alike), high=max(r.high for r in alike))
        found.update(dict.fromkeys(alike, joined))
        left = left[len(alike) :]
    return [found[one] for one in ranges]


def _length(shown: Range) -> float:
    return shown.high - shown.low
