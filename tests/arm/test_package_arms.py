"""Every arm of six and more joints in example-robot-data, by its file's path alone."""

import pytest

from dualbend import load_scenario, make_run
from dualbend.arm.catalog import PACKAGE, package_folder
from dualbend.arm.facts import ArmFacts
from dualbend.arm.model import arm_model
from dualbend.errors import InputError
from dualbend.validation.cases.runs import LINEAR, moment_error

ROBOTS = package_folder(PACKAGE) / "robots"

UR, PANDA = ("base_link", "tool0", 6), ("panda_link0", "panda_link8", 7)
JACO = ("j2s6s200_link_base", "j2s6s200_end_effector", 6)
Z1, TIAGO = ("link00", "gripperStator", 6), ("torso_fixed_link", "arm_tool_link", 8)
FOUND: dict[str, tuple[str, str, int]] = {
    **{f"ur_description/urdf/ur3{kind}.urdf": UR for kind in ("_robot", "_gripper")},
    **{f"ur_description/urdf/ur5{kind}.urdf": UR for kind in ("_robot", "_gripper")},
    "ur_description/urdf/ur10_robot.urdf": UR,
    **{f"ur_description/urdf/ur{n}_joint_limited_robot.urdf": UR for n in (3, 5, 10)},
    "panda_description/urdf/panda.urdf": PANDA,
    "panda_description/urdf/panda_collision.urdf": PANDA,
    "xarm_description/urdf/xarm7.urdf": ("link_base", "link_eef", 7),
    "z1_description/urdf/z1.urdf": Z1,
    "b1_description/urdf/b1-z1.urdf": Z1,
    "kinova_description/robots/kinova.urdf": JACO,
    "anymal_b_simple_description/robots/anymal-kinova.urdf": JACO,
    "tiago_description/robots/tiago.urdf": TIAGO,
    "tiago_description/robots/tiago_no_hand.urdf": TIAGO,
    "talos_data/robots/talos_left_arm.urdf": ("arm_left_1_link", "wrist_left_ft_link", 6),
}


@pytest.mark.parametrize("name", FOUND)
def test_an_arm_is_found_in_its_file(name: str) -> None:
    """Where the shipped arms' table names base and flange by hand, they are the ones found."""
    arm = arm_model(str(ROBOTS / name))
    assert arm.file is not None
    base, flange, count = FOUND[name]
    assert (arm.file.facts.base, arm.file.facts.flange, arm.count) == (base, flange, count)


def test_what_is_found_of_a_shipped_arm_is_what_its_table_says() -> None:
    for name in ("ur5", "ur10", "panda", "xarm7", "z1"):
        shipped = arm_model(name)
        assert shipped.file is not None
        found = arm_model(str(shipped.file.file))
        assert found.file is not None
        wanted = shipped.file.facts
        assert found.file.facts.flange_rpy_rad == pytest.approx(wanted.flange_rpy_rad)
        assert found.stiffness_n_m_per_rad == shipped.stiffness_n_m_per_rad
        # A data sheet counts the reach to the wrist, or to the flange.
        assert found.reach_m == pytest.approx(shipped.reach_m, rel=0.15)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("ur_description/urdf/ur3.urdf", "has no link that is not moved by another"),
        ("so_arm_description/urdf/so100.urdf", "5 joints from 'base' to 'gripper'"),
        ("baxter_description/urdf/baxter.urdf", "several chains.*'left_arm_mount' to 'left_hand"),
        ("tiago_description/robots/tiago_dual.urdf", "several chains.*'arm_right_tool_link'"),
        ("anymal_b_simple_description/robots/anymal.urdf", "several chains"),
        ("double_pendulum_description/urdf/double_pendulum.urdf", "2 joints from"),
    ],
)
def test_what_is_no_single_arm_is_refused_with_the_reason(name: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        arm_model(str(ROBOTS / name))


LIGHT = ("sheet.width_m=0.1", "sheet.thickness_m=0.0012")
RUNS: dict[str, tuple[str, tuple[str, ...]]] = {
    **{name: ("fig6", ()) for name in FOUND if name.startswith("ur_")},
    **{name: ("fig6", LIGHT) for name in FOUND if name.startswith("panda")},
    **{
        name: ("exact", LINEAR)
        for name in FOUND
        if name.startswith(("xarm", "kinova", "anymal", "tiago"))
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_two_of_them_bend_a_sheet_as_the_rod_says(name: str) -> None:
    """The moment at the sheet's ends within 10 % of the rod between them; within 1 % found."""
    scenario, settings = RUNS[name]
    own = [f"robot.model={ROBOTS / name}", "imperfections=none", *settings]
    result = make_run(load_scenario(scenario, own)).run()
    assert result.outcome == "completed"
    assert moment_error(result, "edge") < 0.01


def test_one_arm_of_a_larger_robot_is_had_by_its_links() -> None:
    file = str(ROBOTS / "tiago_pro_description/robots/tiago_pro.urdf")
    arm = arm_model(file, ArmFacts(base="torso_lift_link", flange="arm_left_tool_link"))
    assert arm.count == 7
    with pytest.raises(InputError, match=r"arm_left_4_joint needs 32\.4 N m, its limit is 26\.0"):
        # By hand: 83.5 N at 0.270 m, 3.3 N at 0.34 m, 0.1 N m of moment, 8.6 N m of own weight.
        make_run(
            load_scenario(
                "fig6",
                {
                    "imperfections": "none",
                    "robot": {
                        "model": file,
                        "arm": {"base": "torso_lift_link", "flange": "arm_left_tool_link"},
                    },
                },
            )
        )
