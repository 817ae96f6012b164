"""The metrics of a bending run: moments and forces on the sensing arm while it bends."""

from __future__ import annotations

import numpy as np

from dualbend.evaluation.metrics import (
    bending_rows,
    common_metrics,
    finite,
    held_rows,
    peak,
    peak_by_piece,
    sensing_column,
    surface_strain,
)
from dualbend.evaluation.oscillation import oscillation_of
from dualbend.evaluation.peaks import common_peaks
from dualbend.evaluation.permanent_set import permanent_curvature
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.task.bending.config import is_in_space
from dualbend.types import Vector

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


def metrics(result: RunRecord) -> dict[str, Metric]:
    """Return the metrics of a run.

    Moments and forces are true ones, of the sheet on the sensing arm about its gripper centre,
    during bending. ``mean_moment_hold`` is |mean of M| over the second half of the hold: what is
    left once the arms stand, without the noise that the reading shakes them with.
    """
    signals, scenario = peaks(result), result.scenario
    bending = bending_rows(result)
    whole = sensing_column(result, "true_moment_y")
    moment, held = whole[bending], whole[held_rows(result)]
    at_bounds = result.trace["saturated"][bending] > 0.0
    found = oscillation_of(moment, scenario.period_s, at_bounds)

    def largest(name: str, unit: str) -> Metric:
        return Metric(peak(signals[name]), unit)

    return {
        **(permanent_set(result) if scenario.sheet.plastic else {}),
        "peak_moment": largest("peak_moment", "N m"),
        "rms_moment": Metric(finite(np.sqrt(np.mean(moment**2))) if moment.size else None, "N m"),
        "peak_moment_by_piece": Metric([finite(p) for p in peak_by_piece(result)], "N m"),
        "mean_moment_hold": Metric(abs(float(held.mean())) if held.size else None, "N m"),
        "peak_force": largest("peak_force", "N"),
        **{
            name: largest(name, "N" if "force" in name else "N m")
            for name in out_of_plane_columns(scenario)
        },
        "oscillation": Metric(found.amplitude_nm, "N m"),
        "oscillation_frequency": Metric(
            found.frequency_hz, "Hz", found.reason if found.frequency_hz is None else ""
        ),
        "oscillation_growth": Metric(found.growth_per_s, "1/s", found.reason),
        "peak_deviation_x": largest("peak_deviation_x", "m"),
        "peak_deviation_alpha": largest("peak_deviation_alpha", "rad"),
        "peak_surface_strain": largest("peak_surface_strain", "1"),
        **common_metrics(result),
    }


def out_of_plane_columns(scenario: Scenario) -> dict[str, str]:
    """Return the columns of the peaks that only grips out of the plane have, by metric.

    Components in the sensing arm's bending frame: across the sheet, and about x (inward, twist) and
    z (up). In the plane they are rounding alone, and there are none.
    """
    return _OUT_OF_PLANE if is_in_space(scenario) else {}


def permanent_set(result: RunRecord) -> dict[str, Metric]:
    """Return what a sheet that yields keeps at the end of the run, were it let go."""
    kept, sheet = permanent_curvature(result), result.scenario.sheet
    if not kept.size:
        return {name: Metric(None, unit) for name, unit in _SET_UNITS.items()}
    last = np.abs(kept[-1])
    strained = np.abs(result.trace.bends).max(axis=0) * sheet.model.sections / sheet.length_m
    slope = float(abs(kept[-1].sum())) * sheet.length_m / sheet.model.sections / 2.0
    numbers = (float(last.max()), slope, float(strained[np.argmax(last)]))
    return {
        name: Metric(finite(number), unit)
        for (name, unit), number in zip(_SET_UNITS.items(), numbers, strict=True)
    }


def peaks(result: RunRecord) -> dict[str, Vector]:
    """Return the signal (rows,) whose largest value each metric of a bending run is."""
    rows = bending_rows(result)

    def size(column: str) -> Vector:
        return np.abs(sensing_column(result, column))

    def bending(values: Vector) -> Vector:
        return np.where(rows, values, np.nan)

    moment = bending(size("true_moment_y"))
    return {
        "peak_moment": moment,
        "peak_moment_by_piece": moment,
        "peak_force": bending(np.hypot(size("true_force_x"), size("true_force_z"))),
        **{
            name: bending(size(column))
            for name, column in out_of_plane_columns(result.scenario).items()
        },
        "peak_deviation_x": size("deviation_x"),
        "peak_deviation_alpha": size("deviation_alpha"),
        "peak_surface_strain": surface_strain(result),
        **common_peaks(result),
    }
