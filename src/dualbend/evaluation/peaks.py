"""Where a run's peaks are: the row, and with it the time and phase, of each metric that has one."""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from dualbend.evaluation.metrics import after_stop_signals
from dualbend.run.record import Metric, RunRecord
from dualbend.types import Vector


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """A row of a run: simulated time [s] and the phase that it belongs to."""

    time_s: float
    phase: str

    def __str__(self) -> str:
        """Say it in words."""
        return f"at {self.time_s:.3f} s, {self.phase}"


def peak_places(result: RunRecord, metrics: dict[str, Metric]) -> dict[str, list[Place | None]]:
    """Return where each peak of a run is, an entry for each element of the metric.

    A peak is found again as the row whose signal has exactly the metric's value, so that it cannot
    be another peak than the metric's. Metrics that are no peaks are left out; None where the run
    has no such row, and for a peak of 0, which is everywhere.
    """
    signals: dict[str, Vector] = result.task.part("peaks")(result)
    places = {}
    for name, signal in signals.items():
        if name in metrics:
            value = metrics[name].value
            values = value if isinstance(value, list) else [value]
            places[name] = [
                _place(result, np.flatnonzero(signal == item)) if item else None for item in values
            ]
    return places


def last_place(result: RunRecord) -> Place | None:
    """Return the last row that was recorded; None where there is none."""
    return _place(result, np.arange(result.trace.rows)[-1:])


def _place(result: RunRecord, rows: NDArray[np.intp]) -> Place | None:
    if not rows.size:
        return None
    time_s, phase = (float(result.trace[name][rows[0]]) for name in ("time", "phase"))
    return Place(time_s=time_s, phase=result.phases[int(phase)])


def common_peaks(result: RunRecord) -> dict[str, Vector]:
    """Return the signal (rows,) of which each metric of any task is the largest value."""
    trace = result.trace
    return {
        "ik_residual_max": np.abs(trace["ik_position"]),
        "ik_rotation_residual_max": np.abs(trace["ik_rotation"]),
        **after_stop_signals(result),
    }
