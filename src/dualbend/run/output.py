"""The folder that a run leaves: scenario, summary, trace, picture and recording."""

from __future__ import annotations

import hashlib
import json
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from dualbend.errors import writing
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.run.trace import TraceStream
from dualbend.scenario.scenario import Scenario


def prepare_folder(folder: Path) -> None:
    """Make the folder, before anything is computed; InputError where that cannot be."""
    with writing(folder, "--out"):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let an interrupt wait: what took a run to compute is written within a second or so.

    A process that is started meanwhile has interrupts blocked, where the system can do that.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    blocked = hasattr(signal, "pthread_sigmask")
    if blocked:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if blocked:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, before)
    if came:
        signal.raise_signal(signal.SIGINT)


def write_scenario(result: RunRecord, path: Path) -> None:
    """Write ``scenario.toml``, resolved: it makes the same run again."""
    path.write_text(result.scenario.to_toml(), encoding="utf-8")


def write_trace(result: RunRecord, path: Path) -> None:
    """Write ``trace.parquet``, one row a cycle, units in the columns' metadata."""
    about = _about(result.scenario, result.outcome)
    result.trace.write(path, {**about, "model_sha256": model_hash(result.model)})


def _about(scenario: Scenario, outcome: str) -> dict[str, str]:
    return {"scenario": scenario.name, "seed": str(scenario.seed), "outcome": outcome}


@contextmanager
def trace_kept(run: Run, folder: Path) -> Iterator[Callable[[], None]]:
    """Give what is to be called every cycle so that a killed run leaves ``trace.arrow``.

    The file is gone at the end: ``trace.parquet`` takes its place.
    """
    path = folder / "trace.arrow"
    about = _about(run.scenario, "unknown")
    stream = TraceStream(path, {**about, "scenario_toml": run.scenario.to_toml()})
    try:
        yield lambda: stream.update(run.trace)
    finally:
        stream.close()
        path.unlink(missing_ok=True)


def write_summary(result: RunRecord, path: Path) -> None:
    """Write ``summary.json``."""
    write_json(result.summary.to_json(), path)


def write_json(content: dict[str, Any], path: Path) -> None:
    """Write a JSON file as a person reads it."""
    text = json.dumps(content, indent=2, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def model_hash(model: mujoco.MjModel) -> str:
    """Return the SHA-256 of the compiled model: equal models make equal runs."""
    buffer = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return hashlib.sha256(buffer.tobytes()).hexdigest()
