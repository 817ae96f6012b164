"""Where an arm stands: the place is good, the same each time, and what is given by hand wins."""

from functools import cache

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm.catalog import PACKAGE, ArmName, package_folder
from dualbend.arm.joint_limits import joint_limit_margins
from dualbend.arm.mjcf import GRIP_SITE
from dualbend.arm.model import arm_model
from dualbend.arm.pair import ArmPair
from dualbend.arm.placement import MIN_MARGIN_RAD, find_placement
from dualbend.errors import InputError
from dualbend.run.arms import arm_pair, path_targets, with_placements
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.scene.arm_compliance import ArmCompliance
from dualbend.scene.cell import robots_only
from dualbend.scene.ik import TOLERANCE_M, TOLERANCE_RAD, InverseKinematics, grip_targets
from support.strip import STRIP6

Array = NDArray[np.float64]
SCENARIO = load_scenario(STRIP6)
NAMES: tuple[ArmName, ...] = ("ur5", "panda")
"""One arm of six joints and one of seven; ``dualbend validate --arm`` measures the others."""


@cache
def pair(*names: ArmName) -> ArmPair:
    left, right = names if len(names) == 2 else names * 2
    return arm_pair(
        load_scenario(STRIP6, [f"robot.left.model={left}", f"robot.right.model={right}"])
    )


@cache
def walked(*names: ArmName) -> Array:
    """Return joint angles along the nominal path, by the inverse kinematics of the runs."""
    return walk(pair(*names), SCENARIO)


def walk(arms: ArmPair, scenario: Scenario) -> Array:
    solver = InverseKinematics(robots_only(arms).compile(), arms.home)
    path, q, rows = scenario.path.make(scenario.sheet.length_m), arms.home, []
    for alpha in np.linspace(0.0, 1.0, 21).tolist():
        half, rise = path.at(alpha)
        pose = np.array([-half, scenario.cell.sheet_height_m + rise, alpha])
        solution = solver.solve_from_home(grip_targets(np.array([pose, pose])), q)
        assert solution.position_residual_m <= TOLERANCE_M
        assert solution.rotation_residual_rad <= TOLERANCE_RAD
        q = solution.q
        rows.append(q)
    return np.array(rows)


@pytest.mark.parametrize("names", [("ur5",), ("panda",), ("puma560", "ur5"), ("panda", "ur5")])
def test_the_inverse_kinematics_keeps_the_joint_limit_margin(names: tuple[ArmName, ...]) -> None:
    for side, margins in joint_limit_margins(pair(*names), walked(*names)).items():
        assert margins.margin_deg is not None
        assert margins.margin_deg >= np.degrees(MIN_MARGIN_RAD), side


@pytest.mark.parametrize(
    ("name", "manipulability", "margin_deg"), [("ur5", 0.599, 105.4), ("panda", 0.654, 42.7)]
)
def test_the_place_that_was_found_is_far_from_singular(
    name: ArmName, manipulability: float, margin_deg: float
) -> None:
    """Golden: manipulability over the arm's largest, and margin, as the search itself had them."""
    margins = joint_limit_margins(pair(name), walked(name))["left"]
    assert margins.manipulability == pytest.approx(manipulability, rel=0.05)
    assert margins.margin_deg == pytest.approx(margin_deg, abs=2.0)


@pytest.mark.parametrize("name", NAMES)
def test_arms_of_a_kind_are_each_others_image(name: ArmName) -> None:
    """A turn by π about the vertical takes one arm to the other: equal angles, turned places."""
    arms = pair(name)
    assert arms.alike
    q = walked(name)[10]
    # Analytic but for the solver's tolerance.
    np.testing.assert_allclose(q[arms.joints("left")], q[arms.joints("right")], atol=1e-5)
    model = robots_only(arms).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = np.tile(q[arms.joints("left")], 2)
    mujoco.mj_kinematics(model, data)
    for body in ("base", "link1", f"link{arms.left.model.count}", "hand"):
        left, right = (data.body(f"{side}_{body}").xpos for side in ("left", "right"))
        np.testing.assert_allclose(right, left * [-1.0, -1.0, 1.0], atol=1e-12)
    left, right = (data.site(f"{side}_{GRIP_SITE}").xpos for side in ("left", "right"))
    np.testing.assert_allclose(right, left * [-1.0, -1.0, 1.0], atol=1e-12)


