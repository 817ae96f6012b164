"""The trace of a run: one row a command cycle, one named column with its unit a quantity."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dualbend.control.controller import Command
from dualbend.control.controller import Observation as Observed
from dualbend.control.force_torque import WrenchReading
from dualbend.errors import InputError, refusing
from dualbend.files import whole_file, write_all
from dualbend.scene.ik import IKSolution
from dualbend.scene.observation import Observation
from dualbend.types import SIDES, Vector

WALL_CLOCK_COLUMNS = ("wall_s",)
"""Columns that differ between two runs of one seed."""

_POSE = (("x", "m"), ("y", "m"), ("z", "m"), ("alpha", "rad"))
_COMMAND = (("x", "m"), ("z", "m"), ("alpha", "rad"))
_DEVIATION, _REST = _POSE[::3], (*_POSE[1:3], ("roll", "rad"), ("yaw", "rad"))
_WRENCH = tuple((f"force_{a}", "N") for a in "xyz") + tuple((f"moment_{a}", "N m") for a in "xyz")


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
        Rows to make room for; length of the physics state that is kept beside the columns.
    sensing
        Indices of the arms with a sensor: they get columns for the chain's readings.
    hinges, joints
        Number of bending hinges; arms' joints, such as ``left_joint1``, True of a slide.
    task
        Further columns, with their units, that only this task has.
    link, slips, in_space
        The command link makes errors; the sheet may slide in the grips; the compliance deviates in
        all six directions: there are columns for it.
    """

    def __init__(
        self,
        cycles: int,
        sensing: Sequence[int],
        qpos_size: int,
        hinges: int,
        joints: Mapping[str, bool],
        task: Sequence[tuple[str, str]] = (),
        **also: bool,
    ) -> None:
        groups = trace_columns(sensing, hinges, joints, task, **also)
        self.columns = [column for group in groups.values() for column in group]
        self._sensing = sensing
        ends = np.cumsum([len(group) for group in groups.values()]).tolist()
        starts = (0, *ends[:-1])
        self._slices = {name: slice(*at) for name, *at in zip(groups, starts, ends, strict=True)}
        room = np.full((cycles, len(self.columns)), np.nan)
        self._positions = np.empty((cycles, qpos_size))
        super().__init__(self.columns, room, self._positions)
        self.rows = 0

    def observe(
        self,
        time_s: float,
        phase: int,
        nominal: Vector,
        seen: Observation,
        qpos: Vector,
        bends: Vector,
    ) -> None:
        """Start a row with what is true at the start of the cycle."""
        row, at = self._table[self.rows], self._slices
        row[at["clock"]] = time_s, phase
        row[at["nominal"]] = nominal
        row[at["grip"]] = seen.grip.ravel()
        row[at["edge"]] = seen.edge.ravel()
        row[at["true"]] = seen.wrench.ravel()
        row[at["sag"]] = seen.sag
        row[at["bend"]] = bends
        row[at["q"]] = seen.q
        row[at["torque"]] = seen.torque
        self._positions[self.rows] = qpos
        if self.rows:
            row[at["task"]] = self._table[self.rows - 1][at["task"]]
        self.rows += 1

    def record_slip(self, slip: Vector) -> None:
        """Add how far the sheet has slid in each grip (2,) [m] to the row."""
        self._table[self.rows - 1][self._slices["slip"]] = slip

    def record_task(self, values: Sequence[float]) -> None:
        """Add the task's own columns to the row."""
        self._table[self.rows - 1][self._slices["task"]] = values

    def record_reading(self, reading: WrenchReading) -> None:
        """Add what the sensors read to the row: also where that ends the run."""
        row = self._table[self.rows - 1]
        for i, sensed in zip(self._sensing, reading.sensor.components, strict=True):
            row[self._slices[f"reading{i}"]][:6] = sensed

    def record_control(
        self,
        observation: Observed,
        command: Command,
        ik: IKSolution,
        wall_s: float,
        ages: Sequence[int] = (),
    ) -> None:
        """Complete the row with what the controller made of it, and what the link made of that."""
        row, at = self._table[self.rows - 1], self._slices
        for i in self._sensing:
            readings = row[at[f"reading{i}"]]
            # Force x and moment y in the bending frame.
            readings[6:8] = observation.raw.components[i, ::4]
            readings[8:] = observation.filtered.components[i, ::4]
        row[at["deviation"]] = command.deviation[:, ::4].ravel()
        if row[at["rest"]].size:
            row[at["rest"]] = command.deviation[:, [1, 2, 3, 5]].ravel()
        row[at["command"]] = command.pose.coordinates.ravel()
        row[at["setpoint"]] = ik.q
        row[at["ik"]] = ik.position_residual_m, ik.rotation_residual_rad, ik.iterations
        bounds_met = np.count_nonzero(observation.clipped) + np.count_nonzero(command.saturated)
        row[at["saturated"]] = bounds_met > 0
        row[at["link"]] = ages
        row[at["wall"]] = wall_s


