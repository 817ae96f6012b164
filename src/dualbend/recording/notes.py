"""The texts of a recording, and what an analysis of the run adds to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dualbend.evaluation.metrics import WALL_CLOCK
from dualbend.evaluation.recorded_rod import reference_moments
from dualbend.evaluation.sheet import no_theory
from dualbend.recording.layers import layers_of
from dualbend.recording.log import frame_cycles
from dualbend.recording.scales import Scales
from dualbend.run.record import Metric, RunRecord
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class Notes:
    """What is known of a run beside its trace.

    ``metrics``: those of the run, not of the machine. ``predicted_moment``: of an ideal sheet on
    the left grip at the recorded poses (rows,) [N m]; NaN where none was computed.
    """

    metrics: Mapping[str, Metric]
    predicted_moment: Vector


def notes_of(result: RunRecord) -> Notes:
    """Return the run's metrics and, at the scene's frames, the rod's moment on the left grip.

    At the sheet's own edges, so that the pads' compliance is not in the difference. None of a sheet
    that may yield, which the elastic rod does not know.
    """
    metrics = {name: m for name, m in result.metrics.items() if name not in WALL_CLOCK}
    count = result.trace.rows
    predicted = np.full(count, np.nan)
    if count and not no_theory(result.scenario):
        shown = np.unique(
            np.append(np.arange(0, count, frame_cycles(result.scenario.period_s)), count - 1)
        )
        rows = layers_of(result).predictable(result, shown)
        if rows.size:
            predicted[rows] = reference_moments(result, "edge", rows)
    return Notes(metrics=metrics, predicted_moment=predicted)


_NOT_PREDICTED = (
    " No moment is predicted: the sheet may yield (sheet.plastic), which the elastic theory does "
    "not know."
)


def guide(result: RunRecord, scales: Scales) -> str:
    """Return how to read the recording, in Markdown."""
    limit, layers = f"{scales.moment_range_n_m:g}", layers_of(result)
    scenario, period_ms = result.scenario, round(1e3 * result.scenario.period_s, 6)
    predicted = _NOT_PREDICTED if scenario.sheet.plastic else layers.predicted
    return "\n".join(
        (
            layers.guide + predicted,
            "",
            f"* sheet: bending moment, −{limit} N m blue, 0 grey, +{limit} N m red",
            f"* yellow arrow: force of the sheet on the grip, {1e3 * scales.force_m_per_n:g} mm/N;"
            " towards the grip it is a push",
            f"* violet arrow: its moment about the grip, {scales.torque_m_per_n_m:g} mm/(N mm)",
            "* axes at the grip: short as it is, long as commanded",
            "* path of the grip: grey nominal, green commanded with compliance",
            *layers.legend,
            f"* moments, forces, angles, deviations: every {period_ms:g} ms; scene, path, torques: "
            f"every {frame_cycles(scenario.period_s) * period_ms:g} ms; everything: trace.parquet",
        )
    )


def story(result: RunRecord, notes: Notes | None, *, ended: bool = True) -> str:
    """Return how the run ended and its metrics, in Markdown."""
    scenario = result.scenario
    reason = [f"**{result.reason}**\n"] if result.reason else []
    how = words(result.outcome) if ended else "running"
    lines = [f"## {scenario.name}: {how}", *reason, scenario.description]
    if ended:
        cycles = f"{result.simulated_s:.3f} s in {result.trace.rows} cycles"
        lines.append(f"\n{cycles}, seed {scenario.seed}\n")
    if notes is not None:
        rows = [row for k, m in notes.metrics.items() for row in _rows(k, m.value, m.unit)]
        lines += ["| metric | value |", "|---|---:|", *rows]
    return "\n".join(lines)


def _rows(name: str, value: float | list[float | None] | None, unit: str) -> list[str]:
    if isinstance(value, list):
        return [row for i, v in enumerate(value, start=1) for row in _rows(f"{name} {i}", v, unit)]
    shown = "–" if value is None else f"{value:.4g}"
    return [f"| {name.replace('_', ' ')} [{unit}] | {shown} |"]


def words(outcome: str) -> str:
    """Return an outcome as it is spoken."""
    return outcome.replace("_", " ")
