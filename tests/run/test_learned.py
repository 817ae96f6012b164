"""The file of what was learned: what it says, what it belongs to, what a run does with it."""

import hashlib
from pathlib import Path

import msgspec
import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.errors import InputError
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.disk.saved import load_run
from dualbend.run.learned import LearnedFile, belongings, read_learned
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scenario.motion import nominal_motion
from dualbend.scenario.scenario import Scenario
from support.short_bend import SHORT


def scenario(*settings: str) -> Scenario:
    return load_scenario("learned", [*SHORT, *settings])


def file_of(of: Scenario, turn_rad: float = 0.01) -> LearnedFile:
    cycles = nominal_motion(of.path, of.motion, of.sheet.length_m, of.period_s).cycles
    ramp = np.linspace(0.0, turn_rad, cycles)
    return LearnedFile(
        scenario=of.name,
        seed=of.seed,
        sheets=5,
        force_n=-35.0,
        period_s=COMMAND_PERIOD_S,
        belongs_to=belongings(of),
        correction_rad={"left": ramp.tolist(), "right": (-ramp).tolist()},
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "learned.json"
    path.write_text(file_of(scenario()).to_json(), encoding="utf-8")
    return path


def test_a_file_is_read_as_it_was_written(path: Path) -> None:
    assert read_learned(path) == file_of(scenario())


def test_a_run_turns_each_arm_by_its_correction_and_names_the_file(
    path: Path, tmp_path: Path
) -> None:
    corrected = make_run(scenario(f"path.learned={path}")).run()
    expected = file_of(scenario()).correction
    for side, turn in zip(("left", "right"), expected, strict=True):
        assert corrected[f"{side}_deviation_alpha"] == pytest.approx(turn)
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    assert corrected.learned == f"learned.json, 5 sheets, sha256 {sha256}"
    with run_folder(tmp_path / "run") as kept:
        write_numbers(corrected, kept)
    again = load_run(tmp_path / "run")
    assert again.learned == corrected.learned
    assert again.scenario.path.learned == str(path)
    # The file is not needed to read the run, and the places of its arms do not make it another's.
    assert make_run(again.scenario).run().trace["left_deviation_alpha"] == pytest.approx(
        expected[0]
    )


def test_without_a_file_a_record_speaks_of_none() -> None:
    run = make_run(scenario()).run()
    assert run.learned == ""
    assert "learned" not in run.summary.to_json()


def test_a_scenarios_file_is_found_from_its_own_folder(path: Path) -> None:
    toml = path.with_name("mine.toml")
    toml.write_text('extends = "learned"\n[path]\nlearned = "learned.json"\n', encoding="utf-8")
    assert load_scenario(str(toml)).path.learned == str(path)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("motion.speed_rad_per_s=0.5", "motion.speed_rad_per_s = 1.0, and here it is 0.5"),
        ("sheet.thickness_m=0.0012", "sheet.thickness_m = 0.001, and here it is 0.0012"),
        ("path.end_rad=0.25", "path.end_rad = 0.3, and here it is 0.25"),
        ("robot.model=ur10", "robot.model = 'puma560', and here it is 'ur10'"),
        ("grasp.stiffness_scale=2.0", "grasp"),
    ],
)
def test_what_belongs_to_something_else_is_refused_by_its_key(
    path: Path, setting: str, said: str
) -> None:
    if "grasp" in setting:
        key = msgspec.structs.fields(type(scenario().grasp))[0].encode_name
        setting, said = f"grasp.{key}=123.0", f"grasp.{key} = "
    with pytest.raises(InputError, match=r"path.learned = ") as refused:
        make_run(scenario(setting, f"path.learned={path}"))
    assert said in str(refused.value)
    assert str(refused.value).endswith("learn again: dualbend learn")


def test_a_seed_is_not_what_a_correction_belongs_to(path: Path) -> None:
    file_of(scenario()).refuse_other(scenario("seed=9", "imperfections=none"))


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("format", "another", "format"),
        ("period_s", 0.03, "must be 0.028"),
        ("sheets", 0, "sheets"),
        ("correction_rad", {"left": [0.0]}, "as many values for the left as for the right"),
        ("correction_rad", {"left": [9.0], "right": [0.0]}, "0.5"),
        ("correction_rad", {"left": [0.0], "right": [0.0]}, "has 1 values"),
        ("friction_ratio", [1.0, 1.0], "friction_ratio has 2 values; the arms have 12 joints"),
        ("friction_ratio", [-1.0] * 12, "friction_ratio"),
        ("more", 1, "more"),
    ],
)
def test_a_file_that_was_not_written_so_is_refused(
    path: Path, key: str, value: object, said: str
) -> None:
    told = msgspec.json.decode(path.read_bytes())
    path.write_bytes(msgspec.json.encode({**told, key: value}))
    with pytest.raises(InputError) as refused:
        make_run(scenario(f"path.learned={path}"))
    assert said in str(refused.value)
    assert str(refused.value).count("learned.json") == 1


def test_no_such_file_is_one_message(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^path.learned = '[^']*nothing.json': cannot be read"):
        make_run(scenario(f"path.learned={tmp_path / 'nothing.json'}"))


@pytest.mark.parametrize("setting", ["learning.gain=0.9", "path.learned=some.json"])
def test_an_assembly_does_not_learn(setting: str) -> None:
    with pytest.raises(InputError, match="in this task nothing is learned"):
        load_scenario("pwb", [setting])
