"""A recorded stream of commands: the deviation of both arms in every command cycle.

Columns ``left_deviation_x``, ``_y``, ``_z`` [m], ``_roll``, ``_alpha``, ``_yaw`` [rad] and those of
the right arm, each in its arm's bending frame, as a trace has them; what is not there is 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from dualbend.errors import InputError, refusing
from dualbend.logs.export import DEVIATION_TOPIC, SCENARIO_FILE
from dualbend.logs.messages import JOINT_STATE, read_joint_state
from dualbend.run.disk.saved import load_run
from dualbend.types import SIDES, Vector

_UNITS = {"x": "m", "y": "m", "z": "m", "roll": "rad", "alpha": "rad", "yaw": "rad"}
COLUMNS = {f"{side}_deviation_{part}": unit for side in SIDES for part, unit in _UNITS.items()}
"""Names in the order of a deviation (2, 6), with their units."""

_TIME, _LATE = "time", 0.01
"""The column of time [s]; how far off its cycle a row may be, in command periods."""

Columns = dict[str, Vector]


class CommandLog(msgspec.Struct, frozen=True):
    """Commands of a file: ``deviation`` (rows, 2, 6) [m, rad], a row a command cycle.

    ``time_s`` (rows,): since the first row; None: the file has no times. ``scenario``: the TOML of
    the run that it is of, "" where it does not say.
    """

    path: Path
    deviation: Vector
    time_s: Vector | None
    scenario: str

    def refuse_times(self, period_s: float) -> None:
        """Raise InputError where the rows are not a command period apart."""
        if self.time_s is None:
            return
        wanted = period_s * np.arange(len(self.time_s))
        late = ~(np.abs(self.time_s - wanted) <= _LATE * period_s)
        if late.any():
            row = int(np.argmax(late))
            raise InputError(
                f"{self.path}: row {row} is {self.time_s[row]:g} s after the first one, not "
                f"{wanted[row]:g} s: needs a row every robot.command_period_s = {period_s:g} s"
            )

    def refuse_beyond(self, limit_m: float, limit_rad: float) -> None:
        """Raise InputError where a deviation is larger than the bounds of served ones."""
        limits = np.array([3 * [limit_m] + 3 * [limit_rad]] * len(SIDES))
        over = np.abs(self.deviation) > limits
        if over.any():
            row, *at = (int(i) for i in np.argwhere(over)[0])
            name = list(COLUMNS)[6 * at[0] + at[1]]
            key = f"serve.limit_{COLUMNS[name]}"
            raise InputError(
                f"{self.path}: column {name!r}, row {row}: {self.deviation[row, at[0], at[1]]:g} "
                f"{COLUMNS[name]} is beyond {key} = {limits[at[0], at[1]]:g}"
            )


def read_commands(path: Path) -> CommandLog:
    """Return the commands of a run's folder, or of a file: .parquet, .csv or .mcap.

    Raises InputError with file, column and row where it has none, or has what is none.
    """
    if path.is_dir():
        run = load_run(path)
        return _checked(
            path, {name: run[name] for name, _ in run.trace.columns}, run.scenario.to_toml()
        )
    if not path.is_file():
        raise InputError(f"{path}: no such file, nor the folder of a run")
    if path.suffix == ".mcap":
        return _checked(path, *_of_mcap(path))
    if path.suffix not in (".parquet", ".csv"):
        raise InputError(f"{path}: needs a run's folder, or a file .parquet, .csv or .mcap")
    with refusing(f"{path}: cannot be read", OSError, ValueError, pa.ArrowException):
        table = pq.read_table(path) if path.suffix == ".parquet" else _csv(path)
    return _checked(path, dict(_numbers(path, table)), "")


def _csv(path: Path) -> pa.Table:
    # An empty line is a row without a command, where there is one column.
    lines = pyarrow.csv.ParseOptions(ignore_empty_lines=False)
    return pyarrow.csv.read_csv(path, parse_options=lines)


def _numbers(path: Path, table: pa.Table) -> Iterator[tuple[str, Vector]]:
    """Yield the columns that are commands, or may be meant as ones, and the time."""
    names = table.schema.names
    for field, column in zip(table.schema, table.columns, strict=True):
        if "_deviation_" not in field.name and field.name != _TIME:
            continue
        if names.count(field.name) > 1:
            raise InputError(f"{path}: column {field.name!r} is there twice")
        unit = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
        needed = COLUMNS.get(field.name, unit)
        if unit and unit != needed:
            raise InputError(f"{path}: column {field.name!r} is in {unit!r}: needs {needed!r}")
        with refusing(f"{path}: column {field.name!r}: needs numbers", pa.ArrowException):
            values = column.cast(pa.float64()).to_numpy()
        yield field.name, values


def _of_mcap(path: Path) -> tuple[Columns, str]:
    """Return the columns and the scenario of a log of ROS 2 messages."""
    try:
        from mcap.reader import make_reader  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError("a log in MCAP needs the extra: pip install 'dualbend[mcap]'") from error

    rows, scenario = list[dict[str, float]](), ""
    # Whatever a damaged file is to somebody else's reader.
    with refusing(f"{path}: no whole MCAP file", Exception), path.open("rb") as file:
        reader = make_reader(file)
        for attachment in reader.iter_attachments():
            if attachment.name == SCENARIO_FILE:
                scenario = attachment.data.decode()
        found = list(reader.iter_messages(topics=[DEVIATION_TOPIC]))
        there = sorted(one.topic for one in reader.get_summary().channels.values())
    if not found:
        raise InputError(
            f"{path}: has no {DEVIATION_TOPIC}; its topics are {', '.join(there) or 'none'}"
        )
    for i, (schema, _, message) in enumerate(found):
        if schema is None or schema.name != JOINT_STATE:
            name = schema and schema.name
            raise InputError(f"{path}: {DEVIATION_TOPIC} is of {name}: needs {JOINT_STATE}")
        with refusing(f"{path}: message {i} of {DEVIATION_TOPIC}", ValueError):
            time_ns, values = read_joint_state(message.data)
        rows.append({**values, _TIME: 1e-9 * time_ns})
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}, scenario


def _checked(path: Path, columns: Columns, scenario: str) -> CommandLog:
    """Return the commands of columns; InputError where they are none."""
    commands = {name: column for name, column in columns.items() if _is_command(name)}
    for name in commands:
        if name not in COLUMNS:
            raise InputError(f"{path}: column {name!r} is not known; {_needed()}")
    if not commands:
        raise InputError(f"{path}: has no command; {_needed()}")
    table = np.column_stack(list(commands.values()))
    # The last rows of a run that was stopped have no command.
    given = np.flatnonzero(~np.isnan(table).all(axis=1))
    rows = int(given[-1]) + 1 if len(given) else 0
    if not rows:
        raise InputError(f"{path}: has no row with a command")
    bad = ~np.isfinite(table[:rows])
    if bad.any():
        row, at = (int(i) for i in np.argwhere(bad)[0])
        name = list(commands)[at]
        raise InputError(f"{path}: column {name!r}, row {row}: {table[row, at]:g}: needs a number")
    deviation = np.zeros((rows, len(COLUMNS)))
    for name, column in commands.items():
        deviation[:, list(COLUMNS).index(name)] = column[:rows]
    time_s = columns.get(_TIME)
    return CommandLog(
        path=path,
        deviation=deviation.reshape(rows, len(SIDES), -1),
        time_s=None if time_s is None else time_s[:rows] - time_s[0],
        scenario=scenario,
    )


def _is_command(name: str) -> bool:
    return name.startswith(tuple(f"{side}_deviation_" for side in SIDES))


def _needed() -> str:
    parts = ", ".join(f"{part} [{unit}]" for part, unit in _UNITS.items())
    return f"commands are left_deviation_ and right_deviation_ with {parts}"
