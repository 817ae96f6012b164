"""The numbers of a run, each with its unit: what a summary holds and what CI can gate on."""

from __future__ import annotations

import importlib.metadata
import math
import platform
from collections.abc import Mapping, Sequence
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from dualbend.run.record import Metric, RunRecord, TableRow
from dualbend.scenario.motion import PHASES
from dualbend.types import SIDES, Vector


def bending_rows(result: RunRecord) -> NDArray[np.bool_]:
    """Return which rows of the trace belong to the bending phase (rows,)."""
    return np.asarray(result.trace["phase"] == PHASES.index("bend"))


def held_rows(result: RunRecord) -> NDArray[np.bool_]:
    """Return which rows belong to the second half of the hold after bending (rows,).

    In the first half the arms arrive, and their servos' integral action settles.
    """
    held = np.flatnonzero(result.trace["phase"] == PHASES.index("hold"))
    rows = np.zeros(result.trace.rows, dtype=np.bool_)
    rows[held[held.size // 2 :]] = True
    return rows


def sensing_column(result: RunRecord, name: str) -> Vector:
    """Return a column of the first sensing arm, e.g. ``true_moment_y`` (rows,)."""
    return result.trace[f"{result.sensing_side}_{name}"]


def common_metrics(result: RunRecord) -> dict[str, Metric]:
    """Return the metrics that a run of any task has.

    ``stale_commands``, of a run whose link makes errors: the cycles in which the left and the right
    arm executed no command of that cycle.
    """
    trace, wall = result.trace, result.wall_time_s
    ages = [trace[f"{side}_command_age"] for side in SIDES if f"{side}_command_age" in trace]
    stale: list[float | None] = [float(np.count_nonzero(age > 0.0)) for age in ages]
    after = after_stop_signals(result)
    slips = {f"{side}_slip": trace[f"{side}_slip"] for side in SIDES if f"{side}_slip" in trace}
    return {
        **{f"peak_{name}": Metric(peak(slip), "m") for name, slip in slips.items()},
        **{name: Metric(peak(after[name]), unit) for name, unit in _AFTER_STOP.items() if after},
        "ik_residual_max": Metric(peak(trace["ik_position"]), "m"),
        "ik_rotation_residual_max": Metric(peak(trace["ik_rotation"]), "rad"),
        "unintended_contacts": Metric(
            float(len(result.contacts)),
            "1",
            "; ".join(f"{contact} at {contact.time_s:.3f} s" for contact in result.contacts),
        ),
        "saturated_cycles": Metric(float(np.nansum(trace["saturated"])), "1"),
        **({"stale_commands": Metric(stale, "1")} if stale else {}),
        "simulated_time": Metric(result.simulated_s, "s"),
        "realtime_factor": Metric(result.simulated_s / wall, "1"),
        "wall_time": Metric(wall, "s"),
    }


def after_stop_signals(result: RunRecord) -> dict[str, Vector]:
    """Return what the sheet bears after a protective stop (rows,), NaN before; {} without one.

    The larger one of both grips' forces and moments, and the surface strain.
    """
    trace, rows = result.trace, result.stopped
    if not rows.any():
        return {}
    parts = {
        part: np.max(
            [np.sqrt(sum(trace[f"{side}_true_{part}_{a}"] ** 2 for a in "xyz")) for side in SIDES],
            axis=0,
        )
        for part in ("force", "moment")
    }
    signals = (parts["force"], parts["moment"], surface_strain(result))
    return {
        name: np.where(rows, signal, np.nan)
        for name, signal in zip(_AFTER_STOP, signals, strict=True)
    }


_AFTER_STOP = {
    "after_stop_peak_force": "N",
    "after_stop_peak_moment": "N m",
    "after_stop_peak_strain": "1",
}


def peak_by_piece(result: RunRecord) -> list[float]:
    """Return the largest |moment| while the nominal angle is in each piece of the path [N m].

    The arms lag behind the nominal angle by 2ξ/ω_n, so pieces that last no longer than that hold
    the end of the moment of the one before. NaN for a piece that is shorter than a cycle.
    """
    scenario, rows = result.scenario, bending_rows(result)
    knots = scenario.path.make(scenario.sheet.length_m).knots
    alpha = result.trace["nominal_alpha"][rows]
    moment = np.abs(sensing_column(result, "true_moment_y")[rows])
    piece = np.clip(np.searchsorted(knots, alpha, side="right") - 1, 0, len(knots) - 2)
    reached = range(int(piece.max()) + 1) if piece.size else ()
    parts = (moment[piece == k] for k in reached)
    return [float(part.max()) if part.size else math.nan for part in parts]


def surface_strain(result: RunRecord) -> Vector:
    """Return the largest surface strain of each row, of the true sheet (rows,)."""
    return result.scenario.true_sheet.surface_strain(result.trace.bends)


def side_by_side(
    runs: Sequence[Mapping[str, Metric]],
) -> dict[tuple[str, str], tuple[float | None, ...]]:
    """Return the metrics of several runs by name and unit: a value of each run, None without one.

    A metric of several values is ``name[0]``, ``name[1]`` …, and beside each other.
    """
    found = {}
    for name in dict.fromkeys(name for metrics in runs for name in metrics):
        own = [metrics.get(name) for metrics in runs]
        several = any(isinstance(metric.value, list) for metric in own if metric)
        for unit in dict.fromkeys(metric.unit for metric in own if metric):
            values = (listed(metric) if metric and metric.unit == unit else () for metric in own)
            for i, of_runs in enumerate(zip_longest(*values)):
                found[f"{name}[{i}]" if several else name, unit] = of_runs
    return found


def listed(metric: Metric) -> Sequence[float | None]:
    """Return the values of a metric, also where it has only one."""
    return metric.value if isinstance(metric.value, list) else (metric.value,)


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    packages = ("dualbend", "mujoco", "numpy", "scipy", "mink", "daqp", "rerun-sdk")
    found = {name: importlib.metadata.version(name) for name in packages}
    return {"python": platform.python_version(), **found}


def no_tables(_: RunRecord) -> dict[str, list[TableRow]]:
    """Return the tables beside the metrics of a task that has none."""
    return {}


def peak(values: Vector) -> float | None:
    """Return the largest |value| that is a number; None where there is none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else None


def finite(value: float) -> float | None:
    """Return the value, None where it is no number."""
    return float(value) if math.isfinite(value) else None


COMMON_METRICS = (
    "ik_residual_max",
    "ik_rotation_residual_max",
    "saturated_cycles",
    "stale_commands",
    "unintended_contacts",
    "simulated_time",
)
"""Metrics that a run of any task may have, but for those of the machine."""

WALL_CLOCK = frozenset({"wall_time", "realtime_factor"})
"""Metrics of the machine, not of the run: never in a baseline."""
