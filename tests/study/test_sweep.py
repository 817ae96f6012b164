"""A sweep's runs: kept, gone on with, never repeated, the same whoever makes them."""

from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.observation import Observation
from dualbend.scene.simulation import Simulation
from dualbend.study.ending import metrics_of
from dualbend.study.engine import Lost, Place
from dualbend.study.folder import RUNS
from dualbend.study.processes import in_processes
from dualbend.study.sweep.design import make_design
from dualbend.study.sweep.file import SCENARIO, load_sweep
from dualbend.study.sweep.report import write_report
from dualbend.study.sweep.run import RunOne, RunRow, run_row, run_sweep
from dualbend.study.sweep.table import TABLE
from support.small_runs import never
from support.stand_in import a_sweeps_run
from support.strip import STRIP8

TEXT = """
scenario = "fig8"
[sample]
kind = "grid"
[keys]
compliance.rotation.b = { values = [4.0, 7.0, 9.0] }
sheet.length_m = { min = 0.3, max = 0.4, steps = 2 }
"""
SHORT = f"""
scenario = "{STRIP8}"
[set]
path.end_rad = 0.2
motion = {{ speed_rad_per_s = 0.5, settle_s = 0.2, hold_s = 0.2 }}
[sample]
kind = "list"
[keys]
sheet.young_pa = {{ values = [6e10, 7e10, 1e3, 7e10] }}
sheet.length_m = {{ values = [0.4, 0.35, 0.4, 0.35] }}
"""


LOCAL = in_processes(2)


def go(
    folder: Path,
    run: RunOne,
    place: Place = LOCAL,
    text: str = TEXT,
    on_run: Callable[[int, int, RunRow | None], None] = lambda *_: None,
) -> list[RunRow]:
    """Make a sweep in ``folder``, its file beside it, and its table."""
    file = folder.with_suffix(".toml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    sweep = load_sweep(file)
    design = make_design(sweep)
    rows = run_sweep(sweep, design, folder, place, run=run, on_run=on_run)
    write_report(sweep, design, rows, folder)
    return rows


@pytest.mark.usefixtures("in_process")
def test_what_is_done_is_not_repeated(tmp_path: Path, calls: Path) -> None:
    """Analytic: of six runs three are kept, one was cut off; three are made again, no other."""
    folder = tmp_path / "s"
    rows = go(folder, a_sweeps_run)
    table = (folder / TABLE).read_bytes()
    lines = (folder / RUNS).read_bytes().splitlines(keepends=True)
    (folder / RUNS).write_bytes(b"".join(lines[:3]) + lines[3][:20])
    calls.unlink()
    told: list[tuple[int, int, RunRow | None]] = []
    assert go(folder, a_sweeps_run, on_run=lambda *n: told.append(n)) == rows
    assert [line.split()[0] for line in calls.read_text().splitlines()] == ["3", "4", "5"]
    assert [(done, total) for done, total, _ in told] == [(3, 6), (4, 6), (5, 6), (6, 6)]
    assert [row and row.outcome for *_, row in told] == [
        *(None, "completed"),
        *2 * ["protective_stop"],
    ]
    # Finished: no run is made, table and pictures are.
    (folder / TABLE).unlink()
    assert go(folder, never) == rows
    assert (folder / TABLE).read_bytes() == table
    assert (folder / "heat_peak_moment.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.usefixtures("in_process")
def test_the_folder_of_another_sweep_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    go(folder, a_sweeps_run)
    for change, what in (
        (("0.4", "0.39"), "holds a study of another sweep, by its study.json"),
        (('"fig8"', '"tuned"'), "holds a study of another scenario, by its study.json"),
        (("[sample]", "[set]\nseed = 4\n[sample]"), "another sweep"),
    ):
        with pytest.raises(InputError, match=what):
            go(folder, never, text=TEXT.replace(*change))
    # A comment, or other metrics to show, are not another sweep.
    go(folder, never, text='# gains\nmetrics = ["peak_moment_by_piece[1]"]\n' + TEXT)
    assert (folder / "heat_peak_moment_by_piece_1.png").exists()


@pytest.mark.usefixtures("in_process")
def test_a_sweep_that_is_refused_as_a_whole_leaves_no_folder(tmp_path: Path) -> None:
    """So that the file can be put right and the folder used."""
    text = TEXT.replace("0.3, max = 0.4", "30.0, max = 40.0")
    with pytest.raises(InputError, match=r"all 6 runs are refused; run 0: .*length_m = 30"):
        go(tmp_path / "s", never, text=text)
    assert not (tmp_path / "s").exists()


@pytest.mark.usefixtures("in_process")
def test_a_misspelt_metric_is_refused_before_a_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"metrics = 'peak_momnet': did you mean peak_moment"):
        go(tmp_path / "s", never, text='metrics = ["peak_momnet"]\n' + TEXT)
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("name", ["fig8", "pwb"])
def test_the_metrics_that_a_sweep_knows_are_those_that_runs_have(name: str, tmp_path: Path) -> None:
    """Exact: by the columns of a run's own metrics, of bending and of an assembly."""
    short = ("path.end_rad=0.18", "motion.speed_rad_per_s=1.0", "motion.hold_s=0.1")
    run = make_run(load_scenario(name, short))
    run.begin()
    for _ in range(60):
        run.step()
    names = ", ".join(f'"{metric}"' for metric in metrics_of(run.record("completed", "", 1.0)))
    text = f"metrics = [{names}]\n{TEXT.replace('fig8', name)}"
    if name == "pwb":
        text = text[: text.index("compliance.rot")] + "physics.step_s = { values = [1.75e-3] }"
    go(tmp_path / "s", *(never, lost_all), text=text)


def lost_all(tasks: Mapping[int, Any], _: object) -> Generator[tuple[int, Lost]]:
    """Make no run."""
    yield from ((index, Lost("its process died")) for index in tasks)


def test_a_run_that_is_lost_is_a_row(tmp_path: Path) -> None:
    rows = go(tmp_path / "s", never, lost_all)
    assert {(row.outcome, row.reason) for row in rows} == {("error", "its process died")}
    assert go(tmp_path / "s", never) == rows


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
