"""Rows that a study's folder holds are of that study, or refused with the file, row and field.

Exact, all of them: a folder goes on, or it is refused with this message.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from dualbend.check.baseline import read_baseline
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.study.folder import RUNS, STUDY, StudyFolder
from dualbend.study.onset import study as onsets
from dualbend.study.onset.design import grid
from dualbend.study.onset.results import Case, Rate, Simulated
from dualbend.study.processes import in_processes
from dualbend.study.robustness.run import run_study
from dualbend.study.sweep.design import make_design
from dualbend.study.sweep.file import load_sweep
from dualbend.study.sweep.run import RunRow, run_sweep
from support.small_runs import never
from support.stand_in import PWB, a_sweeps_run, a_trial

SWEEP = """
scenario = "fig8"
[sample]
kind = "list"
[keys.compliance.rotation.b]
values = [1.0, 2.0, 3.0]
"""

Row = dict[str, Any]
Go = Callable[[Path, bool], object]
"""Makes a study in a folder, or goes on with it, where nothing is left to be run."""


def swept(folder: Path, again: bool) -> object:
    file = folder.with_suffix(".toml")
    file.write_text(SWEEP)
    sweep = load_sweep(file)
    run = never if again else a_sweeps_run
    return run_sweep(sweep, make_design(sweep), folder, in_processes(1), run=run)


def robust(folder: Path, again: bool) -> object:
    return run_study(PWB, folder, runs=2, seed=7, run=never if again else a_trial)


def made_up(key: str, _: object, axis: Any, alpha: float, ray: float) -> Case:
    rates = tuple(Rate(b=b, predicted_per_s=1.0, simulated_per_s=None) for b in (0.9, 1.1))
    found = Simulated(
        **{"b": 1.0, "unstable_b": 0.995, "stable_b": 1.005, "frequency_hz": 2.0},
        **{"growing_b": 0.995, "residual": None, "rates": rates, "runs": 9},
    )
    numbers = ("paper_b", "delayed_b", "sampled_b", "sampled_hz", "same_gains_hz")
    return Case(
        **{"key": key, "axis": axis, "alpha_rad": alpha, "ratio_per_s": ray},
        **dict.fromkeys(numbers, 1.0),
        **{"simulated": found, "frictionless": found},
    )


@pytest.fixture
def onset(monkeypatch: pytest.MonkeyPatch) -> Go:
    def go(folder: Path, again: bool) -> object:
        monkeypatch.setattr(onsets, "work", never if again else made_up)
        scenario = load_scenario("fig8")
        points = grid(("rotation",), (0.5,), (5.0, 20.0))
        return onsets.onset_study(scenario, points, folder=folder)

    return go


def rows_of(folder: Path) -> list[Row]:
    return [msgspec.json.decode(line) for line in (folder / RUNS).read_bytes().splitlines()]


def change(folder: Path, at: int, **changed: Any) -> None:
    rows = rows_of(folder)
    rows[at] |= changed
    (folder / RUNS).write_bytes(b"".join(msgspec.json.encode(row) + b"\n" for row in rows))


def refused(folder: Path, go: Go, words: str) -> None:
    before = (folder / RUNS).read_bytes()
    with pytest.raises(InputError, match=words) as caught:
        go(folder, True)
    assert RUNS in str(caught.value)
    assert (folder / RUNS).read_bytes() == before  # what is refused is left as it is


METRIC = {"value": 1.0, "unit": "m"}


@pytest.mark.usefixtures("in_process")
@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"index": 3}, "run 3: the sweep has runs 0 to 2"),
        ({"index": -1}, "run -1: the sweep has runs 0 to 2"),
        ({"index": 0}, "line 3: run 0 is there twice"),
        ({"outcome": "lost"}, r"line 3 is no run: .*outcome"),
        ({"outcome": "refused"}, "run 2: has metrics, and outcome 'refused'"),
        ({"metrics": {"peak_moment": METRIC}}, "run 2: metrics.peak_moment is in 'm', in run 0 in"),
        ({"metrics": []}, r"line 3 is no run: .*metrics"),
    ],
)
def test_a_sweeps_rows_are_of_its_design(tmp_path: Path, changed: Row, words: str) -> None:
    folder = tmp_path / "swept"
    rows = swept(folder, False)
    assert swept(folder, True) == rows
    change(folder, 2, **changed)
    refused(folder, swept, words)


@pytest.mark.usefixtures("in_process")
@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"index": 5}, "draw 5, with compliance: seed = .*: seed 7 draws "),
        ({"index": -1}, "line 1 is no run"),
        ({"compliance": False}, "run .0, False. is there twice"),
        ({"misalignment_m": 1.0}, "draw 0, with compliance: misalignment_m = 1.0: seed 7 draws"),
        ({"hole_errors_m": [[0.0, 0.0]] * 4}, "draw 0, with compliance: hole_errors_m ="),
        ({"hole_errors_m": [[0.0, 0.0]]}, "draw 0, with compliance: hole_errors_m ="),
        ({"success": True, "outcome": "aborted"}, "success, and outcome 'aborted'"),
        ({"holes_seated": 5}, "holes_seated = 5: it has 4"),
        ({"phase": "rest"}, "phase = 'rest': the phases are approach"),
        ({"peak_pin_force_n": -1.0}, "line 1 is no run: .*peak_pin_force_n"),
    ],
)
def test_a_trial_is_of_the_draw_of_its_index(tmp_path: Path, changed: Row, words: str) -> None:
    trials = robust(tmp_path, False)
    assert robust(tmp_path, True) == trials
    change(tmp_path, 0, **changed)
    refused(tmp_path, robust, words)


@pytest.mark.usefixtures("in_process")
@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"alpha_rad": 0.4}, r"is of \('rotation', 0\.4, 5\.0\), its key of"),
        ({"axis": "y"}, "line 1 is no run"),
        ({"sampled_b": None}, "line 1 is no run"),
    ],
)
def test_a_case_is_of_its_key(tmp_path: Path, onset: Go, changed: Row, words: str) -> None:
    assert onset(tmp_path, False) == onset(tmp_path, True)
    change(tmp_path, 0, **changed)
    refused(tmp_path, onset, words)


@pytest.mark.usefixtures("in_process")
def test_an_onset_lies_in_its_interval(tmp_path: Path, onset: Go) -> None:
    onset(tmp_path, False)
    found = rows_of(tmp_path)[1]["simulated"]
    change(tmp_path, 1, simulated={**found, "b": 2.0})
    refused(
        tmp_path, onset, r"simulated\.b = 2\.0 must be positive and between unstable_b = 0\.995"
    )


@pytest.mark.usefixtures("in_process")
def test_what_is_no_row_at_the_end_is_not_cut_off(tmp_path: Path) -> None:
    """Only the beginning of a row is what an interrupt leaves."""
    robust(tmp_path, False)
    rows = (tmp_path / RUNS).read_bytes()
    (tmp_path / RUNS).write_bytes(rows + b'{"index":')
    robust(tmp_path, True)
    assert (tmp_path / RUNS).read_bytes() == rows
    (tmp_path / RUNS).write_bytes(rows + b"some text")
    refused(tmp_path, robust, "line 5 is no run, nor the beginning of one")


@pytest.mark.usefixtures("in_process")
def test_rows_of_another_study_are_refused(tmp_path: Path) -> None:
    """Two sweeps of one size: only the name in each row tells them apart."""
    row = RunRow(index=0, outcome="completed")
    one, other = (
        StudyFolder(folder=tmp_path, row=RunRow, study={"sweep": text}) for text in ("a", "b")
    )
    for owner, refused in ((one, False), (other, True)):
        (tmp_path / STUDY).write_text(json.dumps(one.study))
        (tmp_path / RUNS).write_bytes(owner.line(row))
        if refused:
            with (
                pytest.raises(InputError, match=r"line 1 is no run: it is of another one"),
                one.opened(lambda row: row.index),
            ):
                pass
        else:
            with one.opened(lambda row: row.index) as (rows, _):
                assert rows == {0: row}


@pytest.mark.slow
@pytest.mark.parametrize("name", [STUDY, RUNS])
def test_what_is_no_file_is_refused(tmp_path: Path, name: str) -> None:
    robust(tmp_path, False)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=f"{name}: is no file"):
        robust(tmp_path, True)


@pytest.mark.usefixtures("in_process")
def test_a_study_says_what_it_is_once(tmp_path: Path) -> None:
    robust(tmp_path, False)
    text = (tmp_path / STUDY).read_text()
    (tmp_path / STUDY).write_text(text.replace('"seed": 7,', '"seed": 7, "seed": 7,'))
    with pytest.raises(InputError, match=r"study\.json: no study: key 'seed' is there twice"):
        robust(tmp_path, True)
    (tmp_path / STUDY).write_text(text.replace('"mink": "', '"mink": "0.'))
    with pytest.raises(
        InputError, match=r"another versions \(versions\.mink = '0\..*, by its study"
    ):
        robust(tmp_path, True)


def test_a_baseline_is_as_strict(tmp_path: Path) -> None:
    file = tmp_path / "baseline.json"
    for text, words in (
        ('{"format": 1, "format": 1}', "key 'format' is there twice"),
        ('{"scenarios": {"fig8": {"source": 1}}}', "source"),
        ('{"format": 2}', "format"),
        ("{", "truncated"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=f"baseline.json: no baseline: .*{words}"):
            read_baseline(file)
