"""What a recording shows beside the run's trace: its metrics and what beam theory predicts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualbend.evaluation.metrics import WALL_CLOCK, summary
from dualbend.evaluation.recorded_rod import oracle_moments
from dualbend.evaluation.sheet import no_oracle
from dualbend.recording.log import FRAME_CYCLES
from dualbend.recording.notes import Notes
from dualbend.run.loop import RunResult
from dualbend.task.assembly.motions import PHASES

_HANGS_BENT = ("bend", "lower", "seat middle", "unfold")
"""Phases of an assembly in which the sheet is a rod between two grips, and bent.

Flat, between grips as far apart as it is long, its moment hangs on micrometres.
"""

_LEAST_BEND_RAD = 0.02


def notes_of(result: RunResult, numbers: Mapping[str, Any] | None = None) -> Notes:
    """Return the run's metrics and, every third cycle, the rod oracle's moment on the left grip.

    At the sheet's own edges, so that the pads' compliance is not in the difference. None of a sheet
    that may yield, which the elastic rod does not know. ``numbers`` is what
    :func:`~dualbend.evaluation.metrics.summary` returned, where that is known already.
    """
    metrics = (summary(result) if numbers is None else numbers)["metrics"]
    named = {k: (m["value"], m["unit"]) for k, m in metrics.items() if k not in WALL_CLOCK}
    predicted = np.full(result.trace.rows, np.nan)
    rows = np.arange(0) if no_oracle(result.scenario) else _predictable(result)
    if rows.size:
        predicted[rows] = oracle_moments(result, "edge", rows)
    return Notes(metrics=named, predicted_moment=predicted)


def _predictable(result: RunResult) -> NDArray[np.intp]:
    last = result.trace.rows - 1
    rows = (
        np.unique(np.append(np.arange(0, last, FRAME_CYCLES), last)) if last >= 0 else np.arange(0)
    )
    if result.scenario.assembly is None:
        return rows
    trace = result.trace
    phases = [PHASES.index(phase) for phase in _HANGS_BENT]
    bent = trace["left_grip_alpha"][rows] > _LEAST_BEND_RAD
    return rows[np.isin(trace["phase"][rows], phases) & bent]
