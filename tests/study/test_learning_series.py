"""A series of sheets: what it learns, from whom, and how it goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.run.learned import read_learned
from dualbend.run.make import make_run
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.learning.series import LEARNED, Series, run_series
from dualbend.study.learning.sheet import Sheet
from dualbend.types import SIDES
from support.small_runs import never

SHORT = (
    "path.start_rad=0.1",
    "path.end_rad=0.3",
    "path.interval_rad=0.1",
    "motion.speed_rad_per_s=0.1",
    "motion.settle_s=1.0",
    "motion.hold_s=1.0",
    "sheet.model.hinges=10",
    "physics.step_s=0.0035",
    "imperfections=none",
    "robot.servo.friction_estimate=none",
)
FRICTION = ("robot.servo.friction_estimate={}", "imperfections.robot.coulomb_ratio=0.7")


def short(*settings: str) -> Scenario:
    return load_scenario("learned", [*SHORT, *settings])


def with_settings(*settings: str) -> Callable[[Scenario], Scenario]:
    """Return what gives a sheet of a series other settings."""
    other = short(*settings)

    def vary(scenario: Scenario) -> Scenario:
        return msgspec.structs.replace(
            scenario, imperfections=other.imperfections, task=other.task, guard=other.guard
        )

    return vary


def bent(series: Series, sheets: int) -> list[Sheet]:
    return [series.next_sheet()[0] for _ in range(sheets)]


def rms(sheet: Sheet) -> float:
    assert sheet.rms_nm is not None
    return sheet.rms_nm


def test_the_moment_falls_from_sheet_to_sheet_to_what_the_noise_leaves() -> None:
    sheets = bent(Series(short()), 6)
    assert rms(sheets[1]) < 0.5 * rms(sheets[0])
    assert rms(sheets[2]) < 0.7 * rms(sheets[1])
    assert rms(sheets[5]) < 0.015  # three times the noise of a reading
    assert all(sheet.learned for sheet in sheets)


@pytest.mark.parametrize("settings", [(), FRICTION])
def test_what_was_learned_is_what_a_later_run_reads(
    tmp_path: Path, settings: tuple[str, ...]
) -> None:
    series = Series(short(*settings))
    bent(series, 2)
    path = tmp_path / LEARNED
    path.write_text(series.learned().to_json(), encoding="utf-8")
    assert series.learned().sheets == 2
    third, run = series.next_sheet()
    again = make_run(short(*settings, f"path.learned={path}", "repeat=3")).run()
    for name, _ in run.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            assert np.array_equal(again[name], run[name]), name
    assert third.sheet == 3
    assert again.learned.startswith("learned.json, 2 sheets")
    assert ("friction of the joints" in again.learned) == bool(settings)


def test_a_series_that_starts_from_a_file_goes_on_with_it(tmp_path: Path) -> None:
    one = Series(short())
    bent(one, 2)
    expected, _ = one.next_sheet()
    other = Series(short())
    bent(other, 2)
    found, _ = Series(short(), other.learned()).next_sheet()
    assert found.peaks_nm == expected.peaks_nm
    assert found.correction_rad == expected.correction_rad


def test_a_start_of_another_sheet_is_refused() -> None:
    series = Series(short())
    bent(series, 1)
    with pytest.raises(InputError, match=r"learned with sheet.width_m = 0.3"):
        Series(short("sheet.width_m=0.25"), series.learned())


def test_the_friction_of_the_start_stays_that_of_all_sheets() -> None:
    told = Series(short(*FRICTION))
    bent(told, 1)
    start = told.learned()
    assert start.friction is not None
    known = msgspec.structs.replace(start, friction_ratio=[0.5, *start.friction[1:].tolist()])
    series = Series(short(*FRICTION), known)
    bent(series, 1)
    assert series.learned().friction_ratio == known.friction_ratio
    # Another cell has another friction: it is told anew.
    other = Series(msgspec.structs.replace(short(*FRICTION), seed=start.seed + 1), known).friction
    assert other is not None
    assert other[0] != 0.5


@pytest.mark.slow
def test_a_correction_of_a_slower_motion_is_worth_something_at_a_faster_one() -> None:
    slow, fast = Series(short()), short("motion.speed_rad_per_s=0.15")
    bent(slow, 3)
    alone, _ = Series(fast).next_sheet()
    taught, _ = Series(fast, slow.learned()).next_sheet()
    assert rms(taught) < 0.4 * rms(alone)


def test_the_speeds_of_the_first_sheets_lead_up_to_that_of_the_motion() -> None:
    series = Series(short("learning.speeds_rad_per_s=[0.1,0.12]", "motion.speed_rad_per_s=0.14"))
    sheets = bent(series, 3)
    assert [sheet.speed_rad_per_s for sheet in sheets] == [0.1, 0.12, 0.14]
    assert rms(sheets[2]) < rms(sheets[0])
    assert series.learned().belongs_to["motion"]["speed_rad_per_s"] == 0.14


def test_a_way_back_has_no_speeds() -> None:
    with pytest.raises(InputError, match=r"motion.return_rad must be none"):
        Series(short("learning.speeds_rad_per_s=[0.1]", "motion.return_rad=0.2"))


def test_corrections_that_would_grow_are_refused_before_the_first_sheet() -> None:
    with pytest.raises(InputError, match=r"at 1\.\d+ Hz.*would grow"):
        Series(short("learning.lead_cycles=0"))


# --- what can go wrong -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "change"), [("thickness_ratio=1.1", 1.331), ("modulus_ratio=0.8", 0.8)]
)
def test_another_sheet_is_noticed_by_its_force_and_teaches_nothing(
    error: str, change: float
) -> None:
    """A force goes with EI: with the thickness cubed, with the modulus; weight takes from it."""
    series = Series(short())
    usual = bent(series, 3)[-1]
    correction = series.correction
    other, _ = series.next_sheet(with_settings(f"imperfections.sheet.{error}"))
    assert other.force_n is not None
    assert usual.force_n is not None
    assert other.force_n / usual.force_n == pytest.approx(change, rel=0.1)
    assert "another sheet" in other.note
    assert np.array_equal(series.correction, correction)
    after, _ = series.next_sheet()
    assert after.learned
    assert rms(after) < 1.2 * rms(usual)


def test_a_lost_sensor_stops_the_arms_and_teaches_nothing() -> None:
    series = Series(short())
    bent(series, 1)
    correction = series.correction
    lost, _ = series.next_sheet(
        with_settings("imperfections.sensor.stuck=['left']", "imperfections.sensor.stuck_from_s=1")
    )
    assert lost.outcome == "protective_stop"
    assert "protective stop" in lost.note
    assert np.array_equal(series.correction, correction)


def test_a_biased_torque_is_learned_with_the_opposite_sign() -> None:
    """The reading goes to zero, and the moment to minus the bias."""
    sheets = bent(Series(short("sensor.torque_bias_nm=[0.0,0.02,0.0]")), 5)
    assert sheets[-1].hold_nm == pytest.approx([-0.02, -0.02], abs=0.004)


def test_of_one_sensor_the_other_arm_keeps_what_is_not_mirrored() -> None:
    """Both arms are corrected alike: an error of one grip stays at the other arm, halved or so."""
    grip = "task.misalignment={left={pitch_rad=0.005},right={}}"
    one = 'compliance={kind="none",sensing=["left"],complying=[]}'
    both, mirrored = (bent(Series(short(grip, *sensing)), 5)[-1] for sensing in ((), (one,)))
    assert np.abs(both.hold_nm).max() < 0.005
    assert abs(mirrored.hold_nm[0]) < 0.005
    assert abs(mirrored.hold_nm[1]) > 0.03


def test_corrections_stay_within_their_bound() -> None:
    series = Series(short("learning.limit_rad=0.001"))
    bent(series, 2)
    assert np.abs(series.correction).max() == 0.001


# --- folder and command ----------------------------------------------------------------------


@pytest.mark.slow
def test_a_series_goes_on_where_it_was_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run_series({tmp_path / "whole": short()}, 3)
    run_series({tmp_path / "parts": short()}, 2)
    assert run_series({tmp_path / "parts": short()}, 3) == whole
    for name in ("runs.jsonl", LEARNED):
        files = [(tmp_path / part / name).read_bytes() for part in ("whole", "parts")]
        assert files[0] == files[1]
    monkeypatch.setattr("dualbend.study.learning.series.make_run", never)
    assert run_series({tmp_path / "whole": short()}, 3) == whole  # nothing is left


@pytest.mark.slow
def test_cells_that_are_bent_together_are_what_each_is_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the byte, friction that the arms tell included; interrupted between cells of a sheet."""
    drawn = short(*FRICTION, "imperfections.robot.coulomb_spread=0.2")
    scenarios = [msgspec.structs.replace(drawn, seed=seed) for seed in (1, 2)]
    cells = {tmp_path / str(each.seed): each for each in scenarios}

    def interrupt(_: Series, sheet: Sheet | None) -> None:
        if sheet is not None and sheet.sheet == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_series(cells, 2, on_sheet=interrupt)
    rows = [(folder / "runs.jsonl").read_bytes().count(b"\n") for folder in cells]
    assert sorted(rows) == [1, 2]
    both = run_series(cells, 2)
    with monkeypatch.context() as again:
        again.setattr("dualbend.study.learning.series.BATCH", 1)
        again.setattr("dualbend.study.learning.series.Rehearsal", never)
        assert run_series(cells, 2) == both  # nothing is left to run
    for folder, each in cells.items():
        alone = tmp_path / "alone" / folder.name
        run_series({alone: each}, 2)
        for name in ("runs.jsonl", LEARNED, "study.json"):
            assert (folder / name).read_bytes() == (alone / name).read_bytes()


