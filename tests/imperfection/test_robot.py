"""Arms that are not as believed: each error against what it does by hand calculation."""

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dualbend.arm.mjcf import FT_SITE, GRIP_SITE
from dualbend.arm.pair import ArmPair, paper_pair
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.errors import InputError
from dualbend.imperfection.draws import cut_normal, stream
from dualbend.imperfection.robot import RobotErrors, TrueArms, _scale
from dualbend.mechanics.jacobian import site_jacobian
from dualbend.run.arms import arm_pair
from dualbend.run.cell import RobotCell
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import robots_only
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES
from support.strip import STRIP6

Array = NDArray[np.float64]
PAIR = paper_pair()
RNG = np.random.default_rng(4)


def free_cell(*errors: str) -> RobotCell:
    """Return the paper's arms at rest at the flat sheet, which nobody holds."""
    settings = ["sheet.model.hinges=4", *(f"imperfections.robot.{error}" for error in errors)]
    scenario = load_scenario(STRIP6, settings)
    start = [-0.5 * scenario.sheet.length_m, scenario.cell.sheet_height_m, 0.0]
    cell = RobotCell(scenario, np.array(start))
    cell.reset()
    cell.simulation.data.eq_active[:] = 0
    return cell


def true_robots(config: RobotErrors, arms: ArmPair = PAIR, seed: int = 1) -> mujoco.MjModel:
    spec = robots_only(arms)
    TrueArms(config, arms, seed).write(spec)
    return spec.compile()


def at(model: mujoco.MjModel, q: Array) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return data


def error_at_speed(cell: RobotCell, speed: float, cycles: int = 50) -> Array:
    """Return reference minus angle [rad] of all joints after 1.4 s at one speed [rad/s]."""
    simulation, q = cell.simulation, cell.home.copy()
    simulation.model.opt.gravity[:] = 0.0
    for _ in range(cycles):
        simulation.observe()
        q += speed * 0.028
        cell.send(q)
    return cell.response.position - simulation.q


# --- friction -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def perfect() -> Array:
    return error_at_speed(free_cell(), 0.05)


@pytest.mark.parametrize("ratio", [0.8, 1.3])
def test_coulomb_friction_that_is_not_fed_forward_is_a_constant_error(
    ratio: float, perfect: Array
) -> None:
    cell = free_cell(f"coulomb_ratio={ratio}")
    coulomb = cell.ik.model.dof_frictionloss
    found = error_at_speed(cell, 0.05) - perfect
    # Analytic: what is fed forward is T_c, what is needed ratio T_c, so k e = (ratio − 1) T_c.
    np.testing.assert_allclose(found * cell.servo.stiffness, (ratio - 1.0) * coulomb, rtol=2e-3)


def test_viscous_friction_that_is_not_fed_forward_is_an_error_in_the_speed(perfect: Array) -> None:
    cell = free_cell("viscous_ratio=1.5")
    found = error_at_speed(cell, 0.05) - perfect
    wanted = 0.5 * cell.ik.model.dof_damping.ravel() * 0.05
    # Analytic: k e = (ratio − 1) B v.
    np.testing.assert_allclose(found * cell.servo.stiffness, wanted, rtol=5e-3)


def test_sliding_friction_falls_with_the_speed(perfect: Array) -> None:
    cell = free_cell("stiction_excess=0.3", "stribeck_speed_rad_per_s=0.05")
    found = error_at_speed(cell, 0.05) - perfect
    wanted = 0.3 * math.exp(-1.0) * cell.ik.model.dof_frictionloss
    # Analytic: at v = v_s the excess is s T_c / e.
    np.testing.assert_allclose(found * cell.servo.stiffness, wanted, rtol=5e-3)


@pytest.mark.parametrize("joint", [0, 3])
def test_a_joint_at_rest_breaks_away_at_the_stiction_and_not_before(joint: int) -> None:
    cell = free_cell("stiction_excess=1.0", "stribeck_speed_rad_per_s=0.002")
    simulation, k = cell.simulation, cell.servo.stiffness[joint]
    simulation.model.opt.gravity[:] = 0.0
    coulomb = cell.ik.model.dof_frictionloss[joint]
    moved = []
    for share in (0.98, 1.02):
        simulation.data.qfrc_applied[simulation.dofs[joint]] = share * 2.0 * coulomb
        for _ in range(12):
            simulation.observe()
            cell.send(cell.home)
        moved.append(simulation.q[joint] - cell.home[joint])
    # Analytic: T_s = 2 T_c holds; once it slides T_c is left, and it goes at least to where
    # k x = load − T_s of the end, and at most twice as far as k x = load − T_c.
    assert abs(moved[0]) < 0.01 * coulomb / k
    assert 0.5 * coulomb / k < moved[1] < 2.1 * coulomb / k


