"""The sheets of a series in one recording: their moments and corrections on one timeline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from dualbend.recording.log import TIMELINE, RecordingLog, Times, new_stream, saved
from dualbend.types import SIDES, Vector

_FIRST, _LAST = np.array([[250.0, 220.0, 80.0], [70.0, 90.0, 250.0]])
"""Colours of the first and of the last sheet."""


@dataclass(frozen=True)
class SheetSeries:
    """A sheet: its name, times (rows,) [s] and moments (rows,) [N m] of the bending.

    ``correction_rad`` (2, cycles): what it taught, from the start of the run.
    """

    name: str
    time_s: Vector
    moment_nm: Vector
    correction_rad: Vector


def write_sheets_recording(
    sheets: Sequence[SheetSeries], name: str, path: Path, period_s: float
) -> None:
    """Write ``/moment/sheet-1`` and ``/correction/left/sheet-1`` on, units in the series' names.

    OSError where ``path`` cannot be written.
    """
    stream = new_stream(f"{name}: {len(sheets)} sheets")
    plots = [
        rrb.TimeSeriesView(origin="moment", name="Moment, the larger one of both arms"),
        *(
            rrb.TimeSeriesView(origin=f"correction/{s}", name=f"Correction after it, {s}")
            for s in SIDES
        ),
    ]
    layout = rrb.Blueprint(
        rrb.Vertical(*plots, row_shares=[3.0, 1.0, 1.0]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
    with saved(stream, path, layout):
        stream.send_recording_name(name)
        for i, sheet in enumerate(sheets):
            share = i / max(len(sheets) - 1, 1)
            colour = np.rint(_FIRST + share * (_LAST - _FIRST)).astype(int).tolist()
            entity = f"sheet-{i + 1}"
            RecordingLog(stream, _times(sheet.time_s)).lines(
                f"moment/{entity}", (f"{sheet.name} [mN m]", 1e3 * sheet.moment_nm, colour, 1.5)
            )
            cycles = np.arange(sheet.correction_rad.shape[-1], dtype=np.float64)
            log = RecordingLog(stream, _times(period_s * cycles))
            for side, turn in zip(SIDES, sheet.correction_rad, strict=True):
                log.lines(
                    f"correction/{side}/{entity}", (f"{sheet.name} [mrad]", 1e3 * turn, colour, 1.5)
                )


def _times(time_s: Vector) -> Times:
    return np.rint(1e9 * time_s).astype("timedelta64[ns]")
