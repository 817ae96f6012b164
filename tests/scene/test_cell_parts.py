"""Parts of the composed cell: solver, welds, jaws, what is only drawn, grips that lie off."""

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dualbend.arm import mjcf as arm
from dualbend.run.arms import arm_pair
from dualbend.run.cell import make_servo
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import PAD_SITE, compose_cell, robots_only, without_looks
from dualbend.scene.contacts import FLOOR
from dualbend.scene.observation import PLANAR, grip_poses
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, StripConfig
from dualbend.scene.simulation import Simulation
from dualbend.task.assembly.config import assembly_of
from dualbend.types import SIDES
from support.strip import STRIP6, STRIP8

BENDING_RUN = load_scenario(STRIP6, ["sheet.model.hinges=4"])
ASSEMBLY = load_scenario("pwb")


def compose(*, layout: bool = False) -> mujoco.MjSpec:
    scenario = load_scenario("pwb" if layout else "fig6")
    pair = arm_pair(scenario)
    servo = make_servo(scenario, robots_only(pair).compile(), pair.home)
    return compose_cell(
        scenario.cell,
        pair,
        scenario.grasp,
        scenario.sheet.sheet(),
        StripConfig(hinges=20 if layout else 4),
        servo,
        scenario.step_s,
        assembly_of(scenario).layout if layout else None,
        looks=False,
    )


@pytest.fixture(scope="module")
def bending() -> mujoco.MjModel:
    return compose().compile()


@pytest.fixture(scope="module")
def assembling() -> mujoco.MjModel:
    return compose(layout=True).compile()


# --- solver and holds ---------------------------------------------------------------------------


def test_a_diverged_state_stays_and_islands_are_off(bending: mujoco.MjModel) -> None:
    for flag in (mujoco.mjtDisableBit.mjDSBL_AUTORESET, mujoco.mjtDisableBit.mjDSBL_ISLAND):
        assert bending.opt.disableflags & int(flag)
    assert bending.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
    assert bending.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE


@pytest.mark.parametrize(("layout", "held"), [(False, 1), (True, 0)])
def test_each_end_is_welded_to_its_pad_and_at_first_only_in_bending(
    layout: bool, held: int, bending: mujoco.MjModel, assembling: mujoco.MjModel
) -> None:
    model = assembling if layout else bending
    for side, end in zip(SIDES, (LEFT_END, RIGHT_END), strict=True):
        hold = model.equality(f"{side}_hold").id
        assert model.eq_type[hold] == mujoco.mjtEq.mjEQ_WELD
        assert model.eq_obj1id[hold] == model.site(f"{side}_{PAD_SITE}").id
        assert model.eq_obj2id[hold] == model.site(end).id
        assert model.eq_active0[hold] == held
        # As documented: half a millisecond, critically damped; the impedance that MuJoCo caps.
        np.testing.assert_array_equal(model.eq_solref[hold], [5e-4, 1.0])
        np.testing.assert_array_equal(model.eq_solimp[hold], [0.9999, 0.9999, 0.001, 0.5, 2.0])
        assert model.eq_data[hold, 10] == 10.0


def test_the_pads_are_light_and_held_up(bending: mujoco.MjModel) -> None:
    for side in SIDES:
        pad = bending.body(f"{side}_pad")
        assert pad.mass == 0.01
        assert bending.body_gravcomp[pad.id] == 1.0
        np.testing.assert_array_equal(pad.ipos, 0.0)
        assert sorted(pad.inertia) == pytest.approx([1e-6, 3e-6, 3e-6])
        site = bending.site(f"{side}_{PAD_SITE}")
        assert (bending.site_group[site.id], *site.size) == (4, 0.003, 0.003, 0.003)


# --- jaws ---------------------------------------------------------------------------------------


def test_the_jaws_press_with_at_most_40_n_and_their_rubber_meets_the_sheets_ends(
    assembling: mujoco.MjModel,
) -> None:
    model = assembling
    for side in SIDES:
        for jaw, above in zip(arm.JAW_JOINTS, (1.0, -1.0), strict=True):
            drive = model.actuator(f"{side}_{jaw}_drive")
            # 20 N/mm, without damping, held back at 40 N.
            assert drive.gainprm[0] == 2e4
            np.testing.assert_array_equal(drive.biasprm[:3], [0.0, -2e4, 0.0])
            np.testing.assert_array_equal(drive.forcerange, [-40.0, 40.0])
            assert model.actuator_forcelimited[drive.id]
            assert model.actuator_trnid[drive.id, 0] == model.joint(f"{side}_{jaw}").id
            rubber = model.geom(f"{side}_{jaw}_rubber")
            np.testing.assert_array_equal(rubber.size, [0.010, 0.030, 0.0015])
            np.testing.assert_array_equal(rubber.pos, [0.0, 0.0, above * 0.0015])
            assert model.geom_contype[rubber.id] == 0
            assert model.geom_conaffinity[rubber.id] == 8
            assert model.geom_condim[rubber.id] == 1  # without friction: the hold carries
            assert model.geom_group[rubber.id] == 3
            np.testing.assert_array_equal(model.geom_solref[rubber.id], [0.0035, 1.0])
            solimp = model.geom_solimp[rubber.id]
            np.testing.assert_array_equal(solimp, [0.999, 0.9999, 1e-4, 0.5, 2.0])


