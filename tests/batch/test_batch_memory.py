"""The trace of a batch goes to a temporary file, and nobody sees it; no file outlives the batch."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dualbend.batch import trace as streaming
from dualbend.batch.loop import BatchLoop
from dualbend.batch.many import run_many
from dualbend.control.controller import Observation
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from dualbend.types import Vector

SHORT = ("sheet.model.hinges=4", "motion.speed_rad_per_s=0.8", "motion.settle_s=0.1")
CASES = [("path.end_rad=0.1",), ("path.end_rad=0.2",), ("path.end_rad=0.1", "motion.hold_s=0.3")]


def made(*settings: str, seed: int = 1) -> BendingRun:
    run = make_run(load_scenario("fig8", (*SHORT, "motion.hold_s=0.1", *settings), seed=seed))
    assert isinstance(run, BendingRun)
    return run


def batch() -> Iterator[BendingRun]:
    return (made(*case, seed=seed) for seed, case in enumerate(CASES))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the temporary folder, in which batches of more than four cycles have a file."""
    monkeypatch.setattr(streaming, "_ROWS", 1)
    monkeypatch.setattr(streaming, "_LEAST", 4)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def files_in(folder: Path) -> list[str]:
    """Return what is in a folder, and what this process has open there without a name."""
    links = Path("/proc/self/fd").glob("*")  # of Linux; elsewhere there are none
    opened = [str(link.readlink()) for link in links if link.is_symlink()]
    return [*map(str, folder.iterdir()), *(path for path in opened if str(folder) in path)]


def test_records_of_a_batch_that_streams_are_those_of_runs_alone(folder: Path) -> None:
    """Worlds that end in different blocks of the file, positions and grips' turns included."""
    found = {i: record for i, record in run_many(batch()) if isinstance(record, RunRecord)}
    assert len({record.trace.rows for record in found.values()}) == len(CASES)
    for i, alone in enumerate(batch()):
        record, wanted = found[i], alone.run()
        assert record.trace.columns == wanted.trace.columns
        assert "left_grip_roll" in record.trace
        np.testing.assert_array_equal(record.trace.qpos, wanted.trace.qpos)
        same = [name for name, _ in wanted.trace.columns if name != "wall_s"]
        for name in same:
            np.testing.assert_array_equal(record[name], wanted[name], err_msg=name)
    assert not files_in(folder)


def test_a_batch_needs_no_more_memory_for_a_longer_run_and_a_record_only_its_own(
    folder: Path,
) -> None:
    short, long = (
        BatchLoop([made(f"motion.hold_s={hold}", seed=i) for i in range(2)]) for hold in (0.1, 2.0)
    )
    assert short.cycles[0] < long.cycles[0]
    assert short.trace.kept.nbytes == long.trace.kept.nbytes
    assert len(files_in(folder)) == 2
    _, record = next(short.run())
    held = record.trace.qpos.base
    assert held is not None
    assert held.shape[:-1] == (record.trace.rows,)


def test_small_batches_have_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "not there"))
    assert len(list(run_many(batch()))) == len(CASES)


@pytest.mark.parametrize("end", ["left", "interrupted"])
def test_no_file_is_left_of_a_batch_that_does_not_end(folder: Path, end: str) -> None:
    def interrupts(observation: Observation) -> Vector:
        if observation.time_s > 0.2:
            assert files_in(folder)
            raise KeyboardInterrupt
        return np.zeros((2, 6))

    if end == "left":
        records = run_many(batch())
        assert isinstance(next(records)[1], RunRecord)
        assert files_in(folder)
        del records
    else:
        scenario = load_scenario("fig8", SHORT)
        runs = [make_run(scenario, compliance=lambda _: interrupts) for _ in range(2)]
        with pytest.raises(KeyboardInterrupt) as caught:
            list(run_many(runs))
        assert caught.value
    assert not files_in(folder)


def test_a_folder_that_cannot_hold_the_traces_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    said = rf"{folder}\S*: cannot hold the traces of 3 runs, \d+ MB; set TMPDIR .*: No space left"
    with monkeypatch.context() as while_it_runs:
        while_it_runs.setattr(streaming, "write_all", full)
        with pytest.raises(InputError, match=said):
            list(run_many(batch()))
    assert not files_in(folder)
    with monkeypatch.context() as from_the_start:
        from_the_start.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=0))
        with pytest.raises(InputError, match=said):
            next(run_many(batch()))
    monkeypatch.setattr("tempfile.tempdir", str(folder / "not there"))
    with pytest.raises(InputError, match=r"not there: cannot hold.*No such file"):
        next(run_many(batch()))
