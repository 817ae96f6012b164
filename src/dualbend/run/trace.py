"""The trace of a run: one row a command cycle, one named column with its unit a quantity."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from dualbend.control.controller import Command
from dualbend.control.controller import Observation as Observed
from dualbend.control.force_torque import WrenchReading
from dualbend.control.wrist import arm_slice
from dualbend.errors import InputError
from dualbend.scene.ik import IKSolution
from dualbend.scene.observation import Observation
from dualbend.types import SIDES, Mask, Vector

WALL_CLOCK_COLUMNS = ("wall_s",)
"""Columns that differ between two runs of one seed."""

_POSE = (("x", "m"), ("y", "m"), ("z", "m"), ("alpha", "rad"))
_COMMAND = (("x", "m"), ("z", "m"), ("alpha", "rad"))
_DEVIATION, _REST = _POSE[::3], (*_POSE[1:3], ("roll", "rad"), ("yaw", "rad"))
_WRENCH = tuple((f"force_{a}", "N") for a in "xyz") + tuple((f"moment_{a}", "N m") for a in "xyz")
_READING = len(_WRENCH) + 4


def _joint_columns(joints: Mapping[str, bool], kind: str, *units: str) -> list[tuple[str, str]]:
    """Return ``left_q_joint1`` for ``left_joint1``, with the unit of a hinge or of a slide."""
    return [(name.replace("_", f"_{kind}_", 1), units[slides]) for name, slides in joints.items()]


def trace_columns(
    sensing: Sequence[int],
    hinges: int,
    joints: Mapping[str, bool],
    task: Sequence[tuple[str, str]] = (),
    *,
    link: bool = False,
    slips: bool = False,
    in_space: bool = False,
) -> dict[str, list[tuple[str, str]]]:
    """Return names and units of a trace's columns in their order, those of one origin together.

    The parameters are those of :class:`TraceRecorder`.
    """
    grip = [("force_x", "N"), ("moment_y", "N m")]
    readings = (("sensor", _WRENCH), ("measured", grip), ("filtered", grip))
    return {
        "clock": [("time", "s"), ("phase", "1")],
        "nominal": [("nominal_alpha", "rad"), ("nominal_half_distance", "m"), ("nominal_z", "m")],
        "grip": [(f"{side}_grip_{part}", unit) for side in SIDES for part, unit in _POSE],
        "edge": [(f"{side}_edge_{part}", unit) for side in SIDES for part, unit in _POSE],
        "true": [(f"{side}_true_{part}", unit) for side in SIDES for part, unit in _WRENCH],
        "sag": [("sag", "m")],
        "bend": [(f"bend_{i:03d}", "rad") for i in range(hinges)],
        "deviation": [(f"{s}_deviation_{part}", unit) for s in SIDES for part, unit in _DEVIATION],
        "rest": [(f"{s}_deviation_{name}", u) for s in SIDES for name, u in _REST if in_space],
        "command": [(f"{side}_command_{part}", unit) for side in SIDES for part, unit in _COMMAND],
        "q": _joint_columns(joints, "q", "rad", "m"),
        "setpoint": _joint_columns(joints, "setpoint", "rad", "m"),
        "torque": _joint_columns(joints, "torque", "N m", "N"),
        "ik": [("ik_position", "m"), ("ik_rotation", "rad"), ("ik_iterations", "1")],
        **{
            f"reading{i}": [
                (f"{SIDES[i]}_{kind}_{part}", unit)
                for kind, parts in readings
                for part, unit in parts
            ]
            for i in sensing
        },
        "saturated": [("saturated", "1")],
        "link": [(f"{side}_command_age", "cycles") for side in SIDES if link],
        "slip": [(f"{side}_slip", "m") for side in SIDES if slips],
        "task": list(task),
        "wall": [("wall_s", "s")],
    }


OBSERVED = ("clock", "nominal", "grip", "edge", "true", "sag", "bend", "q", "torque", "slip")
"""Groups of columns that every row has from its start; the others are of a completed row."""


def no_columns(_: object) -> tuple[tuple[str, str], ...]:
    """Return the columns of a task that has none of its own."""
    return ()


class Trace:
    """Rows of a run, one a command cycle, in memory or read back: columns by name, with units.

    Parameters
    ----------
    columns
        Names and units.
    values
        (rows, columns).
    qpos
        Physics positions (rows, nq) at the start of each cycle, for the recording in 3D; None of a
        trace that was read back.
    """

    def __init__(
        self, columns: Sequence[tuple[str, str]], values: Vector, qpos: Vector | None = None
    ) -> None:
        self.columns = list(columns)
        self.rows = len(values)
        self._table, self._qpos = values, qpos
        self._index = {name: i for i, (name, _) in enumerate(self.columns)}

    @classmethod
    def of_table(cls, table: pa.Table) -> Trace:
        """Return the trace that an Arrow table holds; InputError where a column is no numbers."""
        columns = []
        for schema in table.schema:
            if schema.type != pa.float64():
                raise InputError(f"column {schema.name!r} holds {schema.type}, not double")
            unit = (schema.metadata or {}).get(b"unit", b"").decode(errors="replace")
            columns.append((schema.name, unit))
        values = np.empty((table.num_rows, len(columns)))
        for i, column in enumerate(table.columns):
            values[:, i] = column.to_numpy()
        return cls(columns, values)

    def __contains__(self, name: str) -> bool:
        """Tell whether there is a column of that name."""
        return name in self._index

    def __getitem__(self, name: str) -> Vector:
        """Return one column over the recorded rows."""
        if name not in self._index:
            raise InputError(f"the trace has no column {name!r}")
        return self._table[: self.rows, self._index[name]]

    def _group(self, pattern: str) -> Vector:
        """Return the columns whose names match (rows, n); they stand side by side."""
        chosen = [i for name, i in self._index.items() if re.fullmatch(pattern, name)]
        first = chosen[0] if chosen else 0
        return self._table[: self.rows, first : first + len(chosen)]

    def window(self, first: int, last: int) -> Trace:
        """Return the rows from ``first`` to before ``last``, in the same memory: to read only."""
        qpos = None if self._qpos is None else self._qpos[first:last]
        return Trace(self.columns, self._table[first:last], qpos)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the arms' joints, such as ``left_joint1``."""
        found = (re.fullmatch(r"(\w+?)_setpoint_(\w+)", name) for name in self._index)
        return tuple(f"{match[1]}_{match[2]}" for match in found if match)

    @property
    def setpoints(self) -> Vector:
        """Joint set-points (rows, n) [rad]; NaN in a row that was not completed."""
        return self._group(r"\w+?_setpoint_\w+")

    @property
    def bends(self) -> Vector:
        """Angles of the bending hinges (rows, hinges) [rad]."""
        return self._group(r"bend_\d+")

    @property
    def qpos(self) -> Vector:
        """Physics positions (rows, nq) at the start of each cycle; InputError where not kept."""
        if self._qpos is None:
            raise InputError(
                "a run that was read back has no positions of the physics: run it again"
            )
        return self._qpos[: self.rows]

    @property
    def sha256(self) -> str:
        """SHA-256 of all values, row by row; one zero and one NaN, of which there are several."""
        values = (self._table[: self.rows] + 0.0).astype("<f8")
        values[np.isnan(values)] = np.nan
        return hashlib.sha256(values.tobytes()).hexdigest()

    def equals(self, other: Trace) -> bool:
        """Tell whether another trace has the same columns, units and numbers, NaN included."""
        same = self.columns == other.columns and self.rows == other.rows
        return same and np.array_equal(
            self._table[: self.rows], other._table[: other.rows], equal_nan=True
        )

    def table(self, metadata: dict[str, str], first: int = 0) -> pa.Table:
        """Return the trace from row ``first`` on as an Arrow table, each field with its unit."""
        fields = [
            pa.field(name, pa.float64(), metadata={"unit": unit}) for name, unit in self.columns
        ]
        schema = pa.schema(fields, metadata={"dualbend": json.dumps(metadata)})
        arrays = [pa.array(self._table[first : self.rows, i]) for i in range(len(fields))]
        return pa.Table.from_arrays(arrays, schema=schema)


