"""A stream of the recording on its one timeline: static components, columns, series of a plot."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from dualbend.files import write_whole
from dualbend.run.record import RunRecord
from dualbend.types import Vector

Times = NDArray[np.timedelta64]
Colour = list[int]

Series = tuple[str, Vector, Colour, float]
"""A line of a plot: name, values (rows,), colour, width in points."""

TIMELINE = "sim_time"
"""Name of the only timeline: simulated time since the start of the run."""

_FRAME_S = 0.084
"""The scene in 3D has a frame about as often as this, 12 a second; series have every cycle."""


def frame_cycles(period_s: float) -> int:
    """Return how many command periods of ``period_s`` [s] a frame of the scene in 3D stands for."""
    return max(round(_FRAME_S / period_s), 1)


def new_stream(name: str) -> rr.RecordingStream:
    """Return a stream that knows no timeline but the run's; a name is one recording."""
    stream = rr.RecordingStream("dualbend", recording_id=name, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


@contextmanager
def saved(stream: rr.RecordingStream, path: Path, layout: rrb.Blueprint) -> Iterator[None]:
    """Write what a stream is sent in the block to ``path``, whole, with a layout.

    Raises OSError where ``path`` cannot be written; rerun itself would only print that.
    """
    sink = stream.binary_stream()
    stream.send_blueprint(layout, make_active=False, make_default=True)
    try:
        yield
        write_whole(path, sink.read() or b"")
    finally:
        stream.disconnect()


def row_times(run: RunRecord) -> Times:
    """Return the times of the rows (rows,) in whole nanoseconds."""
    return np.rint(1e9 * run["time"]).astype("timedelta64[ns]")


def recording_log(
    stream: rr.RecordingStream, run: RunRecord, *, begin: int = 0, done: int = 0, ended: bool = True
) -> RecordingLog:
    """Return the log of a run's rows, or of its rows from the run's row ``begin`` on."""
    frame = frame_cycles(run.scenario.period_s)
    return RecordingLog(stream, row_times(run), begin=begin, done=done, ended=ended, frame=frame)


@dataclass(frozen=True)
class RecordingLog:
    """A stream and the times of the trace's rows, in whole nanoseconds.

    ``begin``: the run's row that is the first of ``times``. ``done``: rows of ``times`` that were
    logged before, and with them all that is logged once. ``ended``: the last of ``times`` is the
    run's last, and the scene is shown there too. ``frame``: rows of a frame of the scene in 3D.
    """

    stream: rr.RecordingStream
    times: Times
    begin: int = 0
    done: int = 0
    ended: bool = True
    frame: int = 1

    @property
    def live(self) -> bool:
        """More rows are to come, so nothing is known to rest for the whole run."""
        return self.done > 0 or not self.ended

    def once(self, entity: str, *archetypes: rr.AsComponents) -> None:
        """Log what holds for the whole run, with the first rows."""
        if not self.done:
            self.replace(entity, *archetypes)

    def replace(self, entity: str, *archetypes: rr.AsComponents) -> None:
        """Log what holds for the whole run, as far as it is known now."""
        self.stream.log(entity, *archetypes, static=True)

    def rows(
        self, entity: str, archetype: type[rr.AsComponents], every: int = 1, **values: NDArray[Any]
    ) -> None:
        """Log (rows, ...) or (rows, instances, ...) values, without the rows that hold a NaN."""
        kept = self._new() & self._regular(every) & _finite(values)
        self._send_rows(entity, archetype, values, kept)

    def frames(self, entity: str, archetype: type[rr.AsComponents], **values: NDArray[Any]) -> None:
        """Log what the eye follows: every frame's row and the last, where anything changed.

        A viewer shows the latest frame at any time, so one that equals it says nothing.
        """
        at = np.flatnonzero(self._regular(self.frame) & _finite(values))
        moved = np.zeros(len(at), dtype=bool)
        moved[:1] = True
        for value in values.values():
            change = value[at[1:]] != value[at[:-1]]
            moved[1:] |= change.any(axis=tuple(range(1, value.ndim)))
        kept = np.zeros(len(self.times), dtype=bool)
        kept[at[moved]] = True
        self._send_rows(entity, archetype, values, kept & self._new())

    def _regular(self, every: int) -> NDArray[np.bool_]:
        """Return which rows are a multiple of ``every``, or the run's last (rows,)."""
        regular: NDArray[np.bool_] = (self.begin + np.arange(len(self.times))) % every == 0
        if self.ended:
            regular[-1:] = True
        return regular

    def _new(self) -> NDArray[np.bool_]:
        return np.arange(len(self.times)) >= self.done

    def _send_rows(
        self,
        entity: str,
        archetype: type[rr.AsComponents],
        values: dict[str, NDArray[Any]],
        rows: NDArray[np.bool_],
    ) -> None:
        kept = {key: value[rows] for key, value in values.items()}
        several = [value.shape[1] for value in values.values() if value.ndim == 3]
        if several:
            kept = {key: value.reshape(-1, value.shape[-1]) for key, value in kept.items()}
        columns = archetype.columns(**kept)
        if several:
            columns = columns.partition(np.full(rows.sum(), several[0]))
        self.send(entity, self.times[rows], columns)

    def send(self, entity: str, times: Times, columns: rr.ComponentColumnList) -> None:
        """Log columns at times of their own; no times, no entity."""
        if len(times):
            index = rr.TimeColumn(TIMELINE, duration=times)
            self.stream.send_columns(entity, indexes=[index], columns=columns)

    def lines(self, entity: str, *series: Series, every: int = 1) -> None:
        """Log series of one plot."""
        names, values, colours, widths = zip(*series, strict=True)
        self.once(entity, rr.SeriesLines(names=names, colors=colours, widths=widths))
        self.rows(entity, rr.Scalars, every, scalars=np.stack(values, axis=1))

    def broken_line(self, entity: str, *series: Series, every: int = 1) -> None:
        """Log series that have gaps, where they are NaN: there a row without a value ends a line.

        A NaN itself would do, but equals no NaN: two recordings of one run would differ.
        """
        names, columns, colours, widths = zip(*series, strict=True)
        self.once(entity, rr.SeriesLines(names=names, colors=colours, widths=widths))
        at = np.flatnonzero(self._regular(every))
        values = np.stack(columns, axis=1)[at]
        finite = np.isfinite(values).all(axis=1)
        ends = ~finite & np.concatenate(([False], finite[:-1]))
        kept = (finite | ends) & self._new()[at]
        lengths = np.where(finite, len(series), 0)[kept]
        scalars = rr.Scalars.columns(scalars=values[kept & finite].ravel()).partition(lengths)
        if (kept & finite).any() or self.done:
            self.send(entity, self.times[at[kept]], scalars)


def _finite(values: dict[str, NDArray[Any]]) -> NDArray[np.bool_]:
    """Return which rows hold no NaN (rows,)."""
    parts = [np.isfinite(v).all(axis=tuple(range(1, v.ndim))) for v in values.values()]
    return np.asarray(np.logical_and.reduce(parts))