def test_a_second_start_is_at_rest_again() -> None:
    cell = free_cell("stiction_excess=1.0")
    fresh = cell.simulation.model.dof_frictionloss.copy()
    error_at_speed(cell, 0.05, cycles=4)
    assert (cell.simulation.model.dof_frictionloss != fresh).any()
    cell.reset()
    np.testing.assert_array_equal(cell.simulation.model.dof_frictionloss, fresh)


# --- masses -------------------------------------------------------------------------------------


def sag(cell: RobotCell) -> Array:
    """Return how far all joints are off after 0.3 s of holding still [rad]."""
    for _ in range(11):
        cell.simulation.observe()
        cell.send(cell.home)
    return cell.home - cell.simulation.q


def test_masses_that_are_ten_percent_more_than_believed_sag_under_a_tenth_of_the_weight() -> None:
    cell = free_cell("coulomb_ratio=0", "link_mass_ratio=1.1", "tool_mass_ratio=1.1")
    weight = at(cell.ik.model, cell.home).qfrc_bias
    # Analytic: k x = 0.1 of the torque that holds arm and tool up.
    found = sag(cell) * cell.servo.stiffness
    np.testing.assert_allclose(found, 0.1 * weight, rtol=5e-3, atol=2e-3)
    assert np.abs(found).max() > 2.0


def test_any_mass_is_compiled_also_of_a_link_whose_principal_moment_is_the_sum_of_the_others() -> (
    None
):
    """The published PUMA's third link is such a one; 1e-12: what rounding is kept from."""
    for ratio in np.random.default_rng(5).uniform(0.8, 1.2, 200):
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(mass=4.8, inertia=[0.066, 0.0785, 0.0125])
        body.explicitinertial = True
        body.add_joint()
        _scale(body, float(ratio))
        model = spec.compile()
        assert model.body_mass[1] == 4.8 * ratio
        np.testing.assert_allclose(
            sorted(model.body_inertia[1]), ratio * np.array([0.0125, 0.066, 0.0785]), rtol=1e-11
        )


def test_a_tool_heavier_than_believed_sags_about_its_centre_of_mass() -> None:
    cell = free_cell("coulomb_ratio=0", "tool_mass_ratio=1.2")
    robots, wanted = cell.ik.model, np.zeros(12)
    data = at(robots, cell.home)
    for side in SIDES:
        tool, jacobian = robots.body(f"{side}_sensor").id, np.empty((3, 12))
        mujoco.mj_jac(robots, data, jacobian, None, data.subtree_com[tool], tool)
        # Analytic: Δm g at the tool's centre of mass.
        wanted += 0.2 * robots.body_subtreemass[tool] * GRAVITY_M_PER_S2 * jacobian[2]
    np.testing.assert_allclose(sag(cell) * cell.servo.stiffness, wanted, rtol=5e-3, atol=2e-3)


def test_wrong_masses_are_moved_by_the_believed_coriolis_torques() -> None:
    cell = free_cell("link_mass_ratio=1.1", "tool_mass_ratio=1.1")
    simulation, robots = cell.simulation, cell.ik.model
    speed = RNG.uniform(-1.0, 1.0, 12)
    assert simulation.fed_forward is not None
    found = simulation.fed_forward(cell.home, speed)
    data = mujoco.MjData(robots)
    data.qpos[:] = cell.home
    mujoco.mj_forward(robots, data)
    weight = data.qfrc_bias.copy()
    data.qvel[:] = speed
    mujoco.mj_forward(robots, data)
    # Analytic: of the believed arms, without their weight.
    np.testing.assert_allclose(found, data.qfrc_bias - weight, atol=1e-9)
    assert np.abs(found).max() > 0.1


# --- joint zeros --------------------------------------------------------------------------------


