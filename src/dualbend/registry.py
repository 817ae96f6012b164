"""What the package knows by name and users may add to: the tasks, and classes that control.

A task is described by one :class:`Task`. Its parts that need heavy imports (the run, the metrics,
the report, the recording) may be given as ``"module:name"`` and are imported when they are asked
for, so that reading a scenario costs nothing. This is the only place where a package calls one
above it by name.
"""

from __future__ import annotations

import difflib
import functools
import importlib
import importlib.metadata
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dualbend.errors import InputError, brief

GROUP = "dualbend.tasks"
"""Entry points of installed packages whose objects are tasks."""

COMPLIANCES = "dualbend.compliances"
"""Entry points of installed packages whose objects are classes of controllers."""


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


# --- a user's classes ------------------------------------------------------------------------

_IMPORTED: dict[str, str] = {}
"""Modules that were imported from a folder of the user's, and which."""


@functools.cache
def own_names() -> Mapping[str, str]:
    """Return the controllers that installed packages bring, ``module:Class`` by name."""
    return {p.name: p.value for p in importlib.metadata.entry_points(group=COMPLIANCES)}


def holds(folder: Path, name: str) -> bool:
    """Tell whether the module of ``module:Class`` is in a folder, as a file or as a package."""
    parts = name.partition(":")[0].split(".")
    place = folder.joinpath(*parts)
    return all(part.isidentifier() for part in parts) and (
        place.with_suffix(".py").is_file() or (place / "__init__.py").is_file()
    )


def own_class(name: str, folder: str | None = None) -> Callable[..., Any]:
    """Return the class that ``module:Class``, or an entry point of `COMPLIANCES`, stands for.

    A function that makes a controller will do as well. The module is looked for in the folder
    first, then on the import path; it is run where it was not yet.

    Raises InputError where there is none, or its module cannot be imported.
    """
    module, colon, attribute = own_names().get(name, name).partition(":")
    if module.endswith(".py"):
        raise InputError(
            f'needs "module:Class" with a module, not a file: "{Path(module).stem}:{attribute}"; '
            "it is found beside the scenario's file"
        )
    if not (colon and all(part.isidentifier() for part in f"{module}.{attribute}".split("."))):
        known = f", or one of {', '.join(own_names())}" if own_names() else ""
        raise InputError(f'needs "module:Class"{known}')
    found = _imported(module, folder)
    for part in attribute.split("."):
        if not hasattr(found, part):
            near = difflib.get_close_matches(part, dir(found), n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise InputError(f"{module} has no {part}{hint}")
        found = getattr(found, part)
    calls = isinstance(found, type) and any("__call__" in vars(each) for each in found.__mro__)
    if not callable(found) or (isinstance(found, type) and not calls):
        what = "a class without __call__(self, observation)" if callable(found) else brief(found)
        raise InputError(f"{attribute} is {what}: needs a class whose objects can be called")
    made: Callable[..., Any] = found
    return made


def _imported(module: str, folder: str | None) -> Any:  # noqa: ANN401 - a module
    top = module.partition(".")[0]
    at = folder if folder is not None and holds(Path(folder), module) else None
    if top in _IMPORTED and _IMPORTED[top] != at:
        for name in [n for n in sys.modules if n == top or n.startswith(f"{top}.")]:
            del sys.modules[name]
        del _IMPORTED[top]
    if at is not None:
        file = getattr(sys.modules.get(top), "__file__", None)
        if file is not None and not Path(file).resolve().is_relative_to(Path(at).resolve()):
            raise InputError(f"another module {top} is loaded already, {file}: rename yours")
        _IMPORTED[top] = at
        importlib.invalidate_caches()
    try:
        with beside(at):
            return importlib.import_module(module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and error.name in (module, top):
            place = f"in {folder}" if folder is not None else "beside the scenario's file"
            raise InputError(f"no module {error.name} {place}, nor on the import path") from error
        raise InputError(
            f"cannot be imported: {type(error).__name__}: {error}{raised_at(error)}"
        ) from error


@contextmanager
def beside(folder: str | None) -> Iterator[None]:
    """Let modules of a folder be imported, and nothing of it hide what others import later."""
    path = list(sys.path)
    if folder is not None:
        sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path[:] = path


def raised_at(error: BaseException) -> str:
    """Return file and line where an exception was raised, in parentheses.

    "" where it says them itself, as a SyntaxError does.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return ""
    frames = traceback.extract_tb(error.__traceback__)
    return f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
