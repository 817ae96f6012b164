"""A run read back from the folder that it left."""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa

from dualbend.errors import InputError, refusing
from dualbend.run.disk.folder import LOG, NUMBERS, UNFINISHED, settle
from dualbend.run.disk.stream import read_trace, trace_head
from dualbend.run.identity import (
    RunIdentity,
    identity_of_metadata,
    identity_of_toml,
    one_identity,
    sha256,
)
from dualbend.run.reading.consistency import refuse_contradictions, refuse_too_many
from dualbend.run.reading.json_file import json_of, read_json
from dualbend.run.record import RunRecord, Summary
from dualbend.run.trace import Trace
from dualbend.scenario.load import parse_scenario
from dualbend.scenario.scenario import Scenario

ENDED_FROM_OUTSIDE = "ended from outside"
"""Outcome of a run that did not live to write its summary."""


def load_run(folder: Path | str, *, unfinished: bool = False) -> RunRecord:
    """Return the run whose files are in ``folder``.

    With ``unfinished``, also what a killed run left: its rows and its scenario, no metrics.

    Raises
    ------
    InputError
        It is no folder of a run, the run did not live to its end, a file is not readable, or the
        files cannot be what one run left: the message has file and field.
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
    try:
        return _load_whole(folder)
    except InputError as error:
        raise InputError(f"{error}{_by_another_version(folder / NUMBERS[1])}") from error


def _load_whole(folder: Path) -> RunRecord:
    scenario_file, summary_file, trace_file = (folder / name for name in NUMBERS)
    scenario, named = _read_scenario(scenario_file)
    summary = _read_summary(summary_file)
    schema, rows = trace_head(trace_file)
    about = _about(schema, trace_file)
    identities = {
        NUMBERS[0]: named,
        NUMBERS[1]: summary.run,
        NUMBERS[2]: _named_by(about, trace_file),
    }
    with refusing(str(folder)):
        one_identity(identities)
    with refusing(str(trace_file)):
        refuse_too_many(rows, scenario)  # before they take memory
    trace = _trace(read_trace(trace_file), trace_file)
    run = _record(folder, scenario, summary, trace, about)
    refuse_contradictions(run, about, trace_file, summary_file)
    return run


def _load_unfinished(path: Path) -> RunRecord:
    table = read_trace(path)
    about = _about(table.schema, path)
    if not table.num_rows:
        raise InputError(f"{path}: the run was ended before its first second was kept")
    text, identity = about.get("scenario_toml", ""), _named_by(about, path)
    if not text:
        raise InputError(f"{path}: does not say which scenario it is of; run it again")
    if identity is not None and sha256(text) != identity.scenario_sha256:
        raise InputError(f"{path}: its scenario is not the one whose SHA-256 it says")
    scenario = parse_scenario(text, str(path))
    summary = Summary(
        run=identity,
        scenario=scenario.name,
        seed=scenario.seed,
        outcome=ENDED_FROM_OUTSIDE,
        reason=f"killed, or still running; {LOG} has {table.num_rows} cycles",
        versions={},
        metrics={},
    )
    run = _record(path.parent, scenario, summary, _trace(table, path), about)
    refuse_contradictions(run, about, path, None)
    return run


def _record(
    folder: Path, scenario: Scenario, summary: Summary, trace: Trace, about: Mapping[str, str]
) -> RunRecord:
    simulated_s, wall_time_s = (
        float(metric.value) if metric is not None and isinstance(metric.value, float) else math.nan
        for metric in (summary.metrics.get(name) for name in ("simulated_time", "wall_time"))
    )
    return RunRecord(
        scenario=scenario,
        outcome=summary.outcome,
        reason=summary.reason,
        controller=summary.controller,
        learned=summary.learned,
        trace=trace,
        simulated_s=simulated_s,
        wall_time_s=wall_time_s,
        folder=folder,
        known=summary,
        model_sha256=about.get("model_sha256", ""),
        identity=summary.run,
    )


def _read_scenario(path: Path) -> tuple[Scenario, RunIdentity | None]:
    with refusing(f"{path}: cannot be read", OSError, UnicodeDecodeError):
        text = path.read_text(encoding="utf-8")
    with refusing(str(path)):
        named = identity_of_toml(text)
    return parse_scenario(text, str(path)), named


def _read_summary(path: Path) -> Summary:
    raw = read_json(path, dict[str, Any], "summary of a run")
    with refusing(str(path)):
        return Summary.of_json(raw)


def _trace(table: pa.Table, path: Path) -> Trace:
    with refusing(f"{path}: no trace of a run"):
        return Trace.of_table(table)


def _about(schema: pa.Schema, path: Path) -> dict[str, str]:
    """Return what a trace says of its run."""
    said = (schema.metadata or {}).get(b"dualbend")
    if said is None:
        raise InputError(f"{path}: no trace of a run: its metadata say of none")
    return json_of(said, dict[str, str], f"{path}: its metadata are not readable")


def _named_by(about: Mapping[str, str], path: Path) -> RunIdentity | None:
    with refusing(str(path)):
        return identity_of_metadata(about)


def _by_another_version(summary_file: Path) -> str:
    """Return which version made the run, where that is not the present one."""
    with suppress(InputError):
        made = _read_summary(summary_file).versions.get("dualbend", "")
        here = importlib.metadata.version("dualbend")
        if made != here:
            return f" (the run was made by dualbend {made or 'of unknown version'}, this is {here})"
    return ""