def test_a_joint_zero_turns_the_true_arm_at_the_same_measured_angle() -> None:
    zero = tuple(RNG.uniform(-0.05, 0.05, 6))
    model, believed = true_robots(RobotErrors(zero_rad=zero)), robots_only(PAIR).compile()
    q = PAIR.home
    found, wanted = at(model, q), at(believed, q + np.tile(zero, 2))
    # Analytic.
    np.testing.assert_allclose(found.site_xpos, wanted.site_xpos, atol=1e-12)
    np.testing.assert_allclose(found.site_xmat, wanted.site_xmat, atol=1e-12)


def test_the_controller_sees_the_grip_where_its_encoders_have_it() -> None:
    zero = np.array([1.0, -2.0, 1.5, 3.0, -1.0, 2.0]) * 1e-4
    cell = free_cell(f"zero_rad={zero.tolist()}")
    seen, robots = cell.simulation.observe(), cell.ik.model
    nominal = [cell.start[0], 0.0, cell.start[1], 0.0]
    # Analytic: the encoders tell the home pose, within the IK's residual.
    np.testing.assert_allclose(cell.measured.grips(seen), [nominal] * 2, atol=3e-7)
    data = at(robots, cell.home)
    for i, side in enumerate(SIDES):
        columns = PAIR.joints(side)
        jacobian = site_jacobian(robots, data, robots.site(f"{side}_{GRIP_SITE}").id)[:, columns]
        moved = (jacobian @ zero)[:3] * [(1, 1, 1), (-1, -1, 1)][i]
        # Analytic to second order: the grip is off by J δ.
        np.testing.assert_allclose(seen.grip[i, :3] - nominal[:3], moved, atol=1e-6)
        assert np.abs(moved).max() > 5e-5


def test_the_tools_weight_is_taken_off_along_the_axes_that_the_encoders_tell() -> None:
    cell = free_cell("zero_rad=[0.0, 0.01, 0.0, 0.0, 0.02, 0.0]", "base_roll_rad=0.01")
    seen, robots = cell.simulation.observe(), cell.ik.model
    data = at(robots, cell.home)
    wanted = [data.site(f"{side}_{FT_SITE}").xmat.reshape(3, 3) for side in SIDES]
    true = cell.simulation.observer.sensor_axes(cell.simulation.data)
    assert np.abs(true - wanted).max() > 0.005
    np.testing.assert_allclose(cell.measured.sensor_axes(true, seen), wanted, atol=1e-9)  # analytic


# --- bases --------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw_pitch_roll", [(0.0, 0.0, 0.0), (0.7, 0.0, 0.0), (0.3, 1.2, -0.8)])
def test_a_base_stands_off_in_its_bending_frame(
    yaw_pitch_roll: tuple[float, float, float],
) -> None:
    turns = zip(("yaw", "pitch", "roll"), yaw_pitch_roll, strict=True)
    arms = arm_pair(load_scenario(STRIP6, [f"cell.base_{axis}_rad={turn}" for axis, turn in turns]))
    place, turn = np.array([0.003, -0.002, 0.001]), np.array([0.02, -0.03, 0.04])
    config = RobotErrors(
        **dict(zip(("base_x_m", "base_y_m", "base_z_m"), place, strict=True)),
        **dict(zip(("base_roll_rad", "base_pitch_rad", "base_yaw_rad"), turn, strict=True)),
    )
    found, believed = at(true_robots(config, arms), arms.home), robots_only(arms).compile()
    before = at(believed, arms.home)
    error = Rotation.from_euler("ZYX", turn[::-1]).as_matrix()
    for i, side in enumerate(SIDES):
        frame = Rotation.from_euler("z", math.pi * i).as_matrix()
        origin, site = arms.base_pose(side)[0], f"{side}_{GRIP_SITE}"
        moved = frame @ error @ frame.T
        wanted = origin + frame @ place + moved @ (before.site(site).xpos - origin)
        # Analytic: a rigid motion of the arm about its base's origin.
        np.testing.assert_allclose(found.site(site).xpos, wanted, atol=1e-12)
        axes = moved @ before.site(site).xmat.reshape(3, 3)
        np.testing.assert_allclose(found.site(site).xmat.reshape(3, 3), axes, atol=1e-12)


# --- draws --------------------------------------------------------------------------------------


SPREADS = RobotErrors(
    coulomb_spread=0.1,
    viscous_spread=0.1,
    link_mass_spread=0.02,
    tool_mass_spread=0.02,
    zero_spread_rad=1e-3,
    base_spread_m=1e-3,
    base_spread_rad=1e-3,
)
DRAWN = ("coulomb", "viscous", "link_mass", "tool_mass", "zero_rad", "base")


