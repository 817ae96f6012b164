"""The numbers of a run, each with its unit: what a summary holds and what CI can gate on."""

from __future__ import annotations

import importlib.metadata
import math
import platform
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy import signal

from dualbend.arm.joint_limits import arm_room
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.evaluation.assembly import hole_table, middle_spacing, phase_table, pin_table, seated
from dualbend.evaluation.sheet import sheet_report
from dualbend.planning.plan import plan_assembly
from dualbend.run.arms import arm_pair
from dualbend.run.loop import RunResult
from dualbend.run.permanent_set import permanent_curvature
from dualbend.scenario.motion import PHASES
from dualbend.scenario.scenario import Scenario
from dualbend.types import SIDES, Vector

OSCILLATION_ABOVE_HZ = 1.0
"""What the moment does faster than this is oscillation: a linear piece of the path lasts longer."""

OSCILLATION_WINDOW_S = 1.0
_SHORTEST_RECORD = round(OSCILLATION_WINDOW_S / COMMAND_PERIOD_S)
_FEWEST_EXTREMES = 3
_NOTICEABLE = 0.3


_SET_UNITS = {
    "permanent_curvature": "1/m",
    "permanent_end_slope": "rad",
    "curvature_before_release": "1/m",
}
"""Largest curvature that is kept; slope of the free sheet's ends; the largest it had there."""


_OUT_OF_PLANE = {
    "peak_lateral_force": "true_force_y",
    "peak_twist_moment": "true_moment_x",
    "peak_yaw_moment": "true_moment_z",
}


class Metric(msgspec.Struct, frozen=True):
    """A value, or one a piece, and its unit; null where the run was too short to tell."""

    value: float | list[float | None] | None
    unit: str


def bending_rows(result: RunResult) -> NDArray[np.bool_]:
    """Return which rows of the trace belong to the bending phase (rows,)."""
    return np.asarray(result.trace["phase"] == PHASES.index("bend"))


def sensing_column(result: RunResult, name: str) -> Vector:
    """Return a column of the first sensing arm, e.g. ``true_moment_y`` (rows,)."""
    return result.trace[f"{first_sensing_side(result)}_{name}"]


def first_sensing_side(result: RunResult) -> str:
    """Return the sensing arm that the summary speaks of: the left one where both sense."""
    return next(side for side in SIDES if side in result.scenario.compliance.sensing)


def compute_metrics(result: RunResult) -> dict[str, Metric]:
    """Return the metrics of a run.

    Moments and forces are true ones, of the sheet on the sensing arm about its gripper centre,
    during bending.
    """
    rows = bending_rows(result)
    moment = sensing_column(result, "true_moment_y")[rows]
    force = np.hypot(
        sensing_column(result, "true_force_x")[rows], sensing_column(result, "true_force_z")[rows]
    )
    oscillation, frequency, growth = oscillation_of(moment)
    trace, wall = result.trace, result.wall_time_s
    plastic = permanent_set(result) if result.scenario.sheet.plastic else {}
    return {
        **plastic,
        "peak_moment": Metric(_peak(moment), "N m"),
        "rms_moment": Metric(_finite(np.sqrt(np.mean(moment**2))) if moment.size else None, "N m"),
        "peak_moment_by_piece": Metric([_finite(p) for p in peak_by_piece(result)], "N m"),
        "peak_force": Metric(_peak(force), "N"),
        **_out_of_plane(result),
        "oscillation": Metric(oscillation, "N m"),
        "oscillation_frequency": Metric(frequency, "Hz"),
        "oscillation_growth": Metric(growth, "1/s"),
        "peak_deviation_x": Metric(_peak(sensing_column(result, "deviation_x")), "m"),
        "peak_deviation_alpha": Metric(_peak(sensing_column(result, "deviation_alpha")), "rad"),
        "peak_surface_strain": Metric(_peak(surface_strain(result)), "1"),
        "ik_residual_max": Metric(_peak(trace["ik_position"]), "m"),
        "ik_rotation_residual_max": Metric(_peak(trace["ik_rotation"]), "rad"),
        "saturated_cycles": Metric(float(np.nansum(trace["saturated"])), "1"),
        "simulated_time": Metric(result.simulated_s, "s"),
        "realtime_factor": Metric(result.simulated_s / wall, "1"),
        "wall_time": Metric(wall, "s"),
    }