def test_a_sheet_is_done_once_what_it_taught_is_kept(tmp_path: Path) -> None:
    """Killed in between, the same call bends it again, and learned.json is not a sheet behind."""
    (tmp_path / LEARNED).mkdir()
    with pytest.raises(InputError, match=r"learned\.json: cannot be written"):
        run_series({tmp_path: short()}, 1)
    assert not (tmp_path / "runs.jsonl").read_bytes()


def test_the_cell_that_cannot_tell_its_friction_is_named(tmp_path: Path) -> None:
    bad = msgspec.structs.replace(short(*FRICTION, "guard.following_error_rad=5e-5"), seed=7)
    with pytest.raises(InputError, match=r"^seed 7: .*motion without a sheet ended"):
        run_series({tmp_path: bad}, 1)


def test_another_scenario_does_not_go_on_in_the_folder(tmp_path: Path) -> None:
    run_series({tmp_path: short()}, 1)
    with pytest.raises(InputError, match="holds a study of another scenario"):
        run_series({tmp_path: short("learning.gain=0.8")}, 2)


def test_rows_that_are_no_series_are_refused(tmp_path: Path) -> None:
    run_series({tmp_path: short()}, 2)
    runs = tmp_path / "runs.jsonl"
    first, second = runs.read_bytes().splitlines(keepends=True)
    runs.write_bytes(second)
    with pytest.raises(InputError, match=r"runs.jsonl: sheet 2: must be sheet 1"):
        run_series({tmp_path: short()}, 3)
    row = msgspec.json.decode(first)
    row["correction_rad"] = [[0.0], [0.0]]
    runs.write_bytes(msgspec.json.encode(row) + b"\n")
    with pytest.raises(InputError, match=r"sheet 1: .* correction_rad for each of 2 arms"):
        run_series({tmp_path: short()}, 3)


