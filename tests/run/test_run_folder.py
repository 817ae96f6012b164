"""A run's folder is whole or not there, whatever ends the process that writes it."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner
from PIL import Image

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.files import locked_folder, part_of, whole_file, write_whole
from dualbend.interrupts import Interrupted
from dualbend.report.results import write_results
from dualbend.run.disk import folder as disk
from dualbend.run.disk import output
from dualbend.run.disk.folder import NUMBERS, RunFolder, run_folder
from dualbend.run.disk.saved import load_run
from dualbend.run.disk.stream import read_trace
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace
from dualbend.scenario.load import load_scenario

SHORT = ("path.end_rad=0.2", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.1")


def make(seed: int) -> RunRecord:
    return make_run(load_scenario("fig6", SHORT, seed)).run()


@pytest.fixture(scope="module")
def runs() -> tuple[RunRecord, RunRecord]:
    return make(1), make(2)


def seed_of(folder: Path) -> int:
    return load_run(folder).summary.seed


def killed_at(step: int, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Let the n-th change of a name in the file system raise what nothing handles."""
    left = step

    def counting(original: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **kwargs: object) -> object:
            nonlocal left
            left -= 1
            if left < 0:
                raise SystemError("killed")
            return original(*args, **kwargs)

        return call

    for name in ("replace", "unlink", "rmdir"):
        monkeypatch.setattr(Path, name, counting(getattr(Path, name)))
    return monkeypatch.undo


