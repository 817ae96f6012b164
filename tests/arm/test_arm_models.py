"""The arms of the package: their mechanics against a recursion, and that their data arrived."""

import math
from pathlib import Path
from typing import get_args

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm import collada, urdf
from dualbend.arm import urdf_model as urdf_arm
from dualbend.arm.catalog import JOINT_COUNT, PACKAGE, URDF_ARMS, ArmName, arm_name
from dualbend.arm.chain import serial_chain
from dualbend.arm.mjcf import FLANGE_SITE, GRIP_SITE, with_gripper
from dualbend.arm.model import SERVO_HZ, arm_model, rule_stiffness, scene_joints
from dualbend.errors import InputError
from dualbend.validation import urdf_dynamics as dynamics

Array = NDArray[np.float64]
NAMES: tuple[ArmName, ...] = tuple(URDF_ARMS)


def random_configurations(name: ArmName, count: int, seed: int = 5) -> Array:
    low, high = np.array(arm_model(name).range_rad).T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def compiled(name: ArmName) -> mujoco.MjModel:
    return arm_model(name).spec(looks=False).compile()


def relative(found: Array, wanted: Array) -> float:
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def test_the_table_has_every_name_once() -> None:
    assert set(get_args(ArmName)) == set(JOINT_COUNT) == {"puma560", *URDF_ARMS}