def test_a_redundant_arm_takes_the_same_angles_whatever_way_it_came() -> None:
    """The solution nearest to the posture depends on the pose alone."""
    arms = pair("panda")
    solver = InverseKinematics(robots_only(arms).compile(), arms.home)
    path = SCENARIO.path.make(SCENARIO.sheet.length_m)
    half, rise = path.at(0.5)
    pose = np.array([-half, SCENARIO.cell.sheet_height_m + rise, 0.5])
    targets = grip_targets(np.array([pose, pose]))
    ways = [solver.solve_from_home(targets, start).q for start in walked("panda")[[8, 13]]]
    # Discretisation-limited: where the iteration stops.
    np.testing.assert_allclose(ways[0], ways[1], atol=1e-5)
    nearest = np.linalg.norm(ways[0] - arms.home)
    model = robots_only(arms).compile()
    data, jacobian = mujoco.MjData(model), np.zeros((6, model.nv))
    data.qpos[:] = ways[0]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    site = model.site(f"left_{GRIP_SITE}").id
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
    null = np.linalg.svd(jacobian)[2][6]
    # At the nearest point the way to the posture is across the motion that is left.
    assert abs(null @ (arms.home - ways[0])) < 1e-4 * max(nearest, 1.0)


def test_the_search_is_deterministic() -> None:
    targets = path_targets(SCENARIO)
    first = find_placement(arm_model("ur5"), targets, {})
    from dualbend.arm import placement

    placement._find.cache_clear()
    assert find_placement(arm_model("ur5"), targets, {}) == first


def test_what_is_given_by_hand_wins() -> None:
    settings = ["robot.model=ur5", "cell.base_distance_m=0.95", "cell.base_height_m=0.5"]
    placed = arm_pair(load_scenario(STRIP6, settings)).left.placement
    assert (placed.base_distance_m, placed.base_height_m) == (0.95, 0.5)
    one = arm_pair(load_scenario(STRIP6, [*settings, "cell.right.base_distance_m=1.0"]))
    assert one.right.placement.base_distance_m == 1.0
    assert one.left.placement == placed


def test_a_placed_scenario_is_itself() -> None:
    """Nothing is left to find in what a run writes, and it says the same place."""
    for settings in (["robot.model=panda"], ["robot.right.model=ur5"], []):
        scenario = load_scenario(STRIP6, settings)
        placed = with_placements(scenario)
        assert with_placements(placed) == placed
        assert arm_pair(placed) == arm_pair(scenario)


def test_another_arm_takes_the_place_of_the_one_before_back() -> None:
    base = load_scenario(STRIP6)
    assert base.cell.base_distance_m == 1.05
    both = load_scenario(STRIP6, ["cell.base_lateral_m=0.1", "robot.model=ur5"])
    assert (both.cell.base_distance_m, both.cell.base_lateral_m) == (None, 0.1)
    one = load_scenario(STRIP6, ["robot.right.model=ur5"])
    assert one.cell.base_distance_m is None
    assert one.cell.left is not None
    assert one.cell.left.base_distance_m == 1.05
    assert one.cell.right is None
    assert load_scenario(STRIP6, ["robot.model=puma560"]) == base


def test_an_arm_that_is_too_short_is_refused_with_the_number() -> None:
    with pytest.raises(InputError, match=r"'ur3' \(reach 0.5 m\).*misses one by \d+ mm"):
        arm_pair(load_scenario(STRIP6, ["robot.model=ur3", "sheet.length_m=3.0"]))


def test_an_arm_whose_joints_do_not_turn_that_far_is_refused() -> None:
    with pytest.raises(InputError, match=r"right arm: arm 'z1'.*misses one by \d+ mm with joint"):
        arm_pair(load_scenario(STRIP6, ["robot.right.model=z1"]))


def test_the_paper_arm_stands_where_it_is_documented() -> None:
    placement = arm_model("puma560").placement
    assert placement is not None
    assert (
        arm_pair(load_scenario(STRIP6, ["cell.base_distance_m=1.075"])).left.placement == placement
    )


