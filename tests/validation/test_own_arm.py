"""What `dualbend arms --check` says of a file, against numbers that are known beforehand."""

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from dualbend.arm.model import arm_model
from dualbend.cli import main
from dualbend.validation.own_arm import look_at, model_of
from support.arm_files import MASSES, NAMES, six, write_mjcf


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return six().write(tmp_path_factory.mktemp("arm"))


def test_the_step_is_that_of_a_spring_and_a_mass(file: Path) -> None:
    """Critically damped: half way at ω t = 1.678, no overshoot; the others' motion adds little."""
    found = look_at(arm_model(str(file)))
    for joint in found.joints:
        assert joint.frequency_hz == pytest.approx(joint.expected_hz, rel=0.05)
        assert joint.overshoot < 0.02
    # Exact for the last joint but for what its motion moves of the others: 20 Hz by the rule.
    assert found.joints[-1].expected_hz == pytest.approx(20.0, rel=0.05)


def test_weights_are_those_of_the_links(file: Path) -> None:
    """By hand: beyond the pan nothing has an upright axis; the lift holds all links stretched."""
    found = look_at(arm_model(str(file)))
    assert found.mass_kg == pytest.approx(sum(MASSES))
    assert [joint.link_kg for joint in found.joints] == pytest.approx(MASSES)
    weights = [joint.weight_torque for joint in found.joints]
    assert weights[0] == pytest.approx(0.0, abs=1e-9)
    # Heights of the centres over the lift's axis with the arm straight, kg m.
    levers = [(8.0, 0.05), (3.0, 0.47), (1.5, 0.87), (1.5, 0.87), (0.8, 0.97)]
    stretched = 9.81 * sum(mass * lever for mass, lever in levers)
    # The sample's largest is near, and not far beyond: links fold in more than they add.
    assert 0.9 * stretched < weights[1] < 1.02 * stretched


def test_on_a_wall_the_first_joint_bears_the_arm(file: Path) -> None:
    """Upright its axis is along the weights; on a wall it holds what the lift holds upright."""
    arm, down = model_of(str(file), ["cell.base_pitch_rad=1.5707963"])
    np.testing.assert_allclose(down, [1.0, 0.0, 0.0], atol=1e-7)  # z is forward, so x is down
    wall, upright = look_at(arm, down).joints, look_at(arm).joints
    # Its reach is a little longer by what the shoulder is off the axis.
    assert wall[0].weight_torque == pytest.approx(upright[1].weight_torque, rel=0.1)


def test_the_command_prints_and_draws_what_is_found(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "arm.png"
    # A process of its own: the back-end is chosen when MuJoCo is imported.
    command = [sys.executable, "-m", "dualbend", "arms", "--check", str(file), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "6 joints from 'base_link' to 'tool0'" in done.stdout
    for name in NAMES:
        assert name in done.stdout
    picture = np.asarray(Image.open(out).convert("L"), dtype=float)
    assert picture.std() > 10.0  # something stands before the sky


def test_the_command_gives_json_and_takes_settings(tmp_path: Path) -> None:
    file = write_mjcf(tmp_path)
    speed = "robot.arm.speed_limit_rad_per_s=[3,3,3,3,3,2]"
    done = CliRunner().invoke(main, ["arms", "--check", str(file), "--json", "--set", speed])
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    assert [joint["speed_limit"] for joint in found["joints"]] == [3, 3, 3, 3, 3, 2]
    assert found["flange"] == "attachment_site"
    assert math.isclose(found["joints"][0]["range"][1], 2.0 * math.pi)
    lacking = CliRunner().invoke(main, ["arms", "--check", str(file)])
    assert lacking.exit_code == 2
    assert "does not say the speed limit of any joint" in lacking.output


def test_the_command_tells_where_an_arm_of_a_file_would_stand(file: Path) -> None:
    done = CliRunner().invoke(main, ["arms", "--check", str(file), "--for", "tuned"])
    assert done.exit_code == 0, done.output
    assert re.match(r"arm.urdf base 1\.\d+ m behind, .* degrees of room", done.output)
    weak = ["--set", "robot.arm.payload_kg=0.5"]
    refused = CliRunner().invoke(main, ["arms", "--check", str(file), "--for", "tuned", *weak])
    assert "arm.urdf no: " in refused.output
    assert "above its payload of 0.5 kg" in refused.output


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--check", "x.urdf", "--markdown"], "--check cannot be combined with --markdown"),
        (["--out", "x.png"], "--out is of --check"),
        (["--check", "none.urdf"], "none.urdf: cannot be read: No such file"),
        (["--check", "ur55"], "robot.model = 'ur55': must be one of"),
        (["--set", "robot.arm.payload_kg=1"], "give one with --for, or an arm with --check"),
    ],
)
def test_wrong_arguments_are_one_line(arguments: list[str], says: str) -> None:
    done = CliRunner().invoke(main, ["arms", *arguments])
    assert done.exit_code == 2
    assert says in done.output
    assert "Traceback" not in done.output
