"""The PUMA 560 and gripper models against Lagrange's equations and plain statics."""

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm import mjcf as arm
from dualbend.arm.model import arm_model
from dualbend.beam.sheet import GRAVITY_M_PER_S2 as G
from dualbend.errors import InputError
from dualbend.mechanics.compliance import endpoint_compliance
from dualbend.resources import models_dir
from dualbend.validation import dh

Array = NDArray[np.float64]
PUMA = arm_model("puma560")
TABLE = dh.puma()
LIMITS = np.array([link.range_rad for link in dh.PUMA560])
ARMATURE = np.diag([link.armature_kg_m2 for link in dh.PUMA560])
READY_RAD = (0.0, math.pi / 2, -math.pi / 2, 0.0, 0.0, 0.0)
"""Pose qr of the Robotics Toolbox, the PUMA straight up."""
WORKING_RAD = (0.0, math.radians(97.0), math.radians(-195.0), 0.0, math.radians(8.0), 0.0)
"""Gripper horizontal along the base's x, grip at (0.5814, -0.15005, 0.3484) m."""
TOOL_BODIES = ("hand", "jaw_upper", "jaw_lower")


def random_configurations(n: int, seed: int) -> Array:
    return np.random.default_rng(seed).uniform(LIMITS[:, 0], LIMITS[:, 1], (n, 6))


def link_frames(q: Array) -> Array:
    """Return DH frames 0 to 6 in frame 0 (7, 4, 4)."""
    turned = TABLE.frames(q)
    fixed = [np.eye(4), *(link.fixed_part for link in dh.PUMA560)]
    return np.array([frame @ part for frame, part in zip(turned, fixed, strict=True)])


def relative(found: Array, wanted: Array) -> float:
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arm.load_puma().compile()


def armed_model() -> mujoco.MjModel:
    """Return the arm with gripper and stiff joint servos."""
    spec = arm.load_puma()
    spec.attach(arm.load_gripper(), site=arm.FLANGE_SITE, prefix="g/")
    for name, stiffness in zip(PUMA.joints, PUMA.stiffness_n_m_per_rad, strict=True):
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=stiffness, kv=0.02 * stiffness)
    return spec.compile()


@pytest.fixture(scope="module")
def armed() -> mujoco.MjModel:
    return armed_model()


def settle(model: mujoco.MjModel, q: Array) -> mujoco.MjData:
    """Hold q for three seconds and return the state of rest."""
    data = mujoco.MjData(model)
    data.qpos[:6] = data.ctrl[:] = q
    for _ in range(1500):
        mujoco.mj_step(model, data)
    return data


# --- the arm against its table ------------------------------------------------------------------


