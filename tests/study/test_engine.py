"""The engine of studies: runs are kept, not repeated, and the same whoever makes them."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from dualbend.errors import InputError
from dualbend.study.engine import Study, WorkerDiedError
from dualbend.study.folder import RUNS, STUDY, StudyFolder
from dualbend.study.processes import DIED, in_processes
from support.small_runs import Row, deadly, never, plain, unlucky

TOLD = tuple[int, int, int | None]


def study(run: Callable[[int], Row], runs: int = 6, *, rows_of_lost: bool = True) -> Study:
    return Study(
        design=range(runs),
        task=lambda index: (index,),
        run_one=run,
        key=lambda row: row.index,
        lost=Row if rows_of_lost else None,
    )


def kept(folder: Path, **said: object) -> StudyFolder[Row]:
    return StudyFolder(folder=folder, row=Row, study=said)


def indices(calls: Path) -> list[str]:
    return [line.split()[0] for line in calls.read_text().splitlines()]


ALL = [Row(index) for index in range(6)]


def test_rows_do_not_depend_on_the_number_of_workers(calls: Path) -> None:
    """Analytic: the same rows in the design's order, each run once, in one thread."""
    assert study(plain).run(in_processes(1)) == study(plain).run(in_processes(2)) == ALL
    assert Counter(calls.read_text().splitlines()) == {f"{i} 1": 2 for i in range(6)}


@pytest.mark.usefixtures("in_process")
def test_what_is_done_is_not_repeated(tmp_path: Path, calls: Path) -> None:
    """Analytic: of six rows three are kept, one was cut off; three are made again, no other."""
    folder = tmp_path / "s"
    study(plain).run(in_processes(2), kept(folder))
    lines = (folder / RUNS).read_bytes().splitlines(keepends=True)
    (folder / RUNS).write_bytes(b"".join(lines[:3]) + lines[3][:5])
    calls.unlink()
    told: list[TOLD] = []

    def tell(done: int, total: int, row: Row | None) -> None:
        told.append((done, total, row and row.index))

    assert study(plain).run(in_processes(2), kept(folder), tell) == ALL
    assert indices(calls) == ["3", "4", "5"]
    assert told == [(3, 6, None), (4, 6, 3), (5, 6, 4), (6, 6, 5)]
    # Complete: nothing is run, and of a shorter study it is the beginning.
    assert study(never, 4).run(in_processes(2), kept(folder)) == ALL[:4]


@pytest.mark.usefixtures("in_process")
def test_a_row_that_needs_no_run_is_kept_before_the_others(tmp_path: Path, calls: Path) -> None:
    mixed = study(plain)
    object.__setattr__(mixed, "task", lambda i: Row(i, "refused") if i == 4 else (i,))
    rows = mixed.run(in_processes(2), kept(tmp_path / "s"))
    assert [row.said for row in rows] == [*4 * ["done"], "refused", "done"]
    assert "4" not in indices(calls)
    assert b"refused" in (tmp_path / "s" / RUNS).read_bytes().splitlines()[0]


@pytest.mark.usefixtures("in_process")
def test_a_folder_that_is_not_this_study_s_is_refused(tmp_path: Path) -> None:
    def again(**said: object) -> None:
        study(never).run(in_processes(2), kept(tmp_path, **{"seed": 7, "text": "a\nb", **said}))

    study(plain).run(in_processes(2), kept(tmp_path, seed=7, text="a\nb"))
    again()
    with pytest.raises(InputError, match=r"holds a study of another seed \(seed = 7, now 8\)"):
        again(seed=8)
    with pytest.raises(InputError, match="a study of another text"):
        again(text="a\nc")
    with (tmp_path / RUNS).open("a") as file:
        file.write("{}\n")
    with pytest.raises(InputError, match="line 7 is no run"):
        again()
    (tmp_path / STUDY).write_text("{")
    with pytest.raises(InputError, match=r"study\.json: no study"):
        again()
    (tmp_path / STUDY).unlink()
    with pytest.raises(InputError, match="whose runs are they"):
        again()


@pytest.mark.usefixtures("in_process")
def test_one_process_at_a_time_writes_a_folder(tmp_path: Path) -> None:
    """Analytic: the second is refused while the first runs, and not after it."""
    refused: list[int] = []

    def again(done: int, _: int, __: Row | None) -> None:
        with pytest.raises(InputError, match="another process is writing to it"):
            study(plain).run(in_processes(2), kept(tmp_path))
        refused.append(done)

    study(plain).run(in_processes(2), kept(tmp_path), again)
    assert refused == list(range(7))
    study(never).run(in_processes(2), kept(tmp_path))


def test_a_run_that_kills_its_process_is_lost_and_no_other(tmp_path: Path, calls: Path) -> None:
    """Analytic: it is tried once more, alone; without a row for it the study ends, and goes on."""
    with pytest.raises(WorkerDiedError, match="a worker process died"):
        study(deadly, rows_of_lost=False).run(in_processes(1), kept(tmp_path / "s"))
    assert Counter(indices(calls))["3"] == 2
    rows = study(deadly).run(in_processes(1), kept(tmp_path / "s"))
    assert rows == [Row(i, DIED) if i == 3 else Row(i) for i in range(6)]
    assert study(never).run(in_processes(1), kept(tmp_path / "s")) == rows


@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
def test_a_process_that_is_killed_from_outside_costs_no_run(calls: Path) -> None:
    assert study(unlucky, rows_of_lost=False).run(in_processes(1)) == ALL
    assert calls.with_suffix(".killed").exists()


CODE = """
import pathlib, sys
sys.path.insert(0, sys.argv[1])
if __name__ == "__main__":
    from study.test_engine import in_processes, kept, study
    from dualbend.cli.process import signals_raised
    from support.small_runs import slow
    with signals_raised() as came:
        try:
            study(slow).run(in_processes(2), kept(pathlib.Path(sys.argv[2])))
        except KeyboardInterrupt:
            sys.exit(128 + came[0])
"""


@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGHUP, signal.SIGKILL])
def test_a_study_that_is_ended_keeps_what_is_done_and_ends_its_workers(
    sent: signal.Signals, tmp_path: Path, calls: Path
) -> None:
    """Analytic: what is on disk is not run again; workers, busy for a minute, end at once.

    Ctrl-C, and a terminal that is closed, reach the whole process group: nothing but one
    KeyboardInterrupt comes of it. The other signal only reaches the parent.
    """
    script, folder = tmp_path / "script.py", tmp_path / "s"
    script.write_text(CODE)
    args = [sys.executable, str(script), str(Path(__file__).parents[1]), str(folder)]
    parent = subprocess.Popen(args, stderr=subprocess.PIPE, start_new_session=True)
    for _ in range(600):
        if (folder / RUNS).exists() and (folder / RUNS).read_text().count("\n") == 2:
            break
        time.sleep(0.1)
    asked = time.monotonic()
    (os.kill if sent == signal.SIGKILL else os.killpg)(parent.pid, sent)
    _, errors = parent.communicate(timeout=30)  # until nobody holds the pipe
    if sent != signal.SIGKILL:
        assert (parent.returncode, errors) == (128 + sent, b"")
    assert time.monotonic() - asked < 20.0
    assert study(plain).run(in_processes(2), kept(folder)) == ALL
    assert sorted(indices(calls)) == list("012345")
