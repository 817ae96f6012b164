"""A sweep's runs: kept, gone on with, never repeated, the same whoever makes them."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.scene.simulation import Observation, Simulation
from dualbend.study.engine import RUNS, STUDY
from dualbend.study.sweep import run as sweep_module
from dualbend.study.sweep.design import make_design
from dualbend.study.sweep.file import SCENARIO, load_sweep
from dualbend.study.sweep.report import write_report
from dualbend.study.sweep.row import RunRow, run_row
from dualbend.study.sweep.run import DIED, RunOne, locally, run_sweep
from dualbend.study.sweep.table import TABLE
from support.sweep_stand_in import CALLS, deadly, never, stand_in, unlucky

TEXT = """
scenario = "fig8"
[sample]
kind = "grid"
[keys]
compliance.x.b = { values = [4.0, 7.0, 9.0] }
sheet.length_m = { min = 0.3, max = 0.4, steps = 2 }
"""
SHORT = """
scenario = "fig8"
[set]
path.end_rad = 0.2
motion = { speed_rad_per_s = 0.5, settle_s = 0.2, hold_s = 0.2 }
[sample]
kind = "list"
[keys]
sheet.young_pa = { values = [6e10, 7e10, 1e3, 7e10] }
sheet.length_m = { values = [0.4, 0.35, 0.4, 0.35] }
"""


class InProcess(Executor):
    """Runs at once, where the processes are not what is tested: each takes a second to start."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        pass

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_module, "ProcessPoolExecutor", InProcess)


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "calls"
    monkeypatch.setenv(CALLS, str(path))
    return path


def go(
    folder: Path,
    run: RunOne,
    workers: int = 2,
    text: str = TEXT,
    on_run: Callable[[int, int, str], None] = lambda *_: None,
) -> list[RunRow]:
    """Make a sweep in ``folder``, its file beside it, and its table."""
    file = folder.with_suffix(".toml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    sweep = load_sweep(file)
    design = make_design(sweep)
    rows = run_sweep(sweep, design, folder, locally(workers), run=run, on_run=on_run)
    write_report(sweep, design, rows, folder)
    return rows


def test_a_table_does_not_depend_on_the_number_of_workers(tmp_path: Path, calls: Path) -> None:
    """Analytic: byte for byte the same, each run once, in one thread."""
    alone = go(tmp_path / "one" / "s", stand_in, workers=1)
    assert alone == go(tmp_path / "two" / "s", stand_in, workers=2)
    tables = [(tmp_path / name / "s" / TABLE).read_bytes() for name in ("one", "two")]
    assert tables[0] == tables[1]
    assert Counter(calls.read_text().splitlines()) == {f"{i} 1": 2 for i in range(6)}
    assert [row.index for row in alone] == list(range(6))


@pytest.mark.usefixtures("in_process")
def test_what_is_done_is_not_repeated(tmp_path: Path, calls: Path) -> None:
    """Analytic: of six runs three are kept, one was cut off; three are made again, no other."""
    folder = tmp_path / "s"
    rows = go(folder, stand_in)
    table = (folder / TABLE).read_bytes()
    lines = (folder / RUNS).read_bytes().splitlines(keepends=True)
    (folder / RUNS).write_bytes(b"".join(lines[:3]) + lines[3][:20])
    calls.unlink()
    told: list[tuple[int, int, str]] = []
    assert go(folder, stand_in, on_run=lambda *n: told.append(n)) == rows
    assert [line.split()[0] for line in calls.read_text().splitlines()] == ["3", "4", "5"]
    assert [(done, total) for done, total, _ in told] == [(3, 6), (4, 6), (5, 6), (6, 6)]
    assert [outcome for *_, outcome in told] == ["", "completed", *2 * ["protective_stop"]]
    # Finished: no run is made, table and pictures are.
    (folder / TABLE).unlink()
    assert go(folder, never) == rows
    assert (folder / TABLE).read_bytes() == table
    assert (folder / "heat_peak_moment.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.usefixtures("in_process")
def test_the_folder_of_another_sweep_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    go(folder, stand_in)
    for change, what in (
        (("0.4", "0.39"), "holds a sweep of another sweep; give another folder"),
        (('"fig8"', '"tuned"'), "holds a sweep of another scenario; give another folder"),
        (("[sample]", "[set]\nseed = 4\n[sample]"), "another sweep"),
    ):
        with pytest.raises(InputError, match=what):
            go(folder, never, text=TEXT.replace(*change))
    # A comment, or other metrics to show, are not another sweep.
    go(folder, never, text='# gains\nmetrics = ["peak_moment_by_piece[1]"]\n' + TEXT)
    assert (folder / "heat_peak_moment_by_piece_1.png").exists()
    (folder / STUDY).write_text("{")
    with pytest.raises(InputError, match="no valid JSON"):
        go(folder, never)
    (folder / STUDY).unlink()
    with pytest.raises(InputError, match="whose runs are they"):
        go(folder, never)


@pytest.mark.usefixtures("in_process")
def test_one_process_at_a_time_writes_a_folder(tmp_path: Path) -> None:
    """Analytic: the second is refused while the first runs, and not after it."""
    refused: list[str] = []

    def again(done: int, total: int, outcome: str) -> None:
        if done == 3:
            try:
                go(tmp_path / "s", stand_in)
            except InputError as error:
                refused.append(str(error))

    go(tmp_path / "s", stand_in, on_run=again)
    assert len(refused) == 1
    assert "another process is writing to it" in refused[0]
    go(tmp_path / "s", never)


@pytest.mark.usefixtures("in_process")
def test_a_sweep_that_is_refused_as_a_whole_leaves_no_folder(tmp_path: Path) -> None:
    """So that the file can be put right and the folder used."""
    text = TEXT.replace("0.3, max = 0.4", "30.0, max = 40.0")
    with pytest.raises(InputError, match=r"all 6 runs are refused; run 0: .*length_m = 30"):
        go(tmp_path / "s", never, text=text)
    assert not (tmp_path / "s").exists()


# -- processes that die --------------------------------------------------------------------------


@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
def test_a_run_that_kills_its_process_is_a_row(tmp_path: Path, calls: Path) -> None:
    """Analytic: it is tried once more, alone; the others are not lost."""
    rows = go(tmp_path / "s", deadly, workers=1)
    assert (rows[3].outcome, rows[3].reason, rows[3].metrics) == ("error", DIED, {})
    assert [row.outcome for row in rows if row.index != 3] == [
        *3 * ["completed"],
        *2 * ["protective_stop"],
    ]
    assert go(tmp_path / "s", never) == rows


@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
def test_a_process_that_is_killed_from_outside_costs_no_run(tmp_path: Path, calls: Path) -> None:
    """Analytic: the table of a sweep that nothing happened to."""
    rows = go(tmp_path / "s", unlucky, workers=1)
    assert calls.with_suffix(".killed").exists()
    assert [row.outcome for row in rows] == [*4 * ["completed"], *2 * ["protective_stop"]]


@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
@pytest.mark.usefixtures("in_process")
def test_a_sweep_killed_half_way_repeats_nothing(tmp_path: Path, calls: Path) -> None:
    """Analytic: what was on disk is not run again, the rest once; the table is a whole one's.

    Only the parent is killed: its workers, whose runs would last for a minute, end with it.
    """
    code = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[1])\n"
        "if __name__ == '__main__':\n"
        "    from study.test_sweep import go\n"
        "    from support.sweep_stand_in import slow\n"
        "    go(pathlib.Path(sys.argv[2]), slow)\n"
    )
    script, folder = tmp_path / "script.py", tmp_path / "s"
    script.write_text(code)
    args = [sys.executable, str(script), str(Path(__file__).parents[1]), str(folder)]
    study = subprocess.Popen(args, stderr=subprocess.PIPE)
    for _ in range(600):
        if (folder / RUNS).exists() and (folder / RUNS).read_text().count("\n") == 2:
            break
        time.sleep(0.1)
    study.kill()
    study.communicate(timeout=30)  # until nobody holds the pipe
    assert study.returncode == -signal.SIGKILL
    rows = go(folder, stand_in)
    assert sorted(line.split()[0] for line in calls.read_text().splitlines()) == list("012345")
    assert rows == go(tmp_path / "whole" / "s", stand_in)
    assert (folder / TABLE).read_bytes() == (tmp_path / "whole" / "s" / TABLE).read_bytes()


