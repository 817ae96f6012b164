"""The folder that a run leaves: scenario, summary, trace, picture and recording."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
import pyarrow.parquet as pq

from dualbend.errors import InputError, refusing, writing
from dualbend.run.disk.folder import LOG, UNFINISHED, RunFolder
from dualbend.run.disk.stream import read_trace
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace


def write_numbers(result: RunRecord, kept: RunFolder) -> None:
    """Write scenario, trace and summary of a run in the place of an earlier one's.

    The log of the run goes when the trace that replaces it has been read back.

    Raises InputError where a file cannot be written, or cannot be read back: then the folder holds
    the earlier run, if any, and the log.
    """
    writers = {
        "scenario.toml": _write_scenario,
        "trace.parquet": _write_trace,
        "summary.json": _write_summary,
    }
    log = Path(UNFINISHED) / LOG
    with writing(kept.folder, "--out"):
        folder, logged = kept.unfinished, (kept.folder / log).exists()
    for name, write in writers.items():
        rest = f"; its log is {kept.folder / log}" if logged else ""
        with refusing(f"--out {kept.folder}: {name} cannot be written{rest}", OSError, InputError):
            write(result, folder / name)
    with refusing(f"--out {kept.folder}: the run cannot be put in place", OSError):
        kept.swap_in()


def _write_scenario(result: RunRecord, path: Path) -> None:
    """Write ``scenario.toml``, resolved: it makes the same run again."""
    text = result.scenario.to_toml()
    named = text if result.identity is None else result.identity.to_toml(text)
    path.write_text(named, encoding="utf-8")


def _write_trace(result: RunRecord, path: Path) -> None:
    """Write ``trace.parquet``, one row a cycle, units in the columns' metadata; read it back.

    Raises InputError where that cannot be read or reads otherwise.
    """
    about = {
        "scenario": result.scenario.name,
        "seed": str(result.scenario.seed),
        "outcome": result.outcome,
        "model_sha256": model_hash(result.model),
        "values_sha256": result.trace.sha256,
        **({} if result.identity is None else result.identity.to_metadata()),
    }
    pq.write_table(result.trace.table(about), path)
    if not result.trace.equals(Trace.of_table(read_trace(path))):
        raise InputError("it reads otherwise than it was written")


def _write_summary(result: RunRecord, path: Path) -> None:
    """Write ``summary.json``."""
    text = json_text(msgspec.structs.replace(result.summary, run=result.identity).to_json())
    path.write_text(text, encoding="utf-8")


def json_text(content: dict[str, Any]) -> str:
    """Return JSON as a person reads it."""
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def model_hash(model: mujoco.MjModel) -> str:
    """Return the SHA-256 of the compiled model: equal models make equal runs."""
    buffer = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return hashlib.sha256(buffer.tobytes()).hexdigest()