class TraceStream:
    """A trace on disk while its run goes on: what was written is there whatever ends the process.

    An Arrow stream, a batch every 36 rows; :func:`read_trace` reads it, finished or not.

    Parameters
    ----------
    path
        Says where; asked when there is a first batch, which replaces a file that is there.
    metadata
        Says what the stream says of its run; asked then, too.
    """

    _BATCH_ROWS = 36

    def __init__(self, path: Callable[[], Path], metadata: Callable[[], dict[str, str]]) -> None:
        self._path, self._metadata = path, metadata
        self._about: dict[str, str] = {}
        self._file: IO[bytes] | None = None
        self._written = 0

    def update(self, trace: Trace) -> None:
        """Write what is new, a batch at a time."""
        if trace.rows - self._written >= self._BATCH_ROWS:
            # A disk that is full does not end the run; when it has room again, nothing is missing.
            with suppress(OSError):
                self._append(trace)

    def close(self, trace: Trace | None) -> None:
        """Write the rest of a trace and stop; the file stays."""
        with suppress(OSError):
            if trace is not None and trace.rows > self._written:
                self._append(trace)
        if self._file is not None:
            self._file.close()

    def _append(self, trace: Trace) -> None:
        self._about = self._about or self._metadata()
        table = trace.table(self._about, self._written)
        batches = b"".join(batch.serialize().to_pybytes() for batch in table.to_batches())
        if self._file is None:
            # Unbuffered: what failed to be written is not tried again behind our back.
            with whole_file(self._path()) as part:
                file = part.open("wb", buffering=0)
                write_all(file, table.schema.serialize().to_pybytes() + batches)
            self._file = file
        else:
            whole = self._file.tell()
            try:
                write_all(self._file, batches)
            except OSError:
                self._file.seek(whole)
                self._file.truncate()
                raise
        self._written = trace.rows


def read_trace(path: Path) -> pa.Table:
    """Return a run's trace, Parquet or the stream that a killed run left.

    Raises
    ------
    InputError
        The file is neither, or is damaged.
    """
    with refusing(f"{path}: no trace of a run", *_DAMAGED):
        if path.suffix == ".parquet":
            with pq.ParquetFile(path) as file:
                return file.read()
        with path.open("rb") as file, pa.ipc.open_stream(file) as stream:
            return pa.Table.from_batches(_whole(stream), stream.schema)


def trace_head(path: Path) -> tuple[pa.Schema, int]:
    """Return the schema and the number of rows of a trace in Parquet, whose values stay unread.

    Raises InputError where it is none, or is damaged.
    """
    with refusing(f"{path}: no trace of a run", *_DAMAGED), pq.ParquetFile(path) as file:
        return file.schema_arrow, file.metadata.num_rows


def _whole(stream: pa.ipc.RecordBatchStreamReader) -> Iterator[pa.RecordBatch]:
    """Yield the batches of a stream whose last one may have been cut off."""
    try:
        yield from stream
    except _DAMAGED:
        return


_DAMAGED = (OSError, ValueError, MemoryError, pa.ArrowException)
"""What a damaged file can be to Arrow."""