# -- real runs -----------------------------------------------------------------------------------


def test_a_run_that_raises_is_a_row(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Analytic: so is one that is refused when it is made ready; neither ends the sweep."""
    (tmp_path / "s.toml").write_text(SHORT)
    sweep = load_sweep(tmp_path / "s.toml")

    def raising(simulation: Simulation) -> Observation:
        raise ZeroDivisionError("by nothing")

    far = run_row(4, sweep.resolve(("cell.base_distance_m=2.9",)))
    assert (far.index, far.outcome, far.metrics) == (4, "refused", {})
    assert "out of reach" in far.reason or "cell.base_distance_m" in far.reason
    monkeypatch.setattr(Simulation, "observe", raising)
    found = run_row(1, sweep.resolve())
    assert (found.outcome, found.reason) == ("error", "ZeroDivisionError: by nothing")


def test_the_command_runs_and_makes_again(tmp_path: Path, in_process: None) -> None:
    """Golden words; analytic: equal runs are equal in every number, a refused one says why."""
    import pyarrow.parquet as pq

    file, out = tmp_path / "stiff.toml", tmp_path / "out"
    file.write_text(SHORT)
    first = CliRunner().invoke(main, ["sweep", str(file), "--out", str(out)])
    assert first.exit_code == 0, first.output
    assert "stiff: 4 runs (list): 3 completed, 1 refused" in first.stdout
    assert "4/4 runs, 1 refused" in first.stderr
    table = pq.read_table(out / TABLE).to_pylist()
    assert "sheet.young_pa = 1000" in table[2]["reason"]
    assert {k: v for k, v in table[1].items() if k != "index"} == {
        k: v for k, v in table[3].items() if k != "index"
    }
    assert table[0]["peak_moment"] != table[1]["peak_moment"]
    assert not {"wall_time", "realtime_factor"} & table[0].keys()
    again = CliRunner().invoke(main, ["sweep", str(out)])
    assert again.stdout.replace(str(out), "") == first.stdout.replace(str(out), "")
    assert (out / SCENARIO).exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.toml"], "no sweep's file"),
        (["s.toml", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "give one"),
    ],
)
def test_what_cannot_be_done_ends_with_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, ["sweep", *arguments])
    assert (result.exit_code, message in result.output) == (2, True), result.output