@pytest.mark.slow
def test_a_kill_between_any_two_changes_leaves_the_one_run_or_the_other(
    runs: tuple[RunRecord, RunRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Analytic: the earlier run up to the mark, the new one from it on; never a mixture."""
    seen = []
    for step in range(100):
        folder = tmp_path / str(step)
        write_results(runs[0], folder, record=False)
        (folder / "notes.txt").write_text("the user's")
        undo = killed_at(step, monkeypatch)
        try:
            write_results(runs[1], folder, record=False)
            ended = True
        except SystemError:
            ended = False
        undo()
        seen.append(seed_of(folder))
        assert seed_of(folder) == seen[-1]
        assert (folder / "notes.txt").read_text() == "the user's"
        picture = folder / "moment.png"
        if picture.is_file():
            identity = runs[seen[-1] - 1].identity
            assert Image.open(picture).info["Description"] == str(identity)
        if ended:
            break
    assert seen == sorted(seen)
    assert seen.count(1) >= 1
    assert seen.count(2) >= len(NUMBERS)


def test_the_moves_of_a_killed_process_are_done_by_the_next_reader(
    runs: tuple[RunRecord, RunRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_results(runs[0], tmp_path, record=False)
    with monkeypatch.context() as patch, run_folder(tmp_path) as kept:
        patch.setattr(disk, "_move", lambda _: None)
        output.write_numbers(runs[1], kept)
    assert (tmp_path / "unfinished" / "complete").is_file()
    assert seed_of(tmp_path) == 2
    # No picture of the earlier run beside the numbers of this one.
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(NUMBERS)


def test_files_say_which_run_they_are_of(runs: tuple[RunRecord, RunRecord], tmp_path: Path) -> None:
    run = runs[0]
    write_results(run, tmp_path, record=False)
    assert run.identity is not None
    assert run.identity.id != runs[1].identity.id  # type: ignore[union-attr]
    assert (tmp_path / "scenario.toml").read_text().startswith(f"# {run.identity}\n")
    assert load_run(tmp_path).summary.run == run.identity
    about = read_trace(tmp_path / "trace.parquet").schema.metadata[b"dualbend"].decode()
    assert run.identity.id in about
    assert Image.open(tmp_path / "moment.png").info["Description"] == str(run.identity)


def test_an_unreadable_trace_keeps_the_log_and_the_earlier_run(
    runs: tuple[RunRecord, RunRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The log goes only when what replaces it has been read back."""
    write_results(runs[0], tmp_path, record=False)
    run = make_run(load_scenario("fig6", SHORT, 2))
    with run_folder(tmp_path) as kept:
        with kept.log(run) as keep:
            result = run.run(lambda _: keep())

        def other(table: object) -> Trace:
            trace = Trace.of_table(table)
            trace["time"][3] += 1e-12
            return trace

        with monkeypatch.context() as patch:
            patch.setattr(output, "Trace", type("Other", (), {"of_table": staticmethod(other)}))
            with pytest.raises(InputError, match=r"otherwise than it was written"):
                output.write_numbers(result, kept)
        log = tmp_path / "unfinished" / "trace.arrow"
        assert read_trace(log).num_rows == result.trace.rows
        assert seed_of(tmp_path) == 1
        told = CliRunner().invoke(main, ["report", str(tmp_path)])
        assert f"a later run did not end; dualbend report {log.parent} shows it" in told.output
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert load_run(tmp_path).summary.run.id in page  # type: ignore[union-attr]
        output.write_numbers(result, kept)
    assert not log.exists()
    assert seed_of(tmp_path) == 2


def test_a_second_process_is_told_and_changes_nothing(tmp_path: Path) -> None:
    code = "import sys; from dualbend.cli import main; main()"
    command = [sys.executable, "-c", code, "run", "fig6", "--out", str(tmp_path)]
    with run_folder(tmp_path):
        second = subprocess.run(command, check=False, capture_output=True, text=True)
        assert second.returncode == 2
        assert second.stderr.count("\n") == 1
        assert "another process is writing to it" in second.stderr
    assert list(tmp_path.iterdir()) == []


def interrupting(monkeypatch: pytest.MonkeyPatch, at: int) -> None:
    """Let a SIGTERM come in a cycle of the next run."""
    original = Run.run

    def run(self: Run, on_cycle: Callable[[int], None] | None = None) -> RunRecord:
        def on(cycles: int) -> None:
            if on_cycle is not None:
                on_cycle(cycles)
            if cycles == at:
                raise Interrupted(signal.SIGTERM)

        return original(self, on)

    monkeypatch.setattr(Run, "run", run)


def test_a_signal_leaves_an_earlier_run_as_it_was(
    runs: tuple[RunRecord, RunRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With an earlier run only the log is kept; without one, the half run is the result."""
    interrupting(monkeypatch, 20)
    asked = ["run", "fig6", *(w for s in SHORT for w in ("--set", s)), "--no-record", "--out"]
    result = CliRunner().invoke(main, [*asked, str(tmp_path / "new")])
    assert result.exit_code == 128 + signal.SIGTERM
    assert load_run(tmp_path / "new").trace.rows == 20
    write_results(runs[1], tmp_path / "old", record=False)
    result = CliRunner().invoke(main, [*asked, str(tmp_path / "old")])
    assert result.exit_code == 128 + signal.SIGTERM
    assert "the earlier run in" in result.output
    assert seed_of(tmp_path / "old") == 2
    assert load_run(tmp_path / "old" / "unfinished", unfinished=True).trace.rows == 20


def test_a_lock_is_free_after_its_process_and_leaves_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    with locked_folder(folder), pytest.raises(InputError), locked_folder(folder):
        pass
    assert list(tmp_path.iterdir()) == []
    folder.mkdir(parents=True)
    (folder / ".lock").touch()  # of a process that was killed
    with locked_folder(folder):
        (folder / "kept").touch()
    assert [path.name for path in folder.iterdir()] == ["kept"]


def test_a_refused_scenario_leaves_no_folder(tmp_path: Path) -> None:
    out = tmp_path / "runs" / "x"
    asked = ["run", "fig6", "--set", "robot.model=z1", "--out", str(out)]
    assert CliRunner().invoke(main, asked).exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_whole_or_what_it_was(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), whole_file(path) as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert not part_of(path).exists()
    link = tmp_path / "link.html"
    link.symlink_to(path)
    write_whole(link, "new")
    assert link.is_symlink()
    assert path.read_text() == "new"
    circle = tmp_path / "circle"
    circle.symlink_to(circle)
    with pytest.raises(OSError, match="symbolic links"):
        write_whole(circle / "page.html", "x")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_what_is_no_file_is_written_to_directly() -> None:
    with pytest.raises(OSError, match="No space left"):
        write_whole(Path("/dev/full"), "x")
    assert Path("/dev/full").is_char_device()


def test_a_full_disk_ends_the_log_until_there_is_room(
    runs: tuple[RunRecord, RunRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Analytic: batches that failed are written with the next one; nothing is twice or missing."""
    trace = runs[0].trace
    run = make_run(load_scenario("fig6", SHORT, 1))
    writes = 0

    def failing(file: object, data: bytes) -> None:
        nonlocal writes
        writes += 1
        if writes in (1, 3, 4):
            os.write(file.fileno(), data[: len(data) // 2])  # type: ignore[attr-defined]
            raise OSError(28, "No space left on device")
        os.write(file.fileno(), data)  # type: ignore[attr-defined]

    monkeypatch.setattr("dualbend.run.disk.stream.write_all", failing)
    monkeypatch.setattr("dualbend.run.disk.stream.TraceStream._BATCH_ROWS", 5)
    with RunFolder(tmp_path).log(run) as keep:
        result = run.run(lambda _: keep())
    kept = Trace.of_table(read_trace(tmp_path / "unfinished" / "trace.arrow"))
    assert writes > 6
    assert kept.equals(result.trace)
    assert result.trace.rows == trace.rows
    shutil.rmtree(tmp_path / "unfinished")