def out_of_plane_columns(scenario: Scenario) -> dict[str, str]:
    """Return the columns of the peaks that only misaligned grips have, by metric.

    Components in the sensing arm's bending frame: across the sheet, and about x (inward, twist) and
    z (up). Without misalignment they are rounding alone, and there are none.
    """
    return {} if scenario.misalignment is None else _OUT_OF_PLANE


def _out_of_plane(result: RunResult) -> dict[str, Metric]:
    rows = bending_rows(result)
    return {
        name: Metric(_peak(sensing_column(result, column)[rows]), "N" if "force" in name else "N m")
        for name, column in out_of_plane_columns(result.scenario).items()
    }


def peak_by_piece(result: RunResult) -> list[float]:
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


def surface_strain(result: RunResult) -> Vector:
    """Return the largest surface strain of each row, ε = |Δθ| t / (2 h) (rows,)."""
    config, sheet = result.scenario.sheet, result.scenario.sheet.sheet()
    spacing = sheet.length_m / config.model.sections
    curvature = np.abs(result.trace.bends).max(axis=1, initial=0.0) / spacing
    return np.asarray(curvature * sheet.thickness_m / 2.0)


def permanent_set(result: RunResult) -> dict[str, Metric]:
    """Return what a sheet that yields keeps at the end of the run, were it let go."""
    kept = permanent_curvature(result)
    sheet = result.scenario.sheet
    if not kept.size:
        return {name: Metric(None, unit) for name, unit in _SET_UNITS.items()}
    last = np.abs(kept[-1])
    strained = np.abs(result.trace.bends).max(axis=0) * sheet.model.sections / sheet.length_m
    slope = float(abs(kept[-1].sum())) * sheet.length_m / sheet.model.sections / 2.0
    numbers = (float(last.max()), slope, float(strained[np.argmax(last)]))
    return {
        name: Metric(_finite(number), unit)
        for (name, unit), number in zip(_SET_UNITS.items(), numbers, strict=True)
    }


def oscillation_of(moment: Vector) -> tuple[float | None, float | None, float | None]:
    """Return amplitude [N m], frequency [Hz] and growth rate [1/s] of a moment's oscillation.

    The moment (rows,), one a command cycle, is passed forward and backward through a high-pass of
    second order at 1 Hz. Amplitude: √2 times the largest root mean square over 1 s. Frequency: from
    the mean distance of the extremes of at least 0.3 of the largest; None below 1 Hz, where they
    are the path's own knots. Growth: slope of the logarithm of the extremes that grow one after
    the other up to the largest; 0 where fewer than three do. Meaningful where a piece of the path
    lasts longer than 1 s. All None where the record is too short.
    """
    if moment.size < _SHORTEST_RECORD:
        return None, None, None
    rate = 1.0 / COMMAND_PERIOD_S
    sections = signal.butter(2, OSCILLATION_ABOVE_HZ, "highpass", fs=rate, output="sos")
    fast = np.asarray(signal.sosfiltfilt(sections, moment))
    window = np.ones(round(OSCILLATION_WINDOW_S * rate))
    power = np.convolve(fast**2, window / window.size, mode="valid")
    amplitude = math.sqrt(2.0 * float(power.max()))
    at, _ = signal.find_peaks(np.abs(fast))
    heights = np.abs(fast)[at]
    if at.size < _FEWEST_EXTREMES:
        return amplitude, None, 0.0
    noticeable = at[heights >= _NOTICEABLE * heights.max()]
    frequency = None
    if noticeable.size >= _FEWEST_EXTREMES:
        frequency = 0.5 / (float(np.mean(np.diff(noticeable))) * COMMAND_PERIOD_S)
    if frequency is None or frequency < OSCILLATION_ABOVE_HZ:
        return amplitude, None, 0.0
    return amplitude, frequency, _growth(np.asarray(at * COMMAND_PERIOD_S), heights)


