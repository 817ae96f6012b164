"""What a recording shows beside the run's trace: its metrics and what beam theory predicts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualbend.evaluation.metrics import WALL_CLOCK
from dualbend.evaluation.recorded_rod import reference_moments
from dualbend.evaluation.sheet import no_theory
from dualbend.recording.layers import layers_of
from dualbend.recording.log import FRAME_CYCLES
from dualbend.recording.notes import Notes
from dualbend.run.record import RunRecord


def notes_of(result: RunRecord) -> Notes:
    """Return the run's metrics and, every third cycle, the rod's moment on the left grip.

    At the sheet's own edges, so that the pads' compliance is not in the difference. None of a sheet
    that may yield, which the elastic rod does not know.
    """
    metrics = result.metrics.items()
    named = {name: (m.value, m.unit) for name, m in metrics if name not in WALL_CLOCK}
    predicted = np.full(result.trace.rows, np.nan)
    rows = np.arange(0) if no_theory(result.scenario) else _predictable(result)
    if rows.size:
        predicted[rows] = reference_moments(result, "edge", rows)
    return Notes(metrics=named, predicted_moment=predicted)


def _predictable(result: RunRecord) -> NDArray[np.intp]:
    last = result.trace.rows - 1
    rows = (
        np.unique(np.append(np.arange(0, last, FRAME_CYCLES), last)) if last >= 0 else np.arange(0)
    )
    return layers_of(result).predictable(result, rows)
