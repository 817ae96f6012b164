"""Where a run's peaks are: the row, and with it the time and phase, of each metric that has one."""

from __future__ import annotations

import msgspec
import numpy as np

from dualbend.evaluation.metrics import (
    Metric,
    bending_rows,
    first_sensing_side,
    out_of_plane_columns,
    sensing_column,
    surface_strain,
)
from dualbend.run.loop import RunResult
from dualbend.scene.bed.config import HOLES
from dualbend.types import SIDES, Vector


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """A row of a run: simulated time [s] and the phase that it belongs to."""

    time_s: float
    phase: str

    def __str__(self) -> str:
        """Say it in words."""
        return f"at {self.time_s:.3f} s, {self.phase}"


def peak_places(result: RunResult, metrics: dict[str, Metric]) -> dict[str, list[Place | None]]:
    """Return where each peak of a run is, an entry for each element of the metric.

    A peak is found again as the row whose signal has exactly the metric's value, so that it cannot
    be another peak than the metric's. Metrics that are no peaks are left out; None where the run
    has no such row, and for a peak of 0, which is everywhere.
    """
    signals = _bending_signals(result) if result.scenario.assembly is None else _assembly(result)
    places = {}
    for name, signal in signals.items():
        value = metrics[name].value
        values = value if isinstance(value, list) else [value]
        places[name] = [_place(result, signal, item) for item in values]
    return places


def last_place(result: RunResult) -> Place | None:
    """Return the last row that was recorded; None where there is none."""
    return _at(result, result.trace.rows - 1) if result.trace.rows else None


def _place(result: RunResult, signal: Vector, value: float | None) -> Place | None:
    if not value:
        return None
    rows = np.flatnonzero(signal == value)
    return _at(result, int(rows[0])) if rows.size else None


def _at(result: RunResult, row: int) -> Place:
    trace = result.trace
    return Place(time_s=float(trace["time"][row]), phase=result.phases[int(trace["phase"][row])])


def _bending_signals(result: RunResult) -> dict[str, Vector]:
    """Return the signal (rows,) whose largest value each metric of a bending run is."""
    trace, rows = result.trace, bending_rows(result)

    def bending(values: Vector) -> Vector:
        return np.where(rows, values, np.nan)

    moment = bending(np.abs(sensing_column(result, "true_moment_y")))
    force = np.hypot(sensing_column(result, "true_force_x"), sensing_column(result, "true_force_z"))
    side = first_sensing_side(result)
    return {
        "peak_moment": moment,
        "peak_moment_by_piece": moment,
        "peak_force": bending(force),
        **{
            name: bending(np.abs(sensing_column(result, column)))
            for name, column in out_of_plane_columns(result.scenario).items()
        },
        "peak_deviation_x": np.abs(trace[f"{side}_deviation_x"]),
        "peak_deviation_alpha": np.abs(trace[f"{side}_deviation_alpha"]),
        "peak_surface_strain": surface_strain(result),
        "ik_residual_max": np.abs(trace["ik_position"]),
        "ik_rotation_residual_max": np.abs(trace["ik_rotation"]),
    }


def _assembly(result: RunResult) -> dict[str, Vector]:
    """Return the same for an assembly, whose peaks are those of all phases and both arms."""
    trace = result.trace
    forces = [[trace[f"{side}_true_force_{axis}"] for axis in "xyz"] for side in SIDES]
    return {
        "peak_moment": np.max([np.abs(trace[f"{side}_true_moment_y"]) for side in SIDES], axis=0),
        "peak_force": np.max([np.linalg.norm(force, axis=0) for force in forces], axis=0),
        "peak_pin_force": np.max([trace[f"pin_force_{hole}"] for hole in HOLES], axis=0),
        "peak_edge_force": np.max([trace[f"edge_force_{hole}"] for hole in HOLES], axis=0),
        "peak_surface_strain": surface_strain(result),
        "ik_residual_max": np.abs(trace["ik_position"]),
    }
