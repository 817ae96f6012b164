"""What a run left: one type, in memory when the run ends and read back from its folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np

from dualbend.errors import InputError, refusing
from dualbend.interrupts import Interrupted
from dualbend.registry import TASKS, Task
from dualbend.run.identity import RunIdentity
from dualbend.run.trace import Trace
from dualbend.scenario.scenario import Scenario
from dualbend.scene.contacts import Contact
from dualbend.types import SIDES, Mask, Side, Vector

STOPPED = "stopped"
"""Phase after those of the task: of the rows after a protective stop."""

TableRow = dict[str, str | float | bool | None]


class Metric(msgspec.Struct, frozen=True, omit_defaults=True):
    """A value, or one a piece, and its unit; null where the run does not tell, ``note`` why not."""

    value: float | list[float | None] | None
    unit: str
    note: str = ""


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """``summary.json``: how the run ended and its numbers; ``tables`` are those of its task.

    ``warnings``: where it contradicts physics or its purpose, a sentence each.
    ``sheet`` and ``arms`` are as they were written; {} where the run's version did not. ``run``:
    which run it is; None before it is written, and where its version did not say it.
    """

    run: RunIdentity | None = None
    scenario: str
    seed: int
    outcome: str
    reason: str
    controller: str = ""
    learned: str = ""
    versions: dict[str, str]
    warnings: list[str] = []
    sheet: dict[str, Any] = {}
    metrics: dict[str, Metric]
    arms: dict[str, Any] = {}
    tables: dict[str, list[TableRow]] = {}

    @classmethod
    def of_json(cls, raw: dict[str, Any]) -> Summary:
        """Return the summary that ``summary.json`` holds; every list of objects is a table.

        Raises InputError where it was changed after it was written, or is none.
        """
        rest = {key: value for key, value in raw.items() if key != "sha256"}
        tables = {k: v for k, v in rest.items() if k not in cls.__struct_fields__}
        with refusing("no summary of a run", msgspec.ValidationError):
            summary = msgspec.convert({**rest, "tables": tables}, cls)
        if summary.run is not None and raw.get("sha256") != _sha256(rest):
            raise InputError(
                f"was changed after the run: sha256 is {_sha256(rest)} of its other keys"
            )
        return summary

    def to_json(self) -> dict[str, Any]:
        """Return what ``summary.json`` holds, the tables beside the other keys.

        ``sha256``, of a summary that names its run, is that of all other keys.
        """
        found: dict[str, Any] = msgspec.to_builtins(self)
        tables = found.pop("tables")
        for name in ("controller", "learned"):
            if not found[name]:
                del found[name]
        found |= tables
        if self.run is None:
            del found["run"]
            return found
        return {**found, "sha256": _sha256(found)}


def _sha256(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def task_of(scenario: Scenario) -> Task:
    """Return the task that a scenario asks for."""
    return TASKS[scenario.task.kind]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What only a run in memory has: the model with its looks, for pictures, and its stiffness.

    ``compiled`` returns the model: the runs of a study have no pictures, and it costs 2.6 MB.
    ``bend_stiffness`` (N,): moment over bending angle at each place of bending [N m/rad].
    """

    compiled: Callable[[], mujoco.MjModel]
    bend_stiffness: Vector

    @cached_property
    def model(self) -> mujoco.MjModel:
        """What was compiled."""
        return self.compiled()


@dataclass(frozen=True, kw_only=True)
class RunRecord:
    """A run: what was asked, how it ended and why, one row per command cycle, its numbers.

    Attributes
    ----------
    controller : name of the compliance that took the place of the scenario's own, if one did
    learned : what was learned on earlier sheets and corrects the path, in words
    laid : of each sheet of an assembly, (4, 3) as its holes lie over their pins [m]
    lessons : of each sheet of an assembly, what it was begun with and what was found, a row each
    ports : of a served run, what went to and came from each port, a row each
    lateness : of a run served in real time, how late cell and answers were, a histogram
    contacts : those that the task does not intend, of a run in memory
    scene : model and stiffness, of a run in memory
    folder : from which the run was read back
    known : its summary, where it was read back
    identity : which run it is; None of one that version 0.1.0 left
    signal : number of the signal that ended it, 0 where none did
    """

    scenario: Scenario
    outcome: str
    reason: str = ""
    controller: str = ""
    learned: str = ""
    trace: Trace
    simulated_s: float
    wall_time_s: float
    laid: tuple[Vector, ...] = ()
    lessons: tuple[TableRow, ...] = ()
    ports: tuple[TableRow, ...] = ()
    lateness: tuple[TableRow, ...] = ()
    contacts: tuple[Contact, ...] = ()
    scene: Scene | None = None
    folder: Path | None = None
    known: Summary | None = None
    model_sha256: str = ""
    identity: RunIdentity | None = None
    signal: int = 0

    def __getitem__(self, name: str) -> Vector:
        """Return one column of the trace (rows,)."""
        return self.trace[name]

    @property
    def task(self) -> Task:
        """The task that the run is of."""
        return task_of(self.scenario)

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the phases, which the trace's column ``phase`` counts, and that of a stop."""
        return (*self.task.phases, STOPPED)

    @property
    def stopped(self) -> Mask:
        """Which rows (rows,) are after a protective stop."""
        return np.asarray(self.trace["phase"] == len(self.task.phases))

    @property
    def expected(self) -> bool:
        """The scenario allows this outcome."""
        return self.outcome in self.scenario.expect.outcome

    @property
    def sensing_side(self) -> Side:
        """The sensing arm that the summary speaks of: the left one where both sense."""
        return next(side for side in SIDES if side in self.scenario.compliance.sensing)

    @cached_property
    def summary(self) -> Summary:
        """The numbers of the run: as they were written, or computed when first asked for."""
        if self.known is not None:
            return self.known
        computed: Summary = self.task.part("summary")(self)
        return computed

    @cached_property
    def metrics(self) -> dict[str, Metric]:
        """The metrics of the run's task: as they were written, or computed when first asked for."""
        if self.known is not None:
            return self.known.metrics
        computed: dict[str, Metric] = self.task.part("metrics")(self)
        return computed

    def _repr_html_(self) -> str:
        """Return the HTML by which a notebook shows the run: its end, its moment, its metrics."""
        shown: str = self.task.part("notebook")(self)
        return shown

    @property
    def model(self) -> mujoco.MjModel:
        """The model with its looks."""
        return self._in_memory.model

    @property
    def bend_stiffness(self) -> Vector:
        """Moment over bending angle at each place of bending (N,) [N m/rad]."""
        return self._in_memory.bend_stiffness

    @property
    def _in_memory(self) -> Scene:
        if self.scene is None:
            raise InputError(f"{self.folder}: a run that was read back has no model: run it again")
        return self.scene


def whole(result: RunRecord) -> RunRecord:
    """Return a run that ended by itself; KeyboardInterrupt where a signal did: it is no result."""
    if result.signal:
        raise Interrupted(result.signal)
    return result
