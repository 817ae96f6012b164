"""Bases on a wall, hanging, in between: frames, weights, places; and two arms on one torso."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dualbend import load_scenario, make_run
from dualbend.arm.catalog import PACKAGE, package_folder
from dualbend.arm.pair import ArmPair
from dualbend.errors import InputError
from dualbend.run.arms import arm_pair, with_placements
from dualbend.scenario.load import parse_scenario
from dualbend.scene.cell import robots_only
from dualbend.types import SIDES
from dualbend.validation.cases.runs import moment_error
from support.arm_files import J, Robot, link, six

Array = NDArray[np.float64]

WALL, HANGING = "cell.base_pitch_rad=1.5707963", "cell.base_roll_rad=3.1415926"
SHORT = ("motion.speed_rad_per_s=0.2", "motion.settle_s=0.3", "motion.hold_s=0.1")


def tilted(*settings: str, scenario: str = "fig6") -> ArmPair:
    return arm_pair(load_scenario(scenario, ["robot.model=ur10", *settings]))


def turn_of(pitch: float, roll: float, yaw: float = 0.0) -> Array:
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


@pytest.mark.parametrize(("pitch", "roll"), [(0.5 * math.pi, 0.0), (0.0, math.pi), (0.4, -0.9)])
def test_a_tilted_base_turns_the_arm_and_not_its_weight(pitch: float, roll: float) -> None:
    """The whole arm is turned; what it weighs is that of the upright arm under turned gravity."""
    home, place = "cell.home_rad=[0.3,-1,1,0.5,1,0.2]", "cell.base_height_m=1.5"
    stand = ("cell.base_distance_m=1", "cell.base_lateral_m=0.1", "cell.base_yaw_rad=0.3")
    tilt = (f"cell.base_pitch_rad={pitch}", f"cell.base_roll_rad={roll}")
    arms = tilted(home, place, *stand, *tilt)
    model = robots_only(arms).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = arms.home
    mujoco.mj_forward(model, data)
    upright = robots_only(tilted(home, place, *stand)).compile()
    still = mujoco.MjData(upright)
    for i, side in enumerate(SIDES):
        mirrored = Rotation.from_euler("z", math.pi * i).as_matrix()
        wanted = mirrored @ turn_of(pitch, roll, 0.3)
        base = data.body(f"{side}_base")
        np.testing.assert_allclose(base.xmat.reshape(3, 3), wanted, atol=1e-12)  # analytic
        # What gravity is to the tilted arm, told in the frame in which the upright one stands.
        own = mirrored @ turn_of(0.0, 0.0, 0.3)
        upright.opt.gravity[:] = own @ wanted.T @ [0.0, 0.0, -9.81]
        still.qpos[:] = arms.home
        mujoco.mj_forward(upright, still)
        mine = arms.joints(side)
        np.testing.assert_allclose(data.qfrc_bias[mine], still.qfrc_bias[mine], atol=1e-9)


@pytest.mark.parametrize("tilt", [WALL, HANGING, "cell.base_pitch_rad=0.5"])
def test_a_place_is_found_for_a_tilted_base(tilt: str) -> None:
    arms = tilted(tilt)
    placement = arms.left.placement
    key, _, value = tilt.removeprefix("cell.").partition("=")
    assert getattr(placement, key) == float(value)
    assert placement.base_yaw_rad == 0.0
    assert arms.alike
    if tilt == HANGING:
        assert placement.base_height_m > 0.672  # it hangs above the sheet


def test_a_tilt_is_written_down_and_loads_again() -> None:
    found = with_placements(load_scenario("fig6", ["robot.model=ur10", WALL]))
    assert found.cell.base_pitch_rad == 1.5707963
    assert found.cell.base_roll_rad is None
    assert parse_scenario(found.to_toml(), "stored") == found
    upright = with_placements(load_scenario("fig6", ["robot.model=ur10"]))
    assert (upright.cell.base_pitch_rad, upright.cell.base_roll_rad) == (None, None)


@pytest.mark.parametrize("scenario", ["fig6", "fig8"])
def test_ur10s_on_a_wall_bend_the_sheet(scenario: str) -> None:
    """As the standing ones do; fig8's own test is the whole path, here its first pieces."""
    settings = ["robot.model=ur10", WALL, "imperfections=none", "path.end_rad=0.4", *SHORT]
    result = make_run(load_scenario(scenario, settings)).run()
    assert result.outcome == "completed"
    assert moment_error(result, "edge") < 0.03  # discretisation, as for the standing arms
    assert result.metrics["unintended_contacts"].value == 0


