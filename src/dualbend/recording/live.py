"""A run in rerun's viewer while it goes on, and in a file at the same time.

The loop only counts: a thread of its own reads the rows that are complete and streams them, so the
run neither waits for the viewer nor notices when it dies.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import sysconfig
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
import rerun as rr

from dualbend.errors import InputError, refusing
from dualbend.recording.log import frame_cycles, recording_log
from dualbend.recording.notes import Notes
from dualbend.recording.scales import Scales
from dualbend.recording.scene import log_scene
from dualbend.recording.write import (
    layout,
    log_lanes,
    log_predicted,
    log_run,
    log_texts,
    open_stream,
)
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord, Scene
from dualbend.run.trace import Trace

SPAWN = "spawn"
"""In place of an address: a viewer of our own."""

UPDATE_S = 0.25
"""Time on the clock between two updates of the viewer, at least."""

_SHARE = 0.05
"""Part of one processor that updates may take: a slow machine gets fewer."""

_DEFAULT_PORT = 9876
_ADDRESS = re.compile(r"rerun(?:\+https?)?://(\[[^\]/]+\]|[^:/]+)(?::(\d+))?/proxy")
_ANSWER_S, _FAREWELL_S = 3.0, 5.0


def check_viewer(address: str, *, screen: bool) -> str:
    """Return the address of a viewer that answers, one started here for ``SPAWN``.

    Raises
    ------
    InputError
        There is no screen for a viewer of our own, or the address is none, or nobody answers.
    """
    if address == SPAWN:
        if not screen:
            raise InputError(
                "--view needs a screen; without one, give a viewer's address, "
                f"--view rerun+http://HOST:{_DEFAULT_PORT}/proxy, or open run.rrd afterwards"
            )
        return _spawn()
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise InputError(
            f"--view {address}: no address of a viewer; it looks like "
            f"rerun+http://127.0.0.1:{_DEFAULT_PORT}/proxy (without one, --view comes last)"
        )
    host, port = match[1].strip("[]"), int(match[2] or _DEFAULT_PORT)
    try:
        socket.create_connection((host, port), timeout=_ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise InputError(
            f"--view {address}: no viewer answers there ({error}); start one with "
            f"rerun --port {port}, or leave the address out"
        ) from error
    return address


def _spawn() -> str:
    """Start a viewer, or find the one that listens already."""
    scripts = Path(sysconfig.get_path("scripts"))
    found = shutil.which("rerun", path=os.pathsep.join((str(scripts), os.environ.get("PATH", ""))))
    with refusing("--view: rerun's viewer does not start", RuntimeError):
        rr.spawn(port=_DEFAULT_PORT, connect=False, executable_path=found)
    return f"rerun+http://127.0.0.1:{_DEFAULT_PORT}/proxy"


class LiveRecording:
    """Streams a run's complete rows to a viewer and, with ``path``, to a file.

    A context: it follows the run inside. :meth:`note` is for the loop, :meth:`end` streams the
    rest. What goes wrong here ends the picture, not the run: ``problem`` says what it was.
    ``address`` is of a viewer that answers, from :func:`check_viewer`. What is in the file
    survives whatever ends the process.
    """

    def __init__(self, run: Run, address: str, path: Path | None) -> None:
        self.problem: str | None = None
        self._run, self._complete, self._streamed = run, 0, 0
        self._scales = Scales.expected(run.scenario)
        self._stop = threading.Event()
        sinks = [rr.GrpcSink(address)]
        if path is not None:
            path.write_bytes(b"")  # refuses a bad path; rerun itself would only warn
            sinks.append(rr.FileSink(path))
        empty = _so_far(run, Trace([], np.empty((0, 0))))
        self._stream = open_stream(empty, ", live")
        self._stream.set_sinks(*sinks, default_blueprint=layout(empty))
        self._thread = threading.Thread(target=self._follow, name="live recording", daemon=True)

    def __enter__(self) -> Self:
        """Begin to follow the run."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop following it, whatever ended it."""
        self.close()

    def note(self, cycles: int) -> None:
        """Take note that so many cycles are complete."""
        self._complete = cycles

    def end(self, result: RunRecord, notes: Notes | None) -> None:
        """Stream what is left, the texts and the lanes' ends; give a dead viewer up."""
        self.close()
        if self.problem is None:
            self._guarded(lambda: self._finish(result, notes))
        self._part()

    def close(self) -> None:
        """Stop the thread."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(_FAREWELL_S)

    def _part(self) -> None:
        """Leave the viewer; one that does not take its data any more is not waited for."""

        def leave() -> None:
            with contextlib.suppress(Exception):
                self._stream.flush(timeout_sec=_FAREWELL_S)
            with contextlib.suppress(Exception):
                self._stream.disconnect()

        farewell = threading.Thread(target=leave, daemon=True)
        farewell.start()
        farewell.join(2.0 * _FAREWELL_S)

    def _follow(self) -> None:
        pause = UPDATE_S
        while self.problem is None and not self._stop.wait(pause):
            before = time.thread_time()
            self._guarded(self._update)
            pause = max(UPDATE_S, (time.thread_time() - before) / _SHARE)

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # whatever it is, the run is worth more than its picture
            self.problem = f"{type(error).__name__}: {error}"

    def _update(self) -> None:
        rows = self._complete
        if rows > self._streamed:
            self._log(_so_far(self._run, self._run.trace.window(0, rows)), ended=False)

    def _finish(self, result: RunRecord, notes: Notes | None) -> None:
        self._log(result, ended=True)
        log = recording_log(self._stream, result)
        log_texts(log, result, self._scales, notes)
        if notes is not None:
            log_predicted(log, notes)

    def _log(self, result: RunRecord, *, ended: bool) -> None:
        """Log the rows that are new; the scene is computed for them and a few before."""
        rows, done = result.trace.rows, self._streamed
        begin = max(
            done - frame_cycles(result.scenario.period_s) - result.scenario.robot.longest_delay - 1,
            0,
        )
        log = recording_log(self._stream, result, done=done, ended=ended)
        if not done:
            log_texts(log, result, self._scales, None, ended=ended)
        log_run(log, result)
        log_lanes(log, result)
        part = replace(result, trace=result.trace.window(begin, rows))
        scene = recording_log(self._stream, part, begin=begin, done=done - begin, ended=ended)
        log_scene(scene, part, self._scales)
        self._streamed = rows


def _so_far(run: Run, trace: Trace) -> RunRecord:
    """Return a run that goes on; it is called completed, which it may never be."""
    return RunRecord(
        scenario=run.scenario,
        outcome="completed",
        trace=trace,
        scene=Scene(
            compiled=run.cell.with_looks, bend_stiffness=run.cell.simulation.bend_stiffness
        ),
        simulated_s=trace.rows * run.scenario.period_s,
        wall_time_s=0.0,
        identity=run.identity,
    )
