"""What a run's plots over time share: the shaded phases, and the range that all of them show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dualbend.report.plot import LEFT_RIGHT, Axis, Colour, Curve, Plot, common
from dualbend.report.section import Figure
from dualbend.run.record import RunRecord
from dualbend.types import SIDES, Vector

_COLOURS: dict[str, tuple[Colour, Colour]] = {
    "left": ("blue", "green"),
    "right": ("orange", "purple"),
}


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A phase as it was run; ``sheet`` and ``attempt`` count from 0, None where there is one."""

    name: str
    start_s: float
    end_s: float
    sheet: int | None = None
    attempt: int | None = None


@dataclass(frozen=True)
class OverTime:
    """A run's plots over time."""

    run: RunRecord

    @cached_property
    def axis(self) -> Axis:
        """Time, of a range that all of them show."""
        return Axis("time", "s", range=common([self.run["time"]], margin=0.01))

    @cached_property
    def phases(self) -> list[Phase]:
        """The phases in the order in which they were run."""
        return list(_phases(self.run))

    def curve(
        self,
        column: str,
        name: str,
        colour: Colour,
        factor: float = 1.0,
        look: tuple[float, float] = (1.6, 1.0),
    ) -> Curve:
        """Return a column of the trace, times a factor, over time; ``look``: width and opacity."""
        values, (width, opacity) = factor * self.run[column], look
        return Curve(name, self.run["time"], values, colour, width, opacity=opacity)

    def curves_by_side(
        self,
        columns: Sequence[tuple[str, str]],
        factor: float,
        sides: Sequence[str] = SIDES,
    ) -> list[Curve]:
        """Return curves of one or two columns of each side, given as name and ending."""
        return [
            self.curve(f"{side}_{column}", f"{side} {name}".strip(), colour, factor, look)
            for side, look in zip(sides, LEFT_RIGHT, strict=False)
            for (name, column), colour in zip(columns, _COLOURS[side], strict=False)
        ]

    def figure(
        self,
        axis: Axis,
        curves: Sequence[Curve],
        caption: str,
        alt: str = "",
        levels: Sequence[float] = (),
    ) -> Figure:
        """Return curves over time, every second phase shaded; ``alt``: each curve's span."""
        bands = [(phase.start_s, phase.end_s) for phase in self.phases[::2]]
        plot = Plot(curves=curves, x=self.axis, y=axis, bands=bands, levels=levels)
        spans = "; ".join(f"{c.name}: {_span(c.y)} {axis.unit}" for c in curves)
        return Figure(plot, caption, alt or f"{axis.label} over time. {spans}")


def _span(values: Vector) -> str:
    finite = values[np.isfinite(values)]
    return f"{finite.min():.3g} to {finite.max():.3g}" if finite.size else "none"


def _phases(run: RunRecord) -> Iterator[Phase]:
    several = "sheet" in run.trace
    # A run that stops while it looks leaves its last row's columns unwritten.
    counts = [_held(run[name]) for name in ("attempt", "sheet")] if several else []
    table, time = np.stack([run["phase"], *counts]), run["time"]
    starts = np.flatnonzero(np.any(np.diff(table, prepend=-1.0) != 0.0, axis=0))
    for first, end in zip(starts, [*starts[1:], len(time)], strict=True):
        phase, *counted = table[:, first].astype(int).tolist()
        attempt, sheet = counted or (None, None)
        yield Phase(
            name=run.phases[phase],
            sheet=sheet,
            attempt=attempt,
            start_s=float(time[first]),
            end_s=float(time[end - 1] + run.scenario.period_s),
        )


def _held(values: Vector) -> Vector:
    """Return the values with what is not a number replaced by the last one before it."""
    known = np.isfinite(values)
    at = np.maximum.accumulate(np.where(known, np.arange(values.size), 0))
    return np.nan_to_num(values[at])