class TraceRecorder(Trace):
    """The trace of a run that goes on; what was recorded survives whatever ends the run.

    Parameters
    ----------
    cycles, qpos_size
        Rows to make room for, of which further ones begin with the first again; length of the
        physics state that is kept beside the columns.
    sensing
        Indices of the arms with a sensor: they get columns for the chain's readings.
    hinges, joints
        Number of bending hinges; arms' joints, such as ``left_joint1``, True of a slide.
    task
        Further columns, with their units, that only this task has.
    link, slips, in_space
        The command link makes errors; the sheet may slide in the grips; the compliance deviates in
        all six directions: there are columns for it.
    shape
        Leading shape: of many worlds at once.

    Attributes
    ----------
    room : rows that there is room for
    kept : (..., room, columns + length of the physics state) they, in one piece
    """

    def __init__(
        self,
        cycles: int,
        sensing: Sequence[int],
        qpos_size: int,
        hinges: int,
        joints: Mapping[str, bool],
        task: Sequence[tuple[str, str]] = (),
        shape: tuple[int, ...] = (),
        **also: bool,
    ) -> None:
        groups = trace_columns(sensing, hinges, joints, task, **also)
        self.columns = [column for group in groups.values() for column in group]
        self._arms, self._in_space = arm_slice(sensing), also.get("in_space", False)
        ends = np.cumsum([len(group) for group in groups.values()]).tolist()
        starts = (0, *ends[:-1])
        self._slices = {name: slice(*at) for name, *at in zip(groups, starts, ends, strict=True)}
        first, self.room = len(self.columns), cycles
        self.kept: Vector = np.empty((*shape, cycles, first + qpos_size))
        self._positions = self.kept[..., first:]
        super().__init__(self.columns, self.kept[..., :first], self._positions)
        self._readings = slice(self._slices["ik"].stop, self._slices["saturated"].start)
        self.rows = 0

    def last(self, name: str) -> Vector:
        """Return a column of the last row (...)."""
        return self._row()[..., self._index[name]]

    def _row(self) -> Vector:
        """Return the last row (..., columns), to be written."""
        return self._table[..., (self.rows - 1) % self.room, :]

    def observe(
        self,
        time_s: float,
        phase: int | Vector,
        nominal: Vector,
        seen: Observation,
        qpos: Vector,
        bends: Vector,
    ) -> None:
        """Start a row with what is true at the start of the cycle."""
        self.rows += 1
        row, at = self._row(), self._slices
        worlds = row.shape[:-1]
        row.fill(np.nan)
        row[..., at["clock"].start] = time_s
        row[..., at["clock"].start + 1] = phase
        row[..., at["nominal"]] = nominal
        row[..., at["grip"]] = seen.grip.reshape(*worlds, -1)
        row[..., at["edge"]] = seen.edge.reshape(*worlds, -1)
        row[..., at["true"]] = seen.wrench.reshape(*worlds, -1)
        row[..., at["sag"].start] = seen.sag
        row[..., at["bend"]] = bends
        row[..., at["q"]] = seen.q
        row[..., at["torque"]] = seen.torque
        self._positions[..., (self.rows - 1) % self.room, :] = qpos
        task = at["task"]
        if self.rows > 1 and task.start < task.stop:
            row[..., task] = self._table[..., (self.rows - 2) % self.room, task]

    def record_slip(self, slip: Vector) -> None:
        """Add how far the sheet has slid in each grip (2,) [m] to the row."""
        self._row()[..., self._slices["slip"]] = slip

    def record_task(self, values: Sequence[float] | Vector) -> None:
        """Add the task's own columns (..., any number) to the row."""
        self._row()[..., self._slices["task"]] = values

    def record_reading(self, reading: WrenchReading) -> None:
        """Add what the sensors read to the row: also where that ends the run."""
        self._readings_row()[..., :6] = reading.sensor.components

    def _readings_row(self) -> Vector:
        """Return what the last row has of the sensors (..., arms with a sensor, 10)."""
        row = self._row()[..., self._readings]
        return row.reshape(*row.shape[:-1], row.shape[-1] // _READING, _READING)

    def record_control(
        self,
        observation: Observed,
        command: Command,
        ik: IKSolution,
        wall_s: float,
        ages: NDArray[np.int_] | tuple[()] = (),
    ) -> None:
        """Complete the row with what the controller made of it, and what the link made of that."""
        row, at = self._row(), self._slices
        worlds = row.shape[:-1]
        readings, arms = self._readings_row(), self._arms
        # Force x and moment y in the bending frame.
        readings[..., 6:8] = observation.raw.components[..., arms, ::4]
        readings[..., 8:] = observation.filtered.components[..., arms, ::4]
        row[..., at["deviation"]] = command.deviation[..., ::4].reshape(*worlds, -1)
        if self._in_space:
            rest = command.deviation[..., [1, 2, 3, 5]]
            row[..., at["rest"]] = rest.reshape(*worlds, -1)
        row[..., at["command"]] = command.pose.coordinates.reshape(*worlds, -1)
        row[..., at["setpoint"]] = ik.q
        first = at["ik"].start
        row[..., first] = ik.position_residual_m
        row[..., first + 1] = ik.rotation_residual_rad
        row[..., first + 2] = ik.iterations
        clipped, saturated = observation.clipped, command.saturated
        row[..., at["saturated"].start] = _any(clipped, worlds) | _any(saturated, worlds)
        if len(ages):
            row[..., at["link"]] = ages
        row[..., at["wall"].start] = wall_s


def _any(met: Mask, worlds: tuple[int, ...]) -> Mask | bool:
    """Tell of each world whether any bound was met; one mask may stand for all of them."""
    if not worlds or met.shape[: len(worlds)] != worlds:
        return bool(np.count_nonzero(met))
    return np.asarray(met.reshape(*worlds, -1).any(axis=-1))
