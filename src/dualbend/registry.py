"""What the package knows by name and users may add to: the tasks.

A task is described by one :class:`Task`. Its parts that need heavy imports (the run, the metrics,
the report, the recording) may be given as ``"module:name"`` and are imported when they are asked
for, so that reading a scenario costs nothing. This is the only place where a package calls one
above it by name.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from dualbend.errors import InputError, brief

GROUP = "dualbend.tasks"
"""Entry points of installed packages whose objects are tasks."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """One task: the section of a scenario that asks for it, its phases, and what it adds to a run.

    Attributes
    ----------
    kind : the section's ``kind``
    config : of the section ``[task]``, a subclass of :class:`dualbend.scenario.task.TaskConfig`
    phases : names that the trace's column ``phase`` counts
    run : ``(scenario, **parts) -> Run``, ready to be run
    columns : ``(scenario) -> ((name, unit), ...)`` of the trace that only this task has
    cycles : ``(scenario) -> int``, command cycles of a run at most; None: not known before it
    summary : ``(record) -> Summary``, the numbers that ``summary.json`` holds
    metrics : ``(record) -> dict[str, Metric]``
    tables : ``(record) -> dict[str, list[dict]]`` beside the metrics in ``summary.json``
    peaks : ``(record) -> dict[str, (rows,)]``, the signal of which a metric is the largest value
    tolerances : ``{metric: (kind, size, size where the value is 0, reason)}`` of a new baseline
    report : ``(record) -> list[Section | None]`` of the report
    notebook : ``(record) -> str``, the HTML by which a notebook shows a run
    recording : :class:`dualbend.recording.layers.Layers` of the recording and the pictures
    """

    kind: str
    config: Any
    phases: tuple[str, ...]
    run: Any
    columns: Any = "dualbend.run.trace:no_columns"
    cycles: Any = None
    summary: Any = "dualbend.evaluation.summary:summarise"
    metrics: Any = "dualbend.evaluation.metrics:common_metrics"
    tables: Any = "dualbend.evaluation.metrics:no_tables"
    peaks: Any = "dualbend.evaluation.peaks:common_peaks"
    tolerances: Any = field(default_factory=dict)
    report: Any = "dualbend.report.page:common_sections"
    notebook: Any = "dualbend.report.notebook:run_html"
    recording: Any = "dualbend.recording.layers:PLAIN"

    def part(self, name: str) -> Any:  # noqa: ANN401 - each caller says what it expects
        """Return one of the parts, imported where it is given as ``"module:name"``."""
        return loaded(getattr(self, name))


def loaded(given: Any) -> Any:  # noqa: ANN401 - an object of any kind, or where it stands
    """Return the object that ``"module:name"`` stands for; anything else as it is."""
    if not isinstance(given, str):
        return given
    module, _, name = given.partition(":")
    return getattr(importlib.import_module(module), name)


class Tasks:
    """The tasks by kind: the package's own, those of entry points, those that a program adds."""

    def __init__(self, own: dict[str, str]) -> None:
        self._found: dict[str, Any] = dict(own)
        self._looked = False

    def register(self, task: Task) -> Task:
        """Add a task, or replace the one of its kind."""
        self._found[task.kind] = task
        return task

    def remove(self, kind: str) -> None:
        """Take a registered task back."""
        del self._found[kind]

    def __iter__(self) -> Iterator[str]:
        """Yield the kinds."""
        self._look()
        yield from self._found

    def __getitem__(self, kind: str) -> Task:
        """Return the task of a kind; InputError names those that there are."""
        if kind not in self._found:
            self._look()
        if kind not in self._found:
            raise InputError(f"no task of kind {brief(kind)}: there are {', '.join(self._found)}")
        task: Task = loaded(self._found[kind])
        return task

    def _look(self) -> None:
        """Read the entry points, once and only where a name needs it."""
        if not self._looked:
            self._looked = True
            for point in importlib.metadata.entry_points(group=GROUP):
                self._found.setdefault(point.name, point.value)


TASKS = Tasks(
    {"bending": "dualbend.task.bending:BENDING", "assembly": "dualbend.task.assembly:ASSEMBLY"}
)
