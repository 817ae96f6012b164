"""A scenario whose arms are files: found beside it, written down with their hash, run as others."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dualbend import load_scenario, make_run
from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.run.arms import arm_pair, with_placements
from dualbend.run.disk.saved import load_run
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.load import parse_scenario
from dualbend.scenario.scenario import Scenario
from support.arm_files import NAMES, six

BESIDE = """
extends = "tuned"
name = "mine"

[robot]
model = "arms/mine.urdf"
arm.payload_kg = 5.0

[motion]
speed_rad_per_s = 0.3
settle_s = 0.1
hold_s = 0.1

[path]
end_rad = 0.2
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    six().write(tmp_path / "arms", "mine.urdf")
    (tmp_path / "mine.toml").write_text(BESIDE)
    return tmp_path / "mine.toml"


def test_a_file_is_found_from_the_scenario_and_from_the_folder_of_a_setting(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = str(tmp_path / "arms" / "mine.urdf")
    assert load_scenario(str(scenario)).robot.model == wanted
    monkeypatch.chdir(tmp_path / "arms")
    assert load_scenario("../mine.toml").robot.model == wanted
    assert load_scenario("fig6", ["robot.model=mine.urdf"]).robot.model == wanted
    assert (
        load_scenario("fig6", {"robot": {"right": {"model": "mine.urdf"}}}).robot.of("right")
        == wanted
    )


def test_a_run_is_made_written_read_and_made_again(scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["run", str(scenario), "--out", str(out), "--no-record"])
    assert done.exit_code == 0, done.output
    first = load_run(out)
    file = tmp_path / "arms" / "mine.urdf"
    assert first.outcome == "completed"
    assert first.summary.arms["left"]["arm"] == "mine.urdf"
    assert first.summary.arms["left"]["file"].startswith(f"{file}, sha256 ")
    again = make_run(load_scenario(str(out / "scenario.toml"))).run()
    for name, _ in first.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(again.trace[name], first.trace[name])

    six().with_joints(lift={"effort": 299.0}).write(tmp_path / "arms", "mine.urdf")
    changed = ["run", str(out / "scenario.toml"), "--out", str(tmp_path / "b"), "--no-record"]
    refused = CliRunner().invoke(main, changed)
    assert refused.exit_code == 2
    assert "mine.urdf: was changed since the run" in refused.output
    with pytest.raises(InputError, match="was changed since the run"):
        load_run(out)
    taken = CliRunner().invoke(main, [*changed, "--set", "robot.arm.sha256=none"])
    assert taken.exit_code == 0, taken.output


def placed(scenario: Path, *settings: str) -> Scenario:
    return with_placements(load_scenario(str(scenario), settings))


def test_places_and_hash_are_written_down_and_load_again(scenario: Path) -> None:
    found = placed(scenario)
    assert found.robot.arm.sha256
    assert parse_scenario(found.to_toml(), "stored") == found
    assert with_placements(found) == found
    mixed = placed(scenario, "robot.right.model=ur5")
    assert mixed.robot.arm.sha256 is None or mixed.robot.left.arm.sha256 is None
    assert parse_scenario(mixed.to_toml(), "stored") == mixed


def test_what_is_said_of_an_arm_goes_with_it(scenario: Path) -> None:
    """Another arm takes nothing over; the side that keeps its arm keeps what is said of it."""
    assert load_scenario(str(scenario), ["robot.model=ur5"]).robot.arm.payload_kg is None
    mixed = load_scenario(str(scenario), ["robot.right.model=ur5"])
    left, right = (placed.model for placed in arm_pair(mixed))
    assert (left.payload_kg, right.payload_kg) == (5.0, 5.0)  # the UR5's own rating is 5 kg, too
    assert right.reach_m == 0.85
    other = load_scenario(str(scenario), ["robot.right.arm.payload_kg=3", "robot.arm.reach_m=0.9"])
    assert [arm.model.payload_kg for arm in arm_pair(other)] == [5.0, 3.0]
    assert [arm.model.reach_m for arm in arm_pair(other)] == [0.9, 0.9]


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["robot.model=mine.xacro"], "xacro is expanded first: xacro arm.urdf.xacro > arm.urdf"),
        (["robot.model=none.urdf"], r"left arm: .*none\.urdf: cannot be read: No such file"),
        (["robot.model=~nobody-of-that-name/a.urdf"], "a.urdf: cannot be read"),
        (["robot.arm.packages=[3]"], r"robot.arm.packages\[0\] = 3: must be a text"),
        (["robot.arm.flange=hand"], "robot.arm.flange = 'hand': no such link; there are base_link"),
        (["robot.arm.payload_kg=-1"], "robot.arm.payload_kg = -1: must be a number > 0"),
        (["robot.arm.palyoad_kg=1"], "unknown key; did you mean payload_kg"),
        (["cell.home_rad=[0,0,0,0,0,0,0]"], "cell.home_rad has 7 values, the left arm 'mine.urdf'"),
        (["robot.arm.speed_limit_rad_per_s=[1,1,1,1,1,1,1]"], "has 7 values, the arm 6 joints"),
        (["robot.model=puma560", "robot.arm.payload_kg=1"], "of 'puma560' nothing is missing"),
        (["robot.arm.payload_kg=0.5"], "are above its payload of 0.5 kg"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(scenario: Path, settings: list[str], says: str) -> None:
    with pytest.raises(InputError, match=says):
        make_run(load_scenario(str(scenario), settings))


def test_every_joint_of_the_file_has_its_columns(scenario: Path) -> None:
    run = make_run(load_scenario(str(scenario)))
    assert run.cell.arms.left.model.joint_names == NAMES
    units = dict(run.run().trace.columns)
    assert units["left_q_joint6"] == "rad"
    assert units["right_torque_joint1"] == "N m"
