"""The folder that a run leaves: scenario, summary, trace, picture and recording."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import mujoco
import numpy as np

from dualbend.errors import InputError
from dualbend.run.runner import RunResult


def prepare_folder(folder: Path) -> None:
    """Make the folder, before anything is computed; InputError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".dualbend"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be written to: {error.strerror}") from error


def write_scenario(result: RunResult, folder: Path) -> None:
    """Write ``scenario.toml``, resolved: it makes the same run again."""
    (folder / "scenario.toml").write_text(result.scenario.to_toml(), encoding="utf-8")


def write_trace(result: RunResult, folder: Path) -> None:
    """Write ``trace.parquet``, one row a cycle, units in the columns' metadata."""
    metadata = {
        "scenario": result.scenario.name,
        "seed": str(result.scenario.seed),
        "outcome": result.outcome,
        "model_sha256": model_hash(result.model),
    }
    result.trace.write(folder / "trace.parquet", metadata)


def write_summary(summary: dict[str, object], folder: Path) -> None:
    """Write ``summary.json``."""
    text = json.dumps(summary, indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")


def model_hash(model: mujoco.MjModel) -> str:
    """Return the SHA-256 of the compiled model: equal models make equal runs."""
    buffer = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return hashlib.sha256(buffer.tobytes()).hexdigest()
