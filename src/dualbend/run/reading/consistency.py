"""What was read of a run agrees: scenario, trace and summary can be what one run of it left."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import msgspec
import numpy as np

from dualbend.errors import InputError, refusing
from dualbend.run.arms import side_arm
from dualbend.run.record import RunRecord, task_of
from dualbend.run.trace import OBSERVED, trace_columns
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sections import Outcome
from dualbend.types import SIDES, Mask

_SAME_TIME_S = 1e-9
"""Times are counted in whole periods; what differs is rounding."""

_LARGEST = 1e10
"""Above it the engine itself calls a state bad (``mjMAXVAL``), and the run has failed."""

_SOME = 3
"""Names of columns that a message lists."""


def refuse_contradictions(
    run: RunRecord, about: Mapping[str, str], trace: Path, summary: Path | None
) -> None:
    """Refuse what no run of the scenario leaves.

    ``about``: what the file ``trace`` says of its run; ``summary``: the file, None of a run that
    did not live to write one.

    Raises InputError with file and field: a column, its row and value; a key and its value.
    """
    groups = columns_of(run.scenario, all_axes="left_deviation_y" in run.trace)
    with refusing(str(trace)):
        _refuse_another_run(run, about, finished=summary is not None)
        _refuse_columns(run, [column for group in groups.values() for column in group])
        _refuse_rows(run)
        _refuse_values(run, groups)
        # Version 0.1.0 did not say it; the log of a run that goes on cannot.
        if about.get("values_sha256", run.trace.sha256) != run.trace.sha256:
            raise InputError("was changed after the run: its values are not those of values_sha256")
    if summary is not None:
        with refusing(str(summary)):
            _refuse_ending(run)
            _refuse_shapes(run)


def columns_of(scenario: Scenario, *, all_axes: bool = False) -> dict[str, list[tuple[str, str]]]:
    """Return names and units of the columns that a run of a scenario records, by their origin.

    ``all_axes``: commands from outside, which may deviate in all six.
    """
    joints = {
        f"{side}_{joint}": slides
        for side in SIDES
        for joint, slides in side_arm(scenario, side).scene_slides.items()
    }
    return trace_columns(
        [i for i, side in enumerate(SIDES) if side in scenario.compliance.sensing],
        scenario.sheet.model.sections,
        joints,
        task_of(scenario).part("columns")(scenario),
        link=scenario.imperfections.link.errs,
        slips=scenario.grasp.friction is not None,
        in_space=scenario.compliance.in_space or all_axes,
    )


def refuse_too_many(rows: int, scenario: Scenario) -> None:
    """Raise InputError where a trace has more rows than a run of the scenario has cycles."""
    cycles = task_of(scenario).part("cycles")
    after = scenario.after_stop_cycles
    if cycles is not None and rows > (most := cycles(scenario) + after):
        raise InputError(f"has {rows} rows; a run of scenario.toml has at most {most}")


def _refuse_another_run(run: RunRecord, about: Mapping[str, str], *, finished: bool) -> None:
    scenario, summary = run.scenario, run.summary
    says = [("scenario.toml", "scenario", scenario.name), ("scenario.toml", "seed", scenario.seed)]
    if finished:
        says += [
            ("summary.json", "scenario", summary.scenario),
            ("summary.json", "seed", summary.seed),
        ]
        says += [("summary.json", "outcome", summary.outcome)]
    for file, key, value in says:
        if about.get(key) != str(value):
            raise InputError(
                f"is of a run with {key} {about.get(key)!r}, {file} with {str(value)!r}"
            )
    if finished and not re.fullmatch("[0-9a-f]{64}", run.model_sha256):
        raise InputError(f"model_sha256 = {run.model_sha256!r}: is no SHA-256")


def _refuse_columns(run: RunRecord, wanted: list[tuple[str, str]]) -> None:
    found = run.trace.columns
    if found == wanted:
        return
    has, needs = dict(found), dict(wanted)
    for problem, names in (
        ("has no column {}, which runs of scenario.toml have", [n for n in needs if n not in has]),
        ("has a column {}, which no run of scenario.toml has", [n for n in has if n not in needs]),
    ):
        if names:
            more = f" and {len(names) - _SOME} more" if len(names) > _SOME else ""
            raise InputError(problem.format(", ".join(names[:_SOME]) + more))
    for name, unit in found:
        if unit != needs[name]:
            raise InputError(f"column {name!r} is in {unit!r}, not in {needs[name]!r}")
    raise InputError("has its columns twice, or in another order than a run records them")


def _refuse_rows(run: RunRecord) -> None:
    trace, period_s = run.trace, run.scenario.period_s
    if not trace.rows:
        raise InputError("has no rows: the run ended before its first cycle, nothing can be shown")
    refuse_too_many(trace.rows, run.scenario)
    late = ~(np.abs(trace["time"] - period_s * np.arange(trace.rows)) <= _SAME_TIME_S)
    if late.any():
        right = f"rows are a command period of {period_s:g} s apart, from 0"
        raise InputError(f"{_first(run, 'time', late)}: {right}")
    phase = trace["phase"]
    strange = ~np.isin(phase, np.arange(len(run.phases)))
    if strange.any():
        names = ", ".join(f"{i} {name}" for i, name in enumerate(run.phases))
        raise InputError(f"{_first(run, 'phase', strange)}: the phases are {names}")


def _refuse_values(run: RunRecord, groups: dict[str, list[tuple[str, str]]]) -> None:
    """Refuse what is no number; the last row of a run that did not complete may be cut short."""
    unknown = _unknown(run, [name for name, _ in groups["task"]])
    cut = np.arange(run.trace.rows) == run.trace.rows - 1
    if run.outcome == "protective_stop":
        # The cycle that was begun, and those of arms that nobody commands.
        cut |= run.stopped | np.append(run.stopped[1:], False)
    if run.outcome == "completed":
        cut[-1] = False
    largest = np.finfo(float).max if run.outcome == "failed" else _LARGEST
    for group, columns in groups.items():
        for name, _ in columns:
            values = run.trace[name]
            missing = np.isnan(values)
            allowed = unknown[name] if group == "task" else cut & (group not in OBSERVED)
            bad = (np.abs(values) > largest) | (missing & ~allowed)
            if bad.any():
                raise InputError(f"{_first(run, name, bad)}: no value of a run")


def _unknown(run: RunRecord, names: list[str]) -> dict[str, Mask]:
    """Return where each of the task's columns may be NaN: throughout, or before its first values.

    They are written together, and a row that gets none of its own repeats the one before.
    """
    none = {name: np.isnan(run.trace[name]) for name in names}
    some = np.array([rows for rows in none.values() if not rows.all()])
    before = np.logical_and.accumulate(some.reshape(-1, run.trace.rows).all(axis=0))
    return {name: rows if rows.all() else before for name, rows in none.items()}


def _first(run: RunRecord, name: str, rows: Mask) -> str:
    """Return the first of these rows of a column, and its value."""
    row = int(np.argmax(rows))
    return f"column {name!r}, row {row}: {run.trace[name][row]:g}"


def _refuse_ending(run: RunRecord) -> None:
    if run.outcome not in get_args(Outcome):
        raise InputError(
            f"outcome = {run.outcome!r}: must be one of {', '.join(get_args(Outcome))}"
        )
    metrics, rows = run.summary.metrics, run.trace.rows
    wall = metrics.get("wall_time")
    if wall is not None and not run.wall_time_s > 0.0:
        raise InputError(f"metrics.wall_time = {wall.value}: must be a positive number")
    if "simulated_time" in metrics:
        cycles = run.simulated_s / run.scenario.period_s
        if not rows - 1 - 1e-6 <= cycles <= rows + 1e-6:
            raise InputError(
                f"metrics.simulated_time = {metrics['simulated_time'].value}: "
                f"trace.parquet has {rows} rows of {run.scenario.period_s:g} s"
            )


def _refuse_shapes(run: RunRecord) -> None:
    """Refuse a summary whose values have other units or shapes than those that its trace gives.

    What only one of the two has is another version's.
    """
    try:
        computed = run.task.part("summary")(replace(run, known=None))
    except InputError:
        return  # a task's own metrics may need what only a run in memory has
    said, like = msgspec.to_builtins(run.summary), msgspec.to_builtins(computed)
    for part in ("metrics", "sheet", "arms", "tables"):
        for problem in _unlike(said[part], like[part], part):
            raise InputError(problem)


def _unlike(said: Any, like: Any, at: str) -> Iterator[str]:  # noqa: ANN401 - JSON's values
    """Yield where the values of two trees are of other kinds, or units, in what both have."""
    if isinstance(said, dict) and isinstance(like, dict):
        for key in (key for key in said if key in like):
            yield from _unlike(said[key], like[key], f"{at}.{key}")
    elif isinstance(said, list) and isinstance(like, list):
        if at.startswith("metrics.") and len(said) != len(like):
            yield f"{at} has {len(said)} values; trace.parquet gives {len(like)}"
        for i, item in enumerate(said if like else ()):
            yield from _unlike(item, like[0], f"{at}[{i}]")
    elif at.endswith(".unit") and said != like:
        yield f"{at} = {said!r}: must be {like!r}"
    elif _kind(said) != _kind(like) and None not in (said, like):
        yield f"{at} = {said!r}: must be {_kind(like)}"


def _kind(value: object) -> str:
    """Return what a value of JSON is, in words."""
    kinds = {bool: "true or false", int: "a number", float: "a number", str: "a text"}
    return kinds.get(type(value), "a list" if isinstance(value, list) else "a table")
