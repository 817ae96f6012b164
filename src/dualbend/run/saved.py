"""A run read back from the folder that it left."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.run.scenario import Scenario, load_scenario
from dualbend.run.trace import read_trace
from dualbend.scene.cell import SIDES
from dualbend.task import assembly_motion, bending

Vector = NDArray[np.float64]

FILES = ("scenario.toml", "summary.json", "trace.parquet")
"""What makes a folder a run; pictures and recording are made from these."""

_STREAM = "trace.arrow"


class SavedMetric(msgspec.Struct, frozen=True):
    """A metric as ``summary.json`` holds it."""

    value: float | list[float | None] | None
    unit: str


class SavedSummary(msgspec.Struct, frozen=True, kw_only=True):
    """The part of ``summary.json`` that every kind of run has."""

    scenario: str
    seed: int
    outcome: str
    reason: str
    controller: str = ""
    versions: dict[str, str]
    metrics: dict[str, SavedMetric]


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
        return next(side for side in SIDES if side in self.scenario.arms.sensing)


def load_run(folder: Path | str) -> SavedRun:
    """Return the run whose files are in ``folder``.

    Raises
    ------
    InputError
        It is no folder of a run, the run did not live to its end, or a file is not readable.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; it should be one that dualbend run left")
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
        raise InputError(f"{folder}: {error}") from error
    return SavedRun(
        folder=folder,
        scenario=scenario,
        summary=_read_summary(summary_file),
        table=_whole_trace(trace_file),
    )


def _read_summary(path: Path) -> SavedSummary:
    try:
        return msgspec.json.decode(path.read_bytes(), type=SavedSummary)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: no summary of a run: {error}") from error


def _whole_trace(path: Path) -> pa.Table:
    table = read_trace(path)
    needed = {"time", "phase", "nominal_alpha"} - set(table.column_names)
    if needed:
        raise InputError(
            f"{path}: no trace of a run: there is no column {', '.join(sorted(needed))}"
        )
    return table
