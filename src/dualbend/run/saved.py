"""A run read back from the folder that it left."""

from __future__ import annotations

import importlib.metadata
import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import pyarrow as pa

from dualbend.errors import InputError
from dualbend.run.trace import read_trace
from dualbend.scenario import motion as bending
from dualbend.scenario.load import load_scenario, parse_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.task.assembly import motions as assembly_motion
from dualbend.types import SIDES, Vector

FILES = ("scenario.toml", "summary.json", "trace.parquet")
"""What makes a folder a run; pictures and recording are made from these."""

_STREAM = "trace.arrow"

UNFINISHED = "ended from outside"
"""Outcome of a run that did not live to write its summary."""

TableRow = dict[str, str | float | bool | None]


class SavedMetric(msgspec.Struct, frozen=True):
    """A metric as ``summary.json`` holds it."""

    value: float | list[float | None] | None
    unit: str


class SavedSummary(msgspec.Struct, frozen=True, kw_only=True):
    """``summary.json``; the tables of phases, holes and pins are an assembly's.

    ``sheet`` and ``arms`` are as they were written; {} where the run's version did not.
    """

    scenario: str
    seed: int
    outcome: str
    reason: str
    controller: str = ""
    versions: dict[str, str]
    metrics: dict[str, SavedMetric]
    sheet: dict[str, Any] = {}
    arms: dict[str, Any] = {}
    phases: list[TableRow] = []
    holes: list[TableRow] = []
    pins: list[TableRow] = []


@dataclass(frozen=True, kw_only=True)
class SavedRun:
    """A run's folder in memory: what was asked, what came of it, a row a cycle."""

    folder: Path
    scenario: Scenario
    summary: SavedSummary
    table: pa.Table

    def __getitem__(self, name: str) -> Vector:
        """Return one column of the trace (rows,)."""
        column: Vector = self.table.column(name).to_numpy()
        return column

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the phases, which the trace's column ``phase`` counts."""
        return bending.PHASES if self.scenario.assembly is None else assembly_motion.PHASES

    @property
    def sensing_side(self) -> str:
        """The arm that the summary speaks of: the left one where both sense."""
        return next(side for side in SIDES if side in self.scenario.compliance.sensing)

    @property
    def model_sha256(self) -> str:
        """Hash of the compiled model, "" where the trace does not say it."""
        return _metadata(self.table).get("model_sha256", "")


def load_run(folder: Path | str, *, unfinished: bool = False) -> SavedRun:
    """Return the run whose files are in ``folder``.

    With ``unfinished``, also what a killed run left: its rows and its scenario, no metrics.

    Raises
    ------
    InputError
        It is no folder of a run, the run did not live to its end, or a file is not readable.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; it should be one that dualbend run left")
    # Beside a run's files it is of a later run: one that finishes takes it away.
    if unfinished and (folder / _STREAM).is_file():
        return _load_unfinished(folder)
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing and (folder / _STREAM).is_file():
        raise InputError(
            f"{folder}: the run was ended before it could write {', '.join(missing)}: "
            f"there is only {_STREAM}; run it again"
        )
    if missing:
        raise InputError(
            f"{folder}: no folder of a run: there is no {', '.join(missing)}; "
            f"dualbend run SCENARIO --out {folder} makes one"
        )
    scenario_file, summary_file, trace_file = (folder / name for name in FILES)
    try:
        scenario = load_scenario(str(scenario_file))
    except InputError as error:
        raise InputError(f"{folder}: {error}{_by_another_version(summary_file)}") from error
    return SavedRun(
        folder=folder,
        scenario=scenario,
        summary=_read_summary(summary_file),
        table=_whole_trace(trace_file),
    )


def _load_unfinished(folder: Path) -> SavedRun:
    path = folder / _STREAM
    table = _whole_trace(path)
    text = _metadata(table).get("scenario_toml")
    if text is None:
        raise InputError(f"{path}: does not say which scenario it is of; run it again")
    scenario = parse_scenario(text, str(path))
    summary = SavedSummary(
        scenario=scenario.name,
        seed=scenario.seed,
        outcome=UNFINISHED,
        reason=f"killed, or still running; {_STREAM} has {table.num_rows} cycles",
        versions={},
        metrics={},
    )
    return SavedRun(folder=folder, scenario=scenario, summary=summary, table=table)


def _metadata(table: pa.Table) -> dict[str, str]:
    """Return what a trace says of its run."""
    with suppress(ValueError):
        found = json.loads((table.schema.metadata or {}).get(b"dualbend", b"{}"))
        if isinstance(found, dict):
            return {str(key): str(value) for key, value in found.items()}
    return {}


def _by_another_version(summary_file: Path) -> str:
    """Return which version made the run, where that is not the present one."""
    with suppress(InputError):
        made = _read_summary(summary_file).versions.get("dualbend", "")
        here = importlib.metadata.version("dualbend")
        if made != here:
            return f" (the run was made by dualbend {made or 'of unknown version'}, this is {here})"
    return ""


def _read_summary(path: Path) -> SavedSummary:
    try:
        return msgspec.json.decode(path.read_bytes(), type=SavedSummary)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: no summary of a run: {error}") from error


def _whole_trace(path: Path) -> pa.Table:
    table = read_trace(path)
    if not table.num_rows and path.name == _STREAM:
        raise InputError(f"{path}: the run was ended before its first second was kept")
    needed = {"time", "phase", "nominal_alpha"} - set(table.column_names)
    if needed:
        raise InputError(
            f"{path}: no trace of a run: there is no column {', '.join(sorted(needed))}"
        )
    return table
