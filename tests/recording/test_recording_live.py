"""A run that is watched is the run that is not; a viewer that dies ends its picture alone."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from click.testing import CliRunner, Result
from test_recording import SHORT

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.recording.live import SPAWN, LiveRecording, check_viewer
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from support.made_up_book import make_book
from support.strip import STRIP8


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Viewer:
    """The rerun binary as a server without a window, which saves what it is sent."""

    def __init__(self, saved: Path | None = None) -> None:
        self.port = free_port()
        self.address = f"rerun+http://127.0.0.1:{self.port}/proxy"
        from rerun_cli import __file__ as home

        binary = Path(home).parent / "rerun"
        what = ["--serve-grpc"] if saved is None else ["--save", str(saved)]
        command = [str(binary), *what, "--port", str(self.port)]
        null = subprocess.DEVNULL
        self.process = subprocess.Popen(command, stdin=null, stdout=null, stderr=null)
        for _ in range(100):
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1.0).close()
                return
            except OSError:
                time.sleep(0.1)
        self.kill()
        raise AssertionError("the server does not listen")

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    server = Viewer()
    yield server
    server.kill()


@pytest.fixture(scope="module")
def alone() -> RunRecord:
    return BendingRun(load_scenario(STRIP8, SHORT)).run()


def same(one: RunRecord, other: RunRecord) -> None:
    """Assert that two traces are equal bit for bit, but for the clock on the wall."""
    assert one.outcome == other.outcome
    assert one.trace.rows == other.trace.rows
    for name, _ in one.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(one.trace[name], other.trace[name], err_msg=name)
    np.testing.assert_array_equal(one.trace.qpos, other.trace.qpos)


def rows_in(path: Path, entity: str) -> int:
    return sum(
        len(chunk.to_record_batch())
        for chunk in rr.chunk.RrdReader(path).stream()
        if str(chunk.entity_path) == entity and not chunk.is_static
    )


def test_a_watched_run_is_the_same_bit_for_bit(
    viewer: Viewer, alone: RunRecord, tmp_path: Path
) -> None:
    run, path = BendingRun(load_scenario(STRIP8, SHORT)), tmp_path / "live.rrd"
    with LiveRecording(run, viewer.address, path) as live:
        result = run.run(on_cycle=live.note)
        live.end(result, None)
    assert live.problem is None
    same(result, alone)
    # Exact: every row once, however it fell into updates.
    assert rows_in(path, "/moment/true") == result.trace.rows
    assert rows_in(path, "/phase") == 5
    reader = rr.chunk.RrdReader(path)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    times = np.concatenate(
        [
            chunk.to_record_batch().column("sim_time").to_numpy().astype(np.int64)
            for chunk in reader.stream()
            if str(chunk.entity_path) == "/cell/sheet" and not chunk.is_static
        ]
    )
    assert len(set(times)) == len(times)
    # The scene every third cycle; a frame in which nothing moved is left out.
    assert set(times) <= set(28_000_000 * np.arange(0, result.trace.rows, 3)) | {times.max()}


def test_the_viewer_gets_every_row(tmp_path: Path) -> None:
    saved = tmp_path / "saved.rrd"
    server, run = Viewer(saved), BendingRun(load_scenario(STRIP8, SHORT))
    try:
        with LiveRecording(run, server.address, None) as live:
            result = run.run(on_cycle=live.note)
            live.end(result, None)
        assert live.problem is None
        server.process.send_signal(signal.SIGINT)
        server.process.wait(timeout=20.0)
    finally:
        server.kill()
    assert rows_in(saved, "/moment/true") == result.trace.rows  # exact
    assert rows_in(saved, "/phase") == 5


def test_what_is_streamed_in_pieces_is_what_is_streamed_at_once(
    viewer: Viewer, tmp_path: Path
) -> None:
    run = BendingRun(load_scenario(STRIP8, SHORT))
    result, poses = run.run(), {}
    for name, stops in (("once", ()), ("pieces", (1, 2, 7, 30, 31))):
        path = tmp_path / f"{name}.rrd"
        live = LiveRecording(run, viewer.address, path)  # not entered: no thread
        for rows in stops:
            live.note(rows)
            live._update()
        live.end(result, None)
        poses[name] = {}
        for chunk in rr.chunk.RrdReader(path).stream():
            entity = str(chunk.entity_path)
            if not chunk.is_static and entity.startswith(("/cell/wrench", "/force", "/phase")):
                batch = chunk.to_record_batch()
                times = batch.column("sim_time").to_numpy().astype(np.int64).tolist()
                column = next(n for n in batch.schema.names if n.endswith(("s", "e")) and ":" in n)
                values = zip(times, batch.column(column).to_pylist(), strict=True)
                poses[name].setdefault(entity, {}).update(values)
    assert poses["once"].keys() == poses["pieces"].keys()
    for entity, values in poses["once"].items():
        assert values == poses["pieces"][entity], entity  # exact: the same numbers


def test_a_laid_sheet_of_a_book_is_streamed_once(viewer: Viewer, tmp_path: Path) -> None:
    run, result = make_book()
    run.trace, path = result.trace, tmp_path / "book.rrd"
    live = LiveRecording(run, viewer.address, path)  # not entered: no thread
    for rows in range(5, result.trace.rows, 9):
        live.note(rows)
        live._update()
    live.end(result, None)
    assert live.problem is None
    assert rows_in(path, "/cell/laid/1") == 1  # exact
    assert rows_in(path, "/pin_force") == result.trace.rows


def test_a_viewer_that_dies_does_not_end_the_run(
    viewer: Viewer, alone: RunRecord, tmp_path: Path
) -> None:
    run, path = BendingRun(load_scenario(STRIP8, SHORT)), tmp_path / "live.rrd"
    with LiveRecording(run, viewer.address, path) as live:

        def step(cycles: int) -> None:
            live.note(cycles)
            if cycles == 10:
                viewer.kill()

        result = run.run(on_cycle=step)
        started = time.perf_counter()
        live.end(result, None)
        assert time.perf_counter() - started < 20.0  # it is given up
    same(result, alone)
    assert rows_in(path, "/moment/true") == result.trace.rows


def call(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["run", "fig8", *arguments])


def test_no_screen_and_no_address_is_one_message_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if sys.platform != "linux":
        pytest.skip("there is always a screen")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    done = call("--out", str(tmp_path), "--view")
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 1
    assert "--view needs a screen" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("address", ["fig8", "http://127.0.0.1:9876", "rerun+http://x/nowhere"])
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="no address of a viewer"):
        check_viewer(address, screen=True)


def test_an_address_where_nobody_answers_is_refused(tmp_path: Path) -> None:
    address = f"rerun+http://127.0.0.1:{free_port()}/proxy"
    done = call("--out", str(tmp_path), "--view", address)
    assert done.exit_code == 2
    assert "no viewer answers there" in done.stderr
    with pytest.raises(InputError, match="screen"):
        check_viewer(SPAWN, screen=False)


def test_the_command_shows_and_writes(tmp_path: Path, viewer: Viewer) -> None:
    settings = [part for key in SHORT for part in ("--set", key)]
    done = call("--out", str(tmp_path), *settings, "--view", viewer.address)
    assert done.exit_code == 0, done.output
    assert "MB per simulated minute" in done.stdout
    assert rr.chunk.RrdReader(tmp_path / "run.rrd").store() is not None  # it has its index