def test_a_bent_end_far_from_home_is_followed_to() -> None:
    """The UR3 folds far for the strip: its compliance at the end is that of going there slowly."""
    scenario = load_scenario("tuned", ["robot.model=ur3"])
    arms, path = arm_pair(scenario), scenario.path.make(scenario.sheet.length_m)

    def at(alpha: float) -> Array:
        half, rise = path.at(alpha)
        return np.array([-half, scenario.cell.sheet_height_m + rise, alpha])

    at_once, slowly = (
        ArmCompliance(arms, arms.stiffness, scenario.grasp, integrates=False) for _ in range(2)
    )
    at_once.move(at(1.0))
    for alpha in np.linspace(0.0, 1.0, 21).tolist():
        slowly.move(at(alpha))
    # Limited by the inverse kinematics: 1e-7 m and rad.
    np.testing.assert_allclose(at_once.compliance, slowly.compliance, rtol=1e-5)


SLOW = pytest.mark.slow
TORSOS = {
    "tiago_description/robots/tiago_dual.urdf": ("torso_lift_link", "arm_left_tool_link"),
    "tiago_description/robots/tiago_no_hand.urdf": ("torso_lift_link", "arm_tool_link"),
    "pr2_description/urdf/pr2.urdf": ("torso_lift_link", "l_gripper_tool_frame"),
    "talos_data/robots/talos_reduced.urdf": ("torso_2_link", "gripper_left_base_link"),
}


@pytest.mark.parametrize(
    "name", [next(iter(TORSOS)), *(pytest.param(n, marks=SLOW) for n in list(TORSOS)[1:])]
)
def test_an_arm_that_leaves_its_torso_aside_has_a_place_between_those_of_the_grid(
    name: str,
) -> None:
    base, flange = TORSOS[name]
    file = str(package_folder(PACKAGE) / "robots" / name)
    robot = {"model": file, "arm": {"base": base, "flange": flange}}
    scenario = load_scenario("fig6", {"robot": robot, "imperfections": "none"})
    arms = arm_pair(scenario)
    for margins in joint_limit_margins(arms, walk(arms, scenario)).values():
        assert margins.margin_deg is not None
        assert margins.margin_deg >= np.degrees(MIN_MARGIN_RAD)


def test_the_z1_is_refused_since_its_three_pitch_joints_lack_nine_degrees() -> None:
    """In the plane of its arm, by the closed form of two links and a hand on a grid of bases."""
    z1 = str(package_folder(PACKAGE) / "robots/z1_description/urdf/z1.urdf")
    scenario = load_scenario("fig6", [f"robot.model={z1}"])
    poses = path_targets(scenario)
    # Of the file: shoulder above the base, upper arm, forearm and hand at q = 0, x and z.
    shoulder, upper = np.array([0.0, 0.1035]), np.array([-0.35, 0.0])
    forearm, hand = np.array([0.218, 0.057]), np.array([0.3231, 0.0])
    low, high = np.array([[0.0, -2.8798, -1.5184], [2.9671, 0.0, 1.5184]])
    x, z = np.meshgrid(np.arange(-1.2, 0.1, 0.01), np.arange(0.0, 1.5, 0.01), indexing="ij")
    best = -np.inf
    for elbow in (1.0, -1.0):
        margin = np.full(x.shape, np.inf)
        for pose in poses:
            alpha = np.arccos(pose[0, 0])
            turn = pose[np.ix_([0, 2], [0, 2])]
            wrist = pose[[0, 2], 3] - turn @ hand
            way = wrist[:, None, None] - (np.stack((x, z)) + shoulder[:, None, None])
            a, b = np.hypot(*upper), np.hypot(*forearm)
            cosine = (way[0] ** 2 + way[1] ** 2 - a**2 - b**2) / (2.0 * a * b)
            bent = elbow * np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
            aside = np.arctan2(b * np.sin(bent), a + b * np.cos(bent))
            # A turn about y lowers a slope in the plane of x and z.
            q2 = np.arctan2(upper[1], upper[0]) - np.arctan2(way[1], way[0]) + aside
            q3 = np.arctan2(forearm[1], forearm[0]) - np.arctan2(upper[1], upper[0]) - bent
            q = np.stack((q2, q3, alpha - q2 - q3), axis=-1)
            q = (q + np.pi) % (2.0 * np.pi) - np.pi
            one = np.minimum(q - low, high - q).min(axis=-1)
            margin = np.minimum(margin, np.where(np.isnan(one), -np.inf, one))
        best = max(best, float(margin.max()))
    # Discretisation-limited: a grid of 10 mm, a quarter of a degree.
    assert np.degrees(best) == pytest.approx(-8.8, abs=0.5)
    with pytest.raises(InputError, match="no base reaches all poses of the path"):
        arm_pair(scenario)
