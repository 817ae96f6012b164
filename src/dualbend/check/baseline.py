"""The baseline: what every scenario's metrics were, how far each may move, and with what versions.

One JSON file, keys sorted, written the same from the same numbers, so that it is committed and its
differences are read.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from dualbend.check.settings import Settings
from dualbend.check.tolerances import Tolerance
from dualbend.errors import InputError, writing
from dualbend.files import write_whole
from dualbend.run.reading.json_file import read_json
from dualbend.types import Config

DEFAULT_FILE = Path("baseline.json")

EndedAs = Literal["completed", "aborted", "protective_stop", "failed", "refused", "crashed"]

CRASHED: Literal["crashed"] = "crashed"
"""Outcome of a scenario on which the program itself failed; no baseline holds it."""

_LINE_DEPTH = 4
"""In the file, scenarios / name / metrics or settings / name: what is below is on one line."""

Value = float | list[float | None] | None


class Gate(Config):
    """A metric's value in the baseline, its unit and how far it may move."""

    value: Value
    unit: str
    tolerance: Tolerance


class Entry(Config, omit_defaults=True):
    """A scenario in the baseline.

    ``source``: a shipped scenario's name, or a file relative to the baseline. ``model_sha256``: of
    the compiled model to seven digits. ``settings``: of the resolved scenario; {} in an earlier
    version's file, which had ``scenario_sha256`` for them: it is read, and no longer compared.
    """

    source: Annotated[str, msgspec.Meta(min_length=1)]
    outcome: EndedAs
    model_sha256: str
    scenario_sha256: str = ""
    settings: Settings = msgspec.field(default_factory=dict)
    versions: dict[str, str]
    metrics: dict[str, Gate]


class Baseline(Config):
    """All scenarios of a baseline, by name."""

    format: Literal[1] = 1
    scenarios: dict[str, Entry] = msgspec.field(default_factory=dict)


def find_baseline(file: Path | None, *, update: bool) -> Path:
    """Return the baseline's file: the given one, else ``baseline.json`` here.

    Raises InputError where it does not exist and is not about to be written.
    """
    path = DEFAULT_FILE if file is None else file
    if update or path.is_file():
        return path
    asked = "no ./baseline.json here" if file is None else f"--baseline {file}: no such file"
    raise InputError(
        f"{asked}; give the file with --baseline, or make it: dualbend check SCENARIO ... --update"
    )


def read_baseline(path: Path) -> Baseline:
    """Read a baseline; InputError, which says where, if it cannot be read or is none."""
    return read_json(path, Baseline, "baseline")


def write_baseline(baseline: Baseline, path: Path) -> None:
    """Write a baseline, keys sorted; the old file stays whole until the new one is.

    Raises InputError where ``path`` cannot be written.
    """
    text = _text(msgspec.to_builtins(baseline))
    with writing(path):
        write_whole(path, text + "\n")


def _text(value: object, depth: int = 0) -> str:
    """Return JSON with sorted keys and a line a metric or table, so that changes are seen."""
    if not isinstance(value, dict) or not value or depth == _LINE_DEPTH:
        return json.dumps(value, sort_keys=True, allow_nan=False, ensure_ascii=False)
    indent = " " * (depth + 1)
    items = (f"{indent}{json.dumps(k)}: {_text(value[k], depth + 1)}" for k in sorted(value))
    return "{\n" + ",\n".join(items) + "\n" + " " * depth + "}"


def rounded(value: Value) -> Value:
    """Return a value with nine significant digits: more differ between platforms by rounding."""
    if isinstance(value, list):
        return [None if item is None else float(f"{item:.9g}") for item in value]
    return None if value is None else float(f"{value:.9g}")


def sources(asked: Sequence[str], baseline: Baseline, path: Path) -> list[str]:
    """Return what to run: what is asked for, else all that the baseline holds.

    Files are as :func:`~dualbend.scenario.load.load_scenario` takes them, from the working folder.
    """
    if asked:
        return list(asked)
    return [resolve_source(entry.source, path) for entry in baseline.scenarios.values()]


def resolve_source(source: str, path: Path) -> str:
    """Return a baseline's source as it is found from the working folder."""
    return str(path.parent / source) if source.endswith(".toml") else source


def relative_source(source: str, path: Path) -> str:
    """Return a source as the baseline at ``path`` names it: the same on every machine."""
    if not Path(source).is_file():
        return source
    return Path(os.path.relpath(source, path.parent)).as_posix()