def _growth(times_s: NDArray[np.floating], heights: NDArray[np.floating]) -> float:
    last = int(np.argmax(heights))
    first = last
    while first > 0 and heights[first - 1] < heights[first]:
        first -= 1
    if last - first + 1 < _FEWEST_EXTREMES:
        return 0.0
    run = slice(first, last + 1)
    return float(np.polyfit(times_s[run], np.log(heights[run]), 1)[0])


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    packages = ("dualbend", "mujoco", "numpy", "scipy", "mink", "daqp", "rerun-sdk")
    found = {name: importlib.metadata.version(name) for name in packages}
    return {"python": platform.python_version(), **found}


def assembly_metrics(result: RunResult) -> dict[str, Metric]:
    """Return the metrics of an assembly; forces and moments are those of all phases."""
    phases, holes, pins = phase_table(result), hole_table(result), pin_table(result)
    config, sheet = result.scenario.assembly, result.scenario.sheet.sheet()
    assert config is not None
    spacing = middle_spacing(result)
    if spacing is not None:
        plan = plan_assembly(sheet, config.layout.holes, config.layout.pins)
        spacing -= plan.spacing_m(result.scenario.path.end_rad)
    trace, wall = result.trace, result.wall_time_s
    return {
        "holes_seated": Metric(float(seated(result).sum()), "1"),
        "worst_hole_offset": Metric(_largest(holes, "offset_m"), "m"),
        "worst_hole_height": Metric(_largest(holes, "height_m"), "m"),
        "peak_pin_force": Metric(_largest(pins, "peak_force_n"), "N"),
        "peak_edge_force": Metric(_largest(pins, "peak_edge_force_n"), "N"),
        "peak_moment": Metric(_largest(phases, "peak_moment_nm"), "N m"),
        "peak_force": Metric(_largest(phases, "peak_force_n"), "N"),
        "peak_surface_strain": Metric(_peak(surface_strain(result)), "1"),
        "yield_strain": Metric(result.scenario.limit_strain, "1"),
        "middle_spacing_error": Metric(spacing, "m"),
        "retries": Metric(
            float(sum(p["attempt"] > 0 for p in phases if "lower" in p["phase"])), "1"
        ),
        "ik_residual_max": Metric(_peak(trace["ik_position"]), "m"),
        "saturated_cycles": Metric(float(np.nansum(trace["saturated"])), "1"),
        "simulated_time": Metric(result.simulated_s, "s"),
        "realtime_factor": Metric(result.simulated_s / wall, "1"),
        "wall_time": Metric(wall, "s"),
    }


def _largest(rows: list[dict[str, Any]], key: str) -> float | None:
    values = [row[key] for row in rows if row[key] is not None]
    return max(abs(value) for value in values) if values else None


def summary(result: RunResult) -> dict[str, Any]:
    """Return what ``summary.json`` holds."""
    if result.scenario.assembly is None:
        metrics, tables = compute_metrics(result), {}
    else:
        metrics = assembly_metrics(result)
        tables = {
            "phases": phase_table(result),
            "holes": hole_table(result),
            "pins": pin_table(result),
        }
    return {
        "scenario": result.scenario.name,
        "seed": result.scenario.seed,
        "outcome": result.outcome,
        "reason": result.reason,
        **({"controller": result.controller} if result.controller else {}),
        "versions": versions(),
        "sheet": msgspec.to_builtins(sheet_report(result.scenario)),
        "metrics": {name: msgspec.to_builtins(metric) for name, metric in metrics.items()},
        "arms": msgspec.to_builtins(arm_room(arm_pair(result.scenario), result.trace.setpoints)),
        **tables,
    }


def _peak(values: Vector) -> float | None:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else None


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


WALL_CLOCK = frozenset({"wall_time", "realtime_factor"})
"""Metrics of the machine, not of the run: never in a baseline."""