def invoke(*arguments: str) -> tuple[int, str]:
    settings = [part for setting in SHORT for part in ("--set", setting)]
    ended = CliRunner().invoke(main, ["learn", "learned", *settings, *arguments])
    return ended.exit_code, ended.output


def test_the_command_leaves_table_picture_recording_and_what_was_learned(tmp_path: Path) -> None:
    code, output = invoke("--sheets", "2", "--out", str(tmp_path))
    assert code == 0
    assert "|Q (1 − L P)| is at most" in output
    for name in ("table.md", "sheets.png", "sheets.rrd", "learned.json", "runs.jsonl"):
        assert (tmp_path / name).stat().st_size > 100, name
    assert f"path.learned={tmp_path / LEARNED}" in output
    learned = read_learned(tmp_path / LEARNED)
    assert learned.sheets == 2
    assert set(learned.correction_rad) == set(SIDES)


def test_the_command_shows_the_spread_over_cells(tmp_path: Path) -> None:
    cells = ("--seeds", "2", "--no-record", "--out", str(tmp_path))
    code, output = invoke("--sheets", "2", *cells)
    assert code == 0
    alone = tmp_path / "alone"
    assert invoke("--sheets", "2", "--seed", "2", "--no-record", "--out", str(alone))[0] == 0
    for name in ("runs.jsonl", LEARNED, "table.md", "study.json"):
        assert (alone / name).read_bytes() == (tmp_path / "seed-2" / name).read_bytes()
    rows = [read_rows(tmp_path / f"seed-{seed}") for seed in (1, 2)]
    lines = (tmp_path / "cells.md").read_text(encoding="utf-8").splitlines()
    number, count, median, worst, *_ = lines[-1].strip("| ").split(" | ")
    assert (number.strip(), count.strip()) == ("2", "2")
    ratios = np.divide(*([row[i]["peaks_nm"] for row in rows] for i in (1, 0)))
    for text, expected in ((median, np.median(ratios, axis=0)), (worst, ratios.max(axis=0))):
        assert [float(word) for word in text.split(", ")] == pytest.approx(expected, abs=0.006)
    code, output = invoke(*cells, "--from", str(tmp_path / "seed-1" / LEARNED))
    assert code == 2
    assert "--seeds 2: what was learned before" in output


