"""The texts of a recording, and what an analysis of the run adds to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.recording.layers import layers_of
from dualbend.recording.log import FRAME_CYCLES
from dualbend.recording.scales import Scales
from dualbend.run.record import RunRecord
from dualbend.types import Vector

_PERIOD_MS = round(1e3 * COMMAND_PERIOD_S)

Value = float | Sequence[float | None] | None


@dataclass(frozen=True, kw_only=True)
class Notes:
    """What is known of a run beside its trace.

    Parameters
    ----------
    metrics
        Value and unit by name.
    predicted_moment
        The moment of an ideal sheet on the left grip at the recorded poses (rows,) [N m]; NaN where
        none was computed.
    """

    metrics: Mapping[str, tuple[Value, str]]
    predicted_moment: Vector


_NOT_PREDICTED = (
    " No moment is predicted: the sheet may yield (sheet.plastic), which the elastic theory does "
    "not know."
)


def guide(result: RunRecord, scales: Scales) -> str:
    """Return how to read the recording, in Markdown."""
    limit, layers = f"{scales.moment_range_n_m:g}", layers_of(result)
    predicted = _NOT_PREDICTED if result.scenario.sheet.plastic else layers.predicted
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
            f"* moments, forces, angles, deviations: every {_PERIOD_MS} ms; scene, path, torques: "
            f"every {FRAME_CYCLES * _PERIOD_MS} ms; everything: trace.parquet",
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
        rows = [row for k, (v, unit) in notes.metrics.items() for row in _rows(k, v, unit)]
        lines += ["| metric | value |", "|---|---:|", *rows]
    return "\n".join(lines)


def _rows(name: str, value: Value, unit: str) -> list[str]:
    if isinstance(value, Sequence):
        return [row for i, v in enumerate(value, start=1) for row in _rows(f"{name} {i}", v, unit)]
    shown = "–" if value is None else f"{value:.4g}"
    return [f"| {name.replace('_', ' ')} [{unit}] | {shown} |"]


def words(outcome: str) -> str:
    """Return an outcome as it is spoken."""
    return outcome.replace("_", " ")