def eight() -> Robot:
    """Return eight joints: a rail, and an upper arm that turns about itself."""
    robot = six().with_joints(elbow={"parent": "link_2b"})
    robot = robot.with_links(link_2b=link("link_2b", 2.0), base_link=link("base_link", 30.0))
    roll = J(name="roll", parent="link_2", child="link_2b", xyz="0 0 0.1", low=-3.0, high=3.0)
    rail = {"name": "rail", "kind": "prismatic", "parent": "floor", "child": "base_link"}
    slide = {"axis": "0 1 0", "low": -0.75, "high": 0.75, "effort": 2000.0, "speed": 1.0}
    return robot.plus(["floor"], roll, J(**rail, **slide))  # type: ignore[arg-type]


def test_eight_joints_with_a_rail_bend_the_sheet(tmp_path: Path) -> None:
    """The rail moves, in metres, and the guard watches it in metres."""
    file = eight().write(tmp_path)
    settings = [f"robot.model={file}", "imperfections=none", "path.end_rad=0.4", *SHORT]
    run = make_run(load_scenario("fig6", settings))
    result = run.run()
    assert result.outcome == "completed"
    assert moment_error(result, "edge") < 0.03
    units = dict(result.trace.columns)
    assert units["left_q_joint1"] == units["left_setpoint_joint1"] == "m"
    assert units["left_torque_joint1"] == "N"
    assert units["left_q_joint2"] == "rad"
    assert np.ptp(result["left_q_joint1"]) > 1e-3
    strict = ["guard.following_error_m=1e-7"]
    stopped = make_run(load_scenario("fig6", [*settings, *strict])).run()
    assert stopped.outcome == "protective_stop"
    assert "following error of left_joint1" in stopped.reason
    assert " m, above 1e-07" in stopped.reason


BAXTER = package_folder(PACKAGE) / "robots" / "baxter_description" / "urdf" / "baxter.urdf"
TORSO = (
    f"robot.model={BAXTER}",
    *("robot.left.arm.flange=left_hand_link", "robot.right.arm.flange=right_hand_link"),
    *("cell.base_distance_m=0.219645", "cell.base_height_m=0.5"),
    *("cell.left.base_lateral_m=-0.35", "cell.right.base_lateral_m=0.35"),
    *("cell.left.base_yaw_rad=2.356194", "cell.right.base_yaw_rad=-2.356194"),
    *("sheet.width_m=0.1", "sheet.thickness_m=0.0008"),
)
"""Both arms where the file's torso has them, 0.35 m before the bending plane."""


def test_two_arms_of_one_file_stand_on_their_torso() -> None:
    """Their bases are as far apart, and turned to each other, as the file's own torso has them."""
    arms = arm_pair(load_scenario("fig6", TORSO))
    (left, left_quat), (right, right_quat) = (arms.base_pose(side) for side in SIDES)
    # From the file: mounts at y = ±0.219645 m, turned by ±0.7854 rad.
    assert np.linalg.norm(left - right) == pytest.approx(2 * 0.219645, abs=1e-9)
    turns = [Rotation.from_quat(q, scalar_first=True) for q in (left_quat, right_quat)]
    assert (turns[1].inv() * turns[0]).magnitude() == pytest.approx(2 * 0.7854, abs=1e-4)
    assert arms.left.model.joint_names[0] == "left_s0"
    assert arms.right.model.joint_names[0] == "right_s0"
    assert arms.left.model.range_rad == arms.right.model.range_rad


@pytest.mark.parametrize("scenario", ["fig6", "fig8"])
def test_baxter_bends_the_sheet(scenario: str) -> None:
    settings = (*TORSO, "imperfections=none", "path.end_rad=0.4", *SHORT)
    result = make_run(load_scenario(scenario, settings)).run()
    assert result.outcome == "completed"
    assert moment_error(result, "edge") < 0.03
    assert result.metrics["unintended_contacts"].value == 0


def test_a_sheet_too_stiff_for_baxter_is_refused_with_the_torque() -> None:
    with pytest.raises(InputError, match=r"left_w0 needs 17\.\d N m, its limit is 15\.0"):
        make_run(load_scenario("fig6", [*TORSO, "sheet.thickness_m=0.0012"]))