def test_the_rubber_weighs_nothing(bending: mujoco.MjModel, assembling: mujoco.MjModel) -> None:
    for side in SIDES:
        hands = [
            model.body_subtreemass[model.body(f"{side}_hand").id] for model in (bending, assembling)
        ]
        assert hands[0] == pytest.approx(hands[1], rel=1e-12)


# --- what is only looked at ---------------------------------------------------------------------


def test_the_floor_stops_what_has_its_bit_and_the_front_camera_sees_both_grips(
    bending: mujoco.MjModel,
) -> None:
    model, data = bending, mujoco.MjData(bending)
    mujoco.mj_forward(model, data)
    floor = model.geom("floor").id
    assert (model.geom_contype[floor], model.geom_conaffinity[floor]) == (0, FLOOR)
    assert data.geom_xpos[floor, 2] == 0.0
    # The bases, 2.2 m apart, stand on it.
    assert (model.geom_size[floor, :2] >= 1.5).all()
    # Pictures up to full HD; a sky box is six squares below each other.
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (1920, 1080)
    (sky,) = [i for i in range(model.ntex) if model.texture(i).name == "sky"]
    assert model.tex_height[sky] == 6 * model.tex_width[sky]
    camera = model.camera("front").id
    eye, axes = data.cam_xpos[camera], data.cam_xmat[camera].reshape(3, 3)
    reach = math.tan(math.radians(model.cam_fovy[camera]) / 2)
    height = BENDING_RUN.cell.sheet_height_m
    points = np.array([[x, 0.0, height] for x in (-0.2, 0.0, 0.2)])
    seen = (points - eye) @ axes
    across, up = seen[:, 0] / -seen[:, 2] / reach, seen[:, 1] / -seen[:, 2] / reach
    assert (seen[:, 2] < 0.0).all()
    # The sheet is in the middle third of the picture, a fifth of its height to each side.
    assert across == pytest.approx([-across[2], 0.0, across[2]], abs=1e-9)
    assert 0.15 < across[2] < 0.35
    assert (np.abs(up) < 1.0 / 3.0).all()
    assert axes[0, 0] == pytest.approx(1.0)
    # The lamp is above and in front, and shines down and away.
    lamp = model.light("lamp").id
    assert data.light_xpos[lamp, 1] < 0.0
    assert data.light_xpos[lamp, 2] > 2.0
    assert data.light_xdir[lamp, 2] < -0.5
    assert model.light_castshadow[lamp]


@pytest.mark.parametrize(("height", "stands"), [(0.4, True), (0.021, True), (0.019, False)])
def test_an_arm_above_the_floor_stands_on_a_column(height: float, stands: bool) -> None:
    by_hand = {"distance_m": 0.6, "lateral_m": 0.1, "height_m": height, "yaw_rad": 0.2}
    placed = [f"cell.base_{key}={value}" for key, value in by_hand.items()]
    home = "cell.home_rad=[0.1,-1.5,1.5,-1.5,-1.5,0.0]"
    model = robots_only(
        arm_pair(load_scenario(STRIP6, ["robot.model=ur5", *placed, home]))
    ).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for side in SIDES:
        base = model.body(f"{side}_base").id
        columns = [
            i
            for i in np.flatnonzero(model.geom_bodyid == base)
            if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CYLINDER and model.geom_group[i] == 2
        ]
        assert len(columns) == (2 if stands else 0)
        if stands:
            column, foot = columns
            ends = [
                data.geom_xpos[i, 2] + sign * model.geom_size[i, 1]
                for i in columns
                for sign in (-1.0, 1.0)
            ]
            # Exact: from the floor up to the base, on a foot of 15 mm that is wider.
            assert ends == pytest.approx([0.0, height, 0.0, 0.015], abs=1e-12)
            assert model.geom_size[foot, 0] > model.geom_size[column, 0] > 0.05
            assert not model.geom_contype[columns].any()
            assert not model.geom_conaffinity[columns].any()