def test_a_seed_draws_the_same_arms_and_another_one_others() -> None:
    first, again, other = (TrueArms(SPREADS, PAIR, seed) for seed in (1, 1, 2))
    for name in DRAWN:
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
        assert (getattr(first, name) != getattr(other, name)).all()


def test_one_spread_moves_no_other_draw() -> None:
    alone, all_ = TrueArms(RobotErrors(zero_spread_rad=1e-3), PAIR, 1), TrueArms(SPREADS, PAIR, 1)
    np.testing.assert_array_equal(alone.zero_rad, all_.zero_rad)
    assert (alone.coulomb == 1.0).all()
    assert not alone.base.any()


def test_draws_have_their_spread_and_end_at_three_of_it() -> None:
    found = cut_normal(stream(1, "test"), 0.02, (20_000,))
    assert np.abs(found).max() == 0.06  # analytic
    assert found.std() == pytest.approx(0.02, rel=0.03)  # statistical, 6 σ
    assert abs(found.mean()) < 0.001


def test_arms_as_believed_are_compiled_to_the_last_bit() -> None:
    assert not RobotErrors().displaces
    assert not RobotErrors().weighs_wrong
    found, wanted = true_robots(RobotErrors()), robots_only(PAIR).compile()
    for name in ("body_mass", "body_inertia", "body_gravcomp", "body_pos", "body_quat", "qpos0"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    np.testing.assert_array_equal(found.dof_frictionloss, wanted.dof_frictionloss)
    np.testing.assert_array_equal(found.dof_damping, wanted.dof_damping)


# --- how a bending run begins -------------------------------------------------------------------


def test_jaws_close_on_the_sheet_where_the_arms_stand_and_then_force_their_normal_on_it() -> None:
    errors = [
        *("base_x_m=0.002", "base_y_m=0.001", "base_spread_m=0.0005", "base_spread_rad=0.002"),
        "zero_spread_rad=0.0005",
    ]
    settings = [f"imperfections.robot.{error}" for error in errors]
    short = ["path.end_rad=0.1", "motion.hold_s=0.1", "motion.settle_s=0.5"]
    run = BendingRun(load_scenario(STRIP6, [*short, "sheet.model.hinges=20", *settings]))
    run.begin()
    simulation = run.cell.simulation
    taken = simulation.observer.grasps(simulation.data)
    assert np.abs(taken[:, :3]).min() > 1e-5
    # Analytic: nothing pulls at the sheet, which lies where it should.
    assert np.abs(simulation.observe().wrench).max() < 1e-9
    settle = int(np.count_nonzero(run.motion.phase == 0))
    for _ in range(settle):
        run.step()
    simulation.observe()
    found = simulation.observer.grasps(simulation.data)
    # The pads give: some N over 0.96e6 N/m, some 10 mN m over 267 N m/rad.
    np.testing.assert_allclose(found[:, [2, 3, 4]], 0.0, atol=1e-4)
    np.testing.assert_allclose(found[:, [0, 1, 5]], taken[:, [0, 1, 5]], atol=5e-5)
    assert np.abs(taken[:, [2, 3, 4]]).max() > 1e-3
    assert {"left_grip_roll", "right_edge_yaw"} <= {name for name, _ in run.trace.columns}


def test_a_second_run_of_displaced_arms_is_the_same_run() -> None:
    short = ["path.end_rad=0.03", "motion.hold_s=0.0", "motion.settle_s=0.25"]
    errors = ["imperfections.robot.base_spread_m=0.001", "imperfections.robot.stiction_excess=0.2"]
    run = BendingRun(load_scenario(STRIP6, [*short, "sheet.model.hinges=4", *errors]))
    first = run.run().trace.qpos.copy()
    np.testing.assert_array_equal(first, run.run().trace.qpos)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        (["base_z_m=0.06"], "imperfections.robot.base_z_m = 0.06"),
        (["coulomb_spread=0.5"], "imperfections.robot.coulomb_spread = 0.5"),
        (["zero_rad=[0,0,0,0,0,0,0]"], "imperfections.robot.zero_rad has 7 values"),
    ],
)
def test_what_no_arm_has_is_refused_with_the_reason(settings: list[str], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        load_scenario(STRIP6, [f"imperfections.robot.{setting}" for setting in settings])
