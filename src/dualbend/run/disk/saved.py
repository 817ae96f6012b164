"""A run read back from the folder that it left."""

from __future__ import annotations

import importlib.metadata
import json
import math
from contextlib import suppress
from pathlib import Path

import msgspec
import pyarrow as pa

from dualbend.errors import InputError, refusing
from dualbend.run.disk.folder import LOG, NUMBERS, UNFINISHED, settle
from dualbend.run.record import RunRecord, Summary
from dualbend.run.trace import Trace, read_trace
from dualbend.scenario.load import load_scenario, parse_scenario
from dualbend.scenario.scenario import Scenario

ENDED_FROM_OUTSIDE = "ended from outside"
"""Outcome of a run that did not live to write its summary."""


def load_run(folder: Path | str, *, unfinished: bool = False) -> RunRecord:
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
    settle(folder)
    if missing := ", ".join(name for name in NUMBERS if not (folder / name).is_file()):
        for log in (folder / LOG, folder / UNFINISHED / LOG):
            if log.is_file():
                if unfinished:
                    return _load_unfinished(log)
                raise InputError(
                    f"{folder}: the run was ended before it could write {missing}: "
                    f"there is only {log.relative_to(folder)}; run it again"
                )
        raise InputError(
            f"{folder}: no folder of a run: there is no {missing}; "
            f"dualbend run SCENARIO --out {folder} makes one"
        )
    scenario_file, summary_file, trace_file = (folder / name for name in NUMBERS)
    try:
        scenario = load_scenario(str(scenario_file))
    except InputError as error:
        raise InputError(f"{folder}: {error}{_by_another_version(summary_file)}") from error
    return _record(folder, scenario, _read_summary(summary_file), _whole_trace(trace_file))


def _record(folder: Path, scenario: Scenario, summary: Summary, table: pa.Table) -> RunRecord:
    with refusing(f"{folder}: no trace of a run"):
        trace = Trace.of_table(table)
    simulated_s, wall_time_s = (
        float(metric.value) if metric is not None and isinstance(metric.value, float) else math.nan
        for metric in (summary.metrics.get(name) for name in ("simulated_time", "wall_time"))
    )
    return RunRecord(
        scenario=scenario,
        outcome=summary.outcome,
        reason=summary.reason,
        controller=summary.controller,
        trace=trace,
        simulated_s=simulated_s,
        wall_time_s=wall_time_s,
        folder=folder,
        known=summary,
        model_sha256=_metadata(table).get("model_sha256", ""),
    )


def _load_unfinished(path: Path) -> RunRecord:
    table = _whole_trace(path)
    text = _metadata(table).get("scenario_toml")
    if text is None:
        raise InputError(f"{path}: does not say which scenario it is of; run it again")
    scenario = parse_scenario(text, str(path))
    summary = Summary(
        scenario=scenario.name,
        seed=scenario.seed,
        outcome=ENDED_FROM_OUTSIDE,
        reason=f"killed, or still running; {LOG} has {table.num_rows} cycles",
        versions={},
        metrics={},
    )
    return _record(path.parent, scenario, summary, table)


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


def _read_summary(path: Path) -> Summary:
    with refusing(
        f"{path}: no summary of a run", OSError, msgspec.MsgspecError, UnicodeDecodeError
    ):
        return Summary.of_json(path.read_bytes())


def _whole_trace(path: Path) -> pa.Table:
    table = read_trace(path)
    if not table.num_rows and path.name == LOG:
        raise InputError(f"{path}: the run was ended before its first second was kept")
    needed = {"time", "phase", "nominal_alpha"} - set(table.column_names)
    if needed:
        raise InputError(
            f"{path}: no trace of a run: there is no column {', '.join(sorted(needed))}"
        )
    return table