def test_an_arm_that_is_documented_on_its_own_stand_gets_no_column(bending: mujoco.MjModel) -> None:
    alone = arm_pair(BENDING_RUN).of("left").model.spec(looks=False).compile()
    own = np.sum(alone.geom_bodyid == alone.body("base").id)
    # It stands 0.672 m above the floor; its model has a stand already.
    assert np.sum(bending.geom_bodyid == bending.body("left_base").id) == own


def test_without_looks_the_cell_moves_alike() -> None:
    spec = compose()
    full, bare = spec.compile(), without_looks(spec).compile()
    assert bare.ngeom < full.ngeom
    assert (bare.nq, bare.nu, bare.neq) == (full.nq, full.nu, full.neq)
    np.testing.assert_array_equal(bare.body_mass, full.body_mass)


# --- grips that lie off, and the simulation's view ----------------------------------------------


def test_a_displaced_grasp_is_a_yaw_after_a_pitch_and_a_roll_and_is_seen_so() -> None:
    cell = make_run(load_scenario(STRIP8, ["sheet.model.hinges=4"])).cell
    simulation: Simulation = cell.simulation
    model, data = simulation.model, simulation.data
    errors = np.array([[3e-4, 2e-3, 1e-4, 0.3, 0.4, -0.2], [2e-4, -1e-3, -3e-4, -0.1, 0.15, 0.25]])
    simulation.displace_grasps(errors)
    mujoco.mj_forward(model, data)
    for side, (x, y, z, roll, pitch, yaw) in zip(SIDES, errors, strict=True):
        pad = model.site(f"{side}_{PAD_SITE}").id
        # Analytic: R_GE = R_z(yaw) R_y(pitch) R_x(roll), at (x, y, z).
        expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        found = np.empty(9)
        mujoco.mju_quat2Mat(found, model.site_quat[pad])
        np.testing.assert_allclose(found.reshape(3, 3), expected, atol=1e-12)
        np.testing.assert_array_equal(model.site_pos[pad], [x, y, z])
        body = data.xmat[model.site_bodyid[pad]].reshape(3, 3)
        np.testing.assert_allclose(data.site_xmat[pad].reshape(3, 3), body @ expected, atol=1e-12)


def test_how_an_edge_lies_to_its_grip_is_told_as_it_was_displaced() -> None:
    simulation: Simulation = make_run(
        load_scenario(STRIP8, ["sheet.model.hinges=4"])
    ).cell.simulation
    data = simulation.data
    errors = np.array([[3e-4, 2e-3, 1e-4, 0.3, 0.4, -0.2], [2e-4, -1e-3, -3e-4, -0.1, 0.15, 0.25]])
    for i, (grip, edge) in enumerate(simulation.observer._ends.T):
        axes = Rotation.from_rotvec([0.2, 0.3 + i, -0.4])
        data.site_xmat[grip] = axes.as_matrix().ravel()
        data.site_xpos[edge] = data.site_xpos[grip] + axes.apply(errors[i, :3])
        turned = axes * Rotation.from_euler("ZYX", errors[i, :2:-1])
        data.site_xmat[edge] = turned.as_matrix().ravel()
    np.testing.assert_allclose(
        simulation.observer.grasps(simulation.data), errors, atol=1e-12
    )  # analytic


def test_the_planar_pose_of_a_grip_leaves_y_out() -> None:
    assert np.array(["x", "y", "z", "slope"])[PLANAR].tolist() == ["x", "z", "slope"]


def test_roll_and_yaw_are_those_of_each_arms_bending_frame() -> None:
    cell = make_run(load_scenario(STRIP8, ["sheet.model.hinges=4"])).cell
    simulation: Simulation = cell.simulation
    data = simulation.data
    rng = np.random.default_rng(5)
    turns = rng.uniform(-0.5, 0.5, (2, 2, 3))  # gripper and edge, left and right: yaw, pitch, roll
    for what in range(2):
        for i in range(2):
            frame = Rotation.from_euler("z", math.pi * i)
            axes = (frame * Rotation.from_euler("ZYX", turns[what, i])).as_matrix()
            data.site_xmat[simulation.observer._ends[what, i]] = axes.ravel()
    seen = simulation.observer.roll_and_yaw(simulation.data)
    # Analytic: R_z(yaw) R_y(pitch) R_x(roll) in each arm's own frame.
    np.testing.assert_allclose(seen[..., 0], turns[..., 2], atol=1e-12)
    np.testing.assert_allclose(seen[..., 1], turns[..., 0], atol=1e-12)
    # The end slope that is observed: tan α cos(yaw) = tan(pitch).
    ends = simulation.observer._ends
    slope = grip_poses(data.site_xpos[ends], data.site_xmat[ends])[..., 3]
    np.testing.assert_allclose(
        np.tan(slope) * np.cos(turns[..., 0]), np.tan(turns[..., 1]), atol=1e-12
    )