def read_rows(folder: Path) -> list[dict[str, list[float]]]:
    return [msgspec.json.decode(line) for line in (folder / "runs.jsonl").read_bytes().splitlines()]


def test_interrupted_before_the_first_sheet_the_command_says_that_nothing_was_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: Scenario) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("dualbend.study.learning.series.predict_learning", interrupted)
    folder = tmp_path / "sheets"
    code, output = invoke("--out", str(folder))
    assert code == 130
    assert output == "dualbend: interrupted before a run was done; the same command continues\n"
    assert not folder.exists()


def test_friction_that_is_as_it_is_believed_is_said_in_words(tmp_path: Path) -> None:
    """The model of a UR5 has no dry friction: there is nothing to tell."""
    arm = ("--set", "robot.model=ur5", "--set", "robot.servo.friction_estimate={}")
    code, output = invoke("--sheets", "1", "--no-record", "--out", str(tmp_path), *arm)
    assert code == 0
    assert "friction of the joints: as it is believed\n" in output
    assert "1.00" not in output


def test_the_command_refuses_what_would_grow(tmp_path: Path) -> None:
    code, output = invoke("--out", str(tmp_path), "--set", "learning.gain=2.2")
    assert code == 2
    assert "would grow from sheet to sheet" in output
    assert not (tmp_path / LEARNED).exists()


def test_the_command_begins_with_a_file(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    assert invoke("--sheets", "2", "--no-record", "--out", str(first))[0] == 0
    start = ("--from", str(first / LEARNED))
    code, output = invoke("--sheets", "1", "--no-record", "--out", str(second), *start)
    assert code == 0
    assert read_learned(second / LEARNED).sheets == 3
    wider = ("--out", str(tmp_path), "--set", "sheet.width_m=0.2")
    named = ("--set", f"path.learned={first / LEARNED}")
    for given, said in ((start, f"--from {first / LEARNED}"), (named, "path.learned = '")):
        code, output = invoke(*given, *wider)
        assert code == 2
        assert f"dualbend: {said}" in output
        assert "was learned with sheet.width_m = 0.3" in output


def test_a_scenario_that_has_learned_is_gated_like_any_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another correction moves the metrics beyond their tolerance."""
    monkeypatch.chdir(tmp_path)
    series = Series(short())
    bent(series, 2)
    learned = series.learned()
    Path(LEARNED).write_text(learned.to_json(), encoding="utf-8")
    scenario = msgspec.structs.replace(short(f"path.learned={LEARNED}"), name="mine")
    Path("mine.toml").write_text(scenario.to_toml(), encoding="utf-8")
    check = ["check", "mine.toml", "--baseline", "baseline.json", "--workers", "1"]
    assert CliRunner().invoke(main, [*check, "--update"]).exit_code == 0
    assert CliRunner().invoke(main, check).exit_code == 0
    turned = {side: [1.1 * u for u in values] for side, values in learned.correction_rad.items()}
    other = msgspec.structs.replace(learned, correction_rad=turned)
    Path(LEARNED).write_text(other.to_json(), encoding="utf-8")
    ended = CliRunner().invoke(main, check)
    assert ended.exit_code == 1
    assert "peak_deviation_alpha" in ended.output


def test_a_series_without_any_bending_is_shown_as_well(tmp_path: Path) -> None:
    lost = ("imperfections.sensor.stuck=['left']", "imperfections.sensor.stuck_from_s=0.1")
    settings = [part for setting in lost for part in ("--set", setting)]
    assert invoke("--sheets", "1", "--out", str(tmp_path), *settings)[0] == 3
    assert (tmp_path / "sheets.png").is_file()


def test_a_sheet_that_ends_otherwise_ends_the_command(tmp_path: Path) -> None:
    lost = ("imperfections.sensor.stuck=['left']", "imperfections.sensor.stuck_from_s=1")
    settings = [part for setting in lost for part in ("--set", setting)]
    code, output = invoke("--sheets", "3", "--out", str(tmp_path), "--no-record", *settings)
    assert code == 3
    assert "nothing learned: protective stop" in output
    assert not (tmp_path / LEARNED).exists()
    assert len(read_rows(tmp_path)) == 1
    cells = tmp_path / "cells"
    assert invoke("--sheets", "2", "--seeds", "2", "--out", str(cells), *settings)[0] == 3
    assert len(read_rows(cells / "seed-2")) == 1
