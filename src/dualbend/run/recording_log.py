"""A stream of the recording on its one timeline: static components, columns, series of a plot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Times = NDArray[np.timedelta64]
Colour = list[int]

TIMELINE = "sim_time"
"""Name of the only timeline: simulated time since the start of the run."""


@dataclass(frozen=True)
class RecordingLog:
    """A stream and the times of the trace's rows, in whole nanoseconds."""

    stream: rr.RecordingStream
    times: Times

    def once(self, entity: str, *archetypes: rr.AsComponents) -> None:
        """Log what holds for the whole run."""
        self.stream.log(entity, *archetypes, static=True)

    def rows(self, entity: str, archetype: type[rr.AsComponents], **values: NDArray[Any]) -> None:
        """Log (rows, ...) or (rows, instances, ...) values, without the rows that hold a NaN."""
        finite = np.ones(len(self.times), dtype=bool)
        for value in values.values():
            finite &= np.isfinite(value).all(axis=tuple(range(1, value.ndim)))
        kept = {key: value[finite] for key, value in values.items()}
        several = [value.shape[1] for value in values.values() if value.ndim == 3]
        if several:
            kept = {key: value.reshape(-1, value.shape[-1]) for key, value in kept.items()}
        columns = archetype.columns(**kept)
        if several:
            columns = columns.partition(np.full(finite.sum(), several[0]))
        self.send(entity, self.times[finite], columns)

    def send(self, entity: str, times: Times, columns: rr.ComponentColumnList) -> None:
        """Log columns at times of their own; no times, no entity."""
        if len(times):
            index = rr.TimeColumn(TIMELINE, duration=times)
            self.stream.send_columns(entity, indexes=[index], columns=columns)

    def lines(self, entity: str, *series: tuple[str, Vector, Colour, float]) -> None:
        """Log series of one plot, each with its name, values, colour and width in points."""
        names, values, colours, widths = zip(*series, strict=True)
        self.once(entity, rr.SeriesLines(names=names, colors=colours, widths=widths))
        self.rows(entity, rr.Scalars, scalars=np.stack(values, axis=1))