def test_flange_pose_is_the_published_table_multiplied_out(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    for q in random_configurations(50, seed=1):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        wanted = TABLE.flange_pose(q)
        site = data.site(arm.FLANGE_SITE)
        # Analytic: two spellings of one product, rounding only.
        np.testing.assert_allclose(site.xpos, wanted[:3, 3], atol=1e-12)
        np.testing.assert_allclose(site.xmat.reshape(3, 3), wanted[:3, :3], atol=1e-12)


def test_every_link_frame_is_a_dh_frame(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    for q in random_configurations(10, seed=2):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        names = ["base", *(f"link{i}" for i in range(1, 7))]
        for name, frame in zip(names, link_frames(q), strict=True):
            body = data.body(name)
            np.testing.assert_allclose(body.xpos, frame[:3, 3], atol=1e-12)  # analytic
            np.testing.assert_allclose(body.xmat.reshape(3, 3), frame[:3, :3], atol=1e-12)


def test_gravity_torque_is_the_tables(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    for q in random_configurations(60, seed=3):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        # Analytic (rounding only).
        assert relative(data.qfrc_bias, TABLE.gravity_torque(q)) < 1e-9


def test_velocity_torque_is_the_tables(model: mujoco.MjModel) -> None:
    rng = np.random.default_rng(4)
    data = mujoco.MjData(model)
    for q in random_configurations(50, seed=5):
        v = rng.normal(size=6)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        # Analytic: Coriolis, centrifugal and gravity torques together.
        assert (
            relative(data.qfrc_bias, TABLE.gravity_torque(q) + TABLE.velocity_torque(q, v)) < 1e-9
        )


def test_mass_matrix_is_the_tables_plus_armature(model: mujoco.MjModel) -> None:
    data, full = mujoco.MjData(model), np.zeros((6, 6))
    for q in random_configurations(60, seed=6):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        assert relative(full, TABLE.mass_matrix(q) + ARMATURE) < 1e-9  # analytic
        bare = full - np.diag(model.dof_armature)
        assert relative(bare, TABLE.mass_matrix(q)) < 1e-9  # analytic


def test_gravity_torque_is_the_gradient_of_the_potential_energy() -> None:
    def potential(q: Array) -> float:
        frames = link_frames(q)[1:]
        pairs = zip(dh.PUMA560, frames, strict=True)
        return float(sum(b.mass_kg * G * (f[2, :3] @ b.com_m + f[2, 3]) for b, f in pairs))

    h = 1e-5
    for q in random_configurations(20, seed=7):
        slope = [(potential(q + h * e) - potential(q - h * e)) / (2 * h) for e in np.eye(6)]
        # Discretisation-limited, O(h²): 60 N m x 1e-10, plus rounding 1e-14 x 100 J / h.
        np.testing.assert_allclose(TABLE.gravity_torque(q), slope, atol=1e-7)


@pytest.mark.parametrize("i", range(6))
def test_every_table_value_arrived(model: mujoco.MjModel, i: int) -> None:
    link, joint, body = dh.PUMA560[i], model.joint(PUMA.joints[i]), model.body(f"link{i + 1}")
    np.testing.assert_allclose(joint.range, link.range_rad, rtol=1e-12)  # analytic
    assert joint.armature[0] == link.armature_kg_m2  # copied
    # Golden: B G² and |G| (|Tc+| + |Tc-|) / 2 of the motor's values, written with five digits.
    viscous, coulomb = link.viscous_n_m_s * link.gear**2, np.mean(np.abs(link.coulomb_n_m))
    assert joint.damping[0] == pytest.approx(viscous, rel=5e-5)
    assert joint.frictionloss[0] == pytest.approx(abs(link.gear) * coulomb, rel=5e-5)
    assert bool(model.jnt_actfrclimited[i])
    np.testing.assert_array_equal(
        model.jnt_actfrcrange[i], [-link.torque_limit_n_m, link.torque_limit_n_m]
    )
    assert bool(model.jnt_actgravcomp[i])
    assert model.body_gravcomp[body.id] == 1.0
    np.testing.assert_array_equal(body.ipos, link.com_m)
    # Inertia back in link axes, whatever principal order the compiler chose (rounding only).
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, body.iquat)
    inertia = R.reshape(3, 3) @ np.diag(body.inertia) @ R.reshape(3, 3).T
    if i == 0:
        # Only the waist's axis is published; mass and the other two moments are stand-ins.
        assert inertia[1, 1] == pytest.approx(0.35, rel=1e-12)
        np.testing.assert_array_equal(body.ipos, 0.0)
    else:
        assert body.mass[0] == link.mass_kg
        np.testing.assert_allclose(inertia, np.diag(link.inertia_kg_m2), atol=1e-12)


def test_link_three_needed_its_repair_and_nothing_more() -> None:
    published, repaired = np.array([0.066, 0.086, 0.0125]), np.array(dh.PUMA560[2].inertia_kg_m2)
    assert published[1] > published[0] + published[2]  # no body has such an inertia
    # Analytic: the one changed moment sits exactly on the triangle inequality's bound.
    assert repaired[1] == pytest.approx(published[0] + published[2], rel=1e-12)
    assert np.count_nonzero(repaired != published) == 1


def test_mass_of_the_first_link_is_neutral(model: mujoco.MjModel) -> None:
    spec = arm.load_puma()
    spec.body("link1").mass = 40.0
    heavy = spec.compile()
    full, wanted = np.zeros((6, 6)), np.zeros((6, 6))
    for q in random_configurations(5, seed=8):
        for m, M in ((model, wanted), (heavy, full)):
            data = mujoco.MjData(m)
            data.qpos[:] = q
            mujoco.mj_forward(m, data)
            mujoco.mj_fullM(m, data, M)
        assert relative(full, wanted) < 1e-12  # analytic


def test_gravity_feed_forward_balances_the_arm_and_its_tool(armed: mujoco.MjModel) -> None:
    q = np.array(WORKING_RAD)
    data = settle(armed, q)
    # Analytic: with the whole weight fed forward the servo has nothing to do; rounding and the
    # solver's tolerance remain.
    np.testing.assert_allclose(data.qpos[:6], q, atol=1e-7)


@pytest.mark.parametrize("pose", [READY_RAD, WORKING_RAD])
def test_one_second_without_a_warning(
    model: mujoco.MjModel, armed: mujoco.MjModel, pose: tuple[float, ...]
) -> None:
    for m in (model, armed):  # the first falls freely, the second is held
        data = mujoco.MjData(m)
        data.qpos[:6] = pose
        if m.nu:
            data.ctrl[:] = data.qpos[:6]
        while data.time < 1.0:
            mujoco.mj_step(m, data)
        assert [w.number for w in data.warning] == [0] * len(data.warning)
        assert data.ncon == 0 or m is model


# --- pose facts -----------------------------------------------------------------------------------


def test_working_pose(armed: mujoco.MjModel) -> None:
    data = mujoco.MjData(armed)
    data.qpos[:6] = WORKING_RAD
    mujoco.mj_forward(armed, data)
    a2, a3, d3, d4 = 0.4318, 0.0203, 0.15005, 0.4318
    upper, fore = np.radians(97.0), np.radians(97.0 - 195.0)
    # Analytic: planar two-link arm in the plane y = -d3, flange horizontal (97 - 195 + 8 = -90).
    x = a2 * np.cos(upper) + a3 * np.cos(fore) - d4 * np.sin(fore)
    z = a2 * np.sin(upper) + a3 * np.sin(fore) + d4 * np.cos(fore)
    flange = data.site(arm.FLANGE_SITE)
    np.testing.assert_allclose(flange.xpos, [x + dh.FLANGE_OFFSET_M, -d3, z], atol=1e-12)
    axes = flange.xmat.reshape(3, 3)
    np.testing.assert_allclose(axes, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)
    grip = data.site("g/grip")
    np.testing.assert_allclose(grip.xmat.reshape(3, 3), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(grip.xpos - flange.xpos, [0.153, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(grip.xpos, [0.58140, -0.15005, 0.34838], atol=5e-6)  # golden


def test_grip_frame_tilts_down_when_joint_five_bends_down(armed: mujoco.MjModel) -> None:
    data = mujoco.MjData(armed)
    for alpha in (0.3, 1.0):
        data.qpos[:6] = np.array(WORKING_RAD) - [0, 0, 0, 0, alpha, 0]
        mujoco.mj_kinematics(armed, data)
        x_grip = data.site("g/grip").xmat.reshape(3, 3)[:, 0]
        # Analytic: G = rotation by +alpha about y, x_G = (cos, 0, -sin).
        np.testing.assert_allclose(x_grip, [np.cos(alpha), 0, -np.sin(alpha)], atol=1e-12)


# --- the force/torque sensor ----------------------------------------------------------------------


def tool(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[float, Array]:
    """Return mass [kg] and centre of mass [m, world] of what hangs beyond the sensor."""
    ids = [model.body(f"g/{name}").id for name in TOOL_BODIES]
    mass = model.body_mass[ids]
    return float(mass.sum()), mass @ data.xipos[ids] / mass.sum()


def test_lever_arm_and_parallel_axes(armed: mujoco.MjModel) -> None:
    ft, grip = armed.site("g/ft_site"), armed.site("g/grip")
    np.testing.assert_array_equal(grip.pos - ft.pos, [arm.LEVER_ARM_M, 0.0, 0.0])
    np.testing.assert_array_equal(grip.quat, ft.quat)
    assert ft.bodyid == grip.bodyid == armed.body("g/hand").id
    tool_kg = armed.body("g/sensor").mass[0] + sum(
        armed.body(f"g/{n}").mass[0] for n in TOOL_BODIES
    )
    assert tool_kg == pytest.approx(0.85, rel=1e-12)  # golden: see models/gripper/README.md


def test_jaws_meet_at_the_grip_and_open_symmetrically(armed: mujoco.MjModel) -> None:
    data = mujoco.MjData(armed)
    data.qpos[:6] = WORKING_RAD
    for opening in (0.0, 0.004, 0.015):
        data.qpos[6:] = opening
        mujoco.mj_kinematics(armed, data)
        grip = data.site("g/grip").xpos
        for name, sign in (("jaw_upper", 1.0), ("jaw_lower", -1.0)):
            offset = data.body(f"g/{name}").xpos - grip
            np.testing.assert_allclose(offset, [0.0, 0.0, sign * opening], atol=1e-12)  # analytic
    for name in arm.JAW_JOINTS:
        np.testing.assert_array_equal(armed.joint(f"g/{name}").range, [0.0, 0.015])
        np.testing.assert_array_equal(armed.geom(f"g/{name}_c").size[:2], [0.010, 0.030])


@pytest.mark.parametrize(
    "q",
    [
        WORKING_RAD,
        (0.0, 1.693, -3.403, 0.0, 1.0, 0.0),
        (0.5, 1.2, -2.4, 0.7, -0.6, 1.5),
        (-1.0, 1.5, -1.8, -0.5, 0.9, -2.0),
    ],
)
def test_sensor_at_rest_reads_minus_the_tool_weight(
    armed: mujoco.MjModel, q: tuple[float, ...]
) -> None:
    data = settle(armed, np.array(q))
    mass, centre = tool(armed, data)
    site = data.site("g/ft_site")
    axes = site.xmat.reshape(3, 3)
    weight = np.array([0.0, 0.0, -mass * G])
    on_arm = -axes @ data.sensor("g/ft_force").data
    about_ft = -axes @ data.sensor("g/ft_torque").data
    # Analytic statics of a rigid tool; the tolerance is the settled motion's inertia.
    np.testing.assert_allclose(on_arm, weight, atol=1e-4)
    np.testing.assert_allclose(about_ft, np.cross(centre - site.xpos, weight), atol=1e-5)


def test_sensor_reads_an_end_force_with_the_documented_sign(armed: mujoco.MjModel) -> None:
    data = mujoco.MjData(armed)
    data.qpos[:6] = data.ctrl[:] = WORKING_RAD
    push = np.array([-20.0, 0.0, 5.0])  # a compressed sheet pushes the gripper outward
    hand = armed.body("g/hand").id
    for _ in range(1500):
        lever = data.site("g/grip").xpos - data.xipos[hand]
        data.xfrc_applied[hand] = np.concatenate([push, np.cross(lever, push)])
        mujoco.mj_step(armed, data)
    mass, centre = tool(armed, data)
    site = data.site("g/ft_site")
    axes = site.xmat.reshape(3, 3)
    weight = np.array([0.0, 0.0, -mass * G])
    # Analytic statics: minus the reading is the wrench on the arm, tool weight included.
    on_arm = -axes @ data.sensor("g/ft_force").data
    np.testing.assert_allclose(on_arm, push + weight, atol=1e-3)
    about_ft = -axes @ data.sensor("g/ft_torque").data
    wanted = np.cross(data.site("g/grip").xpos - site.xpos, push)
    wanted += np.cross(centre - site.xpos, weight)
    np.testing.assert_allclose(about_ft, wanted, atol=1e-4)


# --- stiffness and resources ----------------------------------------------------------------------


def test_endpoint_compliance_is_how_far_the_servos_yield() -> None:
    servo = armed_model()
    servo.dof_frictionloss[:] = 0.0  # dry friction would hide the yield
    kq = np.array(PUMA.stiffness_n_m_per_rad)
    data, jacobian = mujoco.MjData(servo), np.zeros((3, servo.nv))
    data.qpos[:6] = data.ctrl[:] = WORKING_RAD
    mujoco.mj_forward(servo, data)
    start = data.site("g/grip").xpos.copy()
    mujoco.mj_jacSite(servo, data, jacobian, None, servo.site("g/grip").id)
    C = endpoint_compliance(jacobian[:, :6], kq)
    # Golden: along x, y, z while the other two directions are free to yield [N/m].
    np.testing.assert_allclose(1 / np.diag(C), [188444, 126013, 9741], rtol=1e-4)
    push = np.array([-1.0, 0.5, 2.0])
    data.qfrc_applied[:] = jacobian.T @ push
    for _ in range(1500):
        mujoco.mj_step(servo, data)
    # Linear in the force: the yield of 0.3 mm changes J by 1e-3.
    K = np.linalg.inv(C)
    np.testing.assert_allclose(K @ (data.site("g/grip").xpos - start), push, rtol=5e-3, atol=5e-3)


def test_models_are_found_and_documented() -> None:
    for name in ("puma560", "gripper"):
        assert (models_dir() / name / f"{name}.xml").is_file()
        assert (models_dir() / name / "README.md").is_file()


def test_wrong_shape_is_named() -> None:
    with pytest.raises(InputError, match=r"\(6,\), got \(5,\)"):
        TABLE.gravity_torque(np.zeros(5))