@pytest.mark.parametrize("name", NAMES)
def test_the_flange_is_the_recursions(name: ArmName) -> None:
    model, chain = compiled(name), urdf_arm.urdf_chain(name)
    data = mujoco.MjData(model)
    for q in random_configurations(name, 5):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        wanted = dynamics.flange_pose(chain, q)
        flange = data.site(FLANGE_SITE)
        # Analytic: rounding of some ten products.
        np.testing.assert_allclose(flange.xpos, wanted[:3, 3], atol=1e-9)
        np.testing.assert_allclose(flange.xmat.reshape(3, 3), wanted[:3, :3], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_mass_matrix_is_the_recursions_symmetric_and_positive(name: ArmName) -> None:
    model, chain = compiled(name), urdf_arm.urdf_chain(name)
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    for q in random_configurations(name, 3):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        np.testing.assert_array_equal(mass, mass.T)
        # The links alone weigh something in every direction, without the rotors' help.
        assert np.linalg.eigvalsh(mass - np.diag(arm_model(name).armature_kg_m2)).min() > 0.0
        wanted = dynamics.mass_matrix(chain, q) + np.diag(arm_model(name).armature_kg_m2)
        assert relative(mass, wanted) < 1e-9  # analytic


@pytest.mark.parametrize("name", NAMES)
def test_gravity_and_coriolis_torques_are_the_recursions(name: ArmName) -> None:
    model, chain = compiled(name), urdf_arm.urdf_chain(name)
    data, rng = mujoco.MjData(model), np.random.default_rng(6)
    for q in random_configurations(name, 3):
        data.qpos[:], data.qvel[:] = q, rng.standard_normal(model.nv)
        mujoco.mj_forward(model, data)
        wanted = dynamics.inverse_dynamics(chain, q, data.qvel, np.zeros(model.nv))
        assert relative(data.qfrc_bias, wanted) < 1e-9  # analytic


def test_the_recursion_knows_power() -> None:
    """The work of the torques is the change of kinetic and potential energy, at any motion."""
    chain, rng = urdf_arm.urdf_chain("panda"), np.random.default_rng(8)
    q, rate, acceleration = rng.uniform(-1.0, 0.0, (3, 7))

    def kinetic(at: Array, speed: Array) -> float:
        return float(0.5 * speed @ dynamics.mass_matrix(chain, at) @ speed)

    def potential(at: Array) -> float:
        frames = dynamics.link_frames(chain, at)[1:]
        return 9.81 * sum(
            link.mass_kg * float((frame[:3, :3] @ link.centre_m + frame[:3, 3])[2])
            for link, frame in zip(chain.links, frames, strict=True)
        )

    h = 1e-5
    ahead, back = (
        kinetic(q + s * rate, rate + s * acceleration) + potential(q + s * rate) for s in (h, -h)
    )
    power = dynamics.inverse_dynamics(chain, q, rate, acceleration) @ rate
    # Central differences: error of order h², some 1e-8 of the energies.
    assert power == pytest.approx((ahead - back) / (2.0 * h), rel=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_what_the_file_says_arrived_in_the_compiled_arm(name: ArmName) -> None:
    arm, model = arm_model(name), compiled(name)
    assert [model.joint(i).name for i in range(model.njnt)] == list(scene_joints(arm.count))
    assert arm.count == JOINT_COUNT[name]
    np.testing.assert_array_equal(model.jnt_range, arm.range_rad)
    np.testing.assert_array_equal(model.jnt_actfrcrange[:, 1], arm.torque_limit_n_m)
    np.testing.assert_array_equal(model.dof_armature.ravel(), arm.armature_kg_m2)
    np.testing.assert_array_equal(model.dof_damping.ravel(), arm.viscous_n_m_s_per_rad)
    np.testing.assert_array_equal(model.dof_frictionloss.ravel(), arm.coulomb_n_m)
    assert model.jnt_actgravcomp.all()
    assert min(arm.speed_limit_rad_per_s) > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_looks_change_nothing_that_moves(name: ArmName) -> None:
    bare, looking = compiled(name), arm_model(name).spec(looks=True).compile()
    assert bare.nq == looking.nq
    np.testing.assert_array_equal(bare.body_mass, looking.body_mass)
    np.testing.assert_array_equal(bare.body_inertia, looking.body_inertia)
    visible = looking.geom_group == 2
    assert not looking.geom_contype[visible].any()
    assert not looking.geom_conaffinity[visible].any()
    assert visible.sum() > 0
    assert bare.nmesh == 0


@pytest.mark.parametrize("name", ["ur5", "panda", "xarm7"])
def test_an_arm_is_as_tall_in_its_looks_as_in_its_joints(name: ArmName) -> None:
    """Meshes in millimetres or turned ones would be far from the joints that carry them."""
    model = arm_model(name).spec(looks=True).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in np.flatnonzero(model.geom_group == 2):
        body = int(model.geom_bodyid[geom])
        away = np.linalg.norm(data.geom_xpos[geom] - data.xpos[body])
        assert away < 0.5 * arm_model(name).reach_m  # golden: a link is shorter than half an arm
        assert 0.01 < model.geom_rbound[geom] < 0.5 * arm_model(name).reach_m


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_the_stiffness_gives_the_mean_joint_its_frequency(name: ArmName) -> None:
    arm = arm_model(name)
    model = with_gripper(arm.spec(looks=False)).compile()
    data, mass, total = mujoco.MjData(model), np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    for q in random_configurations(name, 200):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        total += np.diag(mass) / 200
    frequency = np.sqrt(np.array(arm.stiffness_n_m_per_rad) / total) / (2.0 * math.pi)
    # Statistical: means of 200 and of 256 configurations, each within some 3 % of the mean.
    np.testing.assert_allclose(frequency, SERVO_HZ, rtol=0.05)
    assert rule_stiffness(arm.spec(looks=False)) == arm.stiffness_n_m_per_rad


@pytest.mark.parametrize("name", [*NAMES, "puma560"])
def test_the_chain_is_the_compiled_arm(name: ArmName) -> None:
    chain, model = serial_chain(name), with_gripper(arm_model(name).spec(looks=False)).compile()
    data, jacobian = mujoco.MjData(model), np.zeros((6, model.nv))
    q = random_configurations(name, 4)
    rotation, place, axes, points = chain.forward(q)
    found = chain.jacobian(place, axes, points)
    site = model.site(f"tool_{GRIP_SITE}").id
    for i, angles in enumerate(q):
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        # Analytic.
        np.testing.assert_allclose(place[i], data.site_xpos[site], atol=1e-12)
        np.testing.assert_allclose(rotation[i].ravel(), data.site_xmat[site], atol=1e-12)
        np.testing.assert_allclose(found[i, 3:], jacobian[3:], atol=1e-12)
        np.testing.assert_allclose(found[i, :3] * chain.length_m, jacobian[:3], atol=1e-12)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_the_chain_solves_what_it_made(name: ArmName) -> None:
    chain, q = serial_chain(name), random_configurations(name, 20)
    rotation, place, _, _ = chain.forward(q)
    low, high = chain.range_rad.T
    start = np.clip(q + 0.1, low, high)
    found, miss = chain.solve(rotation, place, start, start, 30)
    # Newton: converged but for the few that start across a singular pose or at a limit.
    assert np.median(miss) < 1e-9
    assert (found >= low).all()
    assert (found <= high).all()


def test_fixed_links_become_one(tmp_path: Path) -> None:
    """Two equal masses fixed to each other: centre half way, Steiner's terms in the inertia."""
    mass = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    ends = '<parent link="{}"/><child link="{}"/>'
    file = tmp_path / "r.urdf"
    file.write_text(
        '<robot name="r"><link name="base"/><link name="f"/>'
        f'<link name="a">{mass}</link><link name="b">{mass}</link>'
        f'<joint name="j" type="revolute">{ends.format("base", "a")}'
        '<axis xyz="0 0 2"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        f'<joint name="k" type="fixed">{ends.format("a", "b")}<origin xyz="1 0 0"/></joint>'
        f'<joint name="l" type="fixed">{ends.format("b", "f")}<origin xyz="0 0 3"/></joint>'
        "</robot>"
    )
    chain = urdf.read_chain(file, "base", "f", tmp_path)
    (only,), (joint,) = chain.links, chain.joints
    assert only.mass_kg == 4.0
    # Analytic.
    np.testing.assert_allclose(only.centre_m, [0.5, 0.0, 0.0])
    np.testing.assert_allclose(only.inertia_kg_m2, np.diag([2.0, 3.0, 3.0]))
    np.testing.assert_allclose(joint.axis, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(chain.flange[:3, 3], [1.0, 0.0, 3.0])
    with pytest.raises(InputError, match="no chain of joints from 'base' to 'nowhere'"):
        urdf.read_chain(file, "base", "nowhere", tmp_path)


def test_a_mesh_is_coarsened_where_it_is() -> None:
    """Corners move by half a grain at most; a square of many triangles keeps its area."""
    x, y = np.meshgrid(np.arange(21) * 1e-3, np.arange(21) * 1e-3, indexing="ij")
    points = np.stack((x, y, np.zeros_like(x)), axis=-1)
    cells = [points[i : i + 2, j : j + 2].reshape(4, 3) for i in range(20) for j in range(20)]
    corners = np.concatenate([cell[[0, 1, 2, 1, 3, 2]] for cell in cells])
    mesh = collada.coarsened(corners, (1.0, 1.0, 1.0, 1.0))
    assert len(mesh.faces) < 0.2 * len(corners) / 3
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    edge = 0.02
    # Geometry: each side loses up to half a grain at either end.
    assert (edge - collada.GRAIN_M) ** 2 <= area <= edge**2 * (1.0 + 1e-12)


def test_a_missing_package_is_named() -> None:
    with pytest.raises(InputError, match="pip install no-such-robots"):
        urdf.package_folder("no-such-robots")
    assert (urdf.package_folder(PACKAGE) / "robots").is_dir()


def test_an_unknown_arm_is_told_the_nearest() -> None:
    with pytest.raises(InputError, match=r"--arm = 'ur55'.*did you mean 'ur5'.*panda"):
        arm_name("ur55", "--arm")
