"""The arms from URDFs: their mechanics against the files' own, and that their data arrived."""

import math
import subprocess
import sys
from pathlib import Path
from typing import get_args

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm import meshes
from dualbend.arm.catalog import (
    JOINT_COUNT,
    PACKAGE,
    SHIPPED,
    ArmName,
    known_arm,
    package_folder,
)
from dualbend.arm.chain import serial_chain
from dualbend.arm.facts import ArmFacts
from dualbend.arm.file import ArmFile
from dualbend.arm.mjcf import FLANGE_SITE, GRIP_SITE, with_gripper
from dualbend.arm.model import SERVO_HZ, arm_model, rule_stiffness, scene_joints
from dualbend.errors import InputError
from dualbend.validation.lagrange import SerialArm
from dualbend.validation.urdf import equations_of

Array = NDArray[np.float64]
NAMES: tuple[ArmName, ...] = tuple(SHIPPED)


def random_configurations(name: ArmName, count: int, seed: int = 5) -> Array:
    low, high = np.array(arm_model(name).range_rad).T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def compiled(name: ArmName) -> mujoco.MjModel:
    return arm_model(name).spec(looks=False).compile()


def equations(name: ArmName) -> SerialArm:
    file = arm_model(name).file
    assert file is not None
    return equations_of(file)


def relative(found: Array, wanted: Array) -> float:
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def test_the_table_has_every_name_once() -> None:
    assert set(get_args(ArmName)) == set(JOINT_COUNT) == {"puma560", *SHIPPED}


@pytest.mark.parametrize("name", NAMES)
def test_the_flange_is_the_files(name: ArmName) -> None:
    model, wanted_of = compiled(name), equations(name)
    data = mujoco.MjData(model)
    for q in random_configurations(name, 5):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        wanted = wanted_of.flange_pose(q)
        flange = data.site(FLANGE_SITE)
        # Analytic: rounding of some ten products.
        np.testing.assert_allclose(flange.xpos, wanted[:3, 3], atol=1e-9)
        np.testing.assert_allclose(flange.xmat.reshape(3, 3), wanted[:3, :3], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_mass_matrix_is_the_files_symmetric_and_positive(name: ArmName) -> None:
    model, wanted_of = compiled(name), equations(name)
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    for q in random_configurations(name, 3):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        np.testing.assert_array_equal(mass, mass.T)
        # The links alone weigh something in every direction, without the rotors' help.
        assert np.linalg.eigvalsh(mass - np.diag(arm_model(name).armature_kg_m2)).min() > 0.0
        wanted = wanted_of.mass_matrix(q) + np.diag(arm_model(name).armature_kg_m2)
        assert relative(mass, wanted) < 1e-9  # analytic


@pytest.mark.parametrize("name", NAMES)
def test_gravity_and_coriolis_torques_are_the_files(name: ArmName) -> None:
    model, wanted_of = compiled(name), equations(name)
    data, rng = mujoco.MjData(model), np.random.default_rng(6)
    for q in random_configurations(name, 3):
        data.qpos[:], data.qvel[:] = q, rng.standard_normal(model.nv)
        mujoco.mj_forward(model, data)
        wanted = wanted_of.gravity_torque(q) + wanted_of.velocity_torque(q, data.qvel)
        assert relative(data.qfrc_bias, wanted) < 1e-9  # analytic


def test_the_equations_know_power() -> None:
    """The work of the torques is the change of kinetic and potential energy, at any motion."""
    arm, rng = equations("panda"), np.random.default_rng(8)
    q, rate, acceleration = rng.uniform(-1.0, 0.0, (3, 7))

    def kinetic(at: Array, speed: Array) -> float:
        return float(0.5 * speed @ arm.mass_matrix(at) @ speed)

    def potential(at: Array) -> float:
        return 9.81 * sum(
            link.mass_kg * float((frame[:3, :3] @ link.centre_m + frame[:3, 3])[2])
            for link, frame in zip(arm.links, arm.frames(at)[1:], strict=True)
        )

    h = 1e-5
    ahead, back = (
        kinetic(q + s * rate, rate + s * acceleration) + potential(q + s * rate) for s in (h, -h)
    )
    torque = arm.mass_matrix(q) @ acceleration + arm.velocity_torque(q, rate)
    power = (torque + arm.gravity_torque(q)) @ rate
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
    chain, model = (
        serial_chain(arm_model(name)),
        with_gripper(arm_model(name).spec(looks=False)).compile(),
    )
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
    chain, q = serial_chain(arm_model(name)), random_configurations(name, 20)
    rotation, place, _, _ = chain.forward(q)
    low, high = chain.range_rad.T
    start = np.clip(q + 0.1, low, high)
    found, miss = chain.solve(rotation, place, start, start, 30)
    # Newton: converged but for the few that start across a singular pose or at a limit.
    assert np.median(miss) < 1e-9
    assert (found >= low).all()
    assert (found <= high).all()


MASS = (
    '<inertial><mass value="2"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
ROBOT = (
    '<robot name="r"><link name="base"/>'
    '<link name="f"><inertial><mass value="7"/></inertial></link>'
    f'<link name="a">{MASS}</link><link name="b">{MASS}</link><link name="c">{MASS}</link>'
    '<joint name="j" type="revolute"><parent link="base"/><child link="a"/>'
    '<axis xyz="0 0 2"/><limit lower="-1" upper="1" effort="3" velocity="4"/></joint>'
    '<joint name="k" type="fixed"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/></joint>'
    '<joint name="l" type="fixed"><parent link="b"/><child link="f"/><origin xyz="0 0 3"/></joint>'
    '<joint name="m" type="prismatic"><parent link="a"/><child link="c"/></joint></robot>'
)
"""A hinge that moves two masses, fixed to each other; a slide beside, a tool at the flange."""


def written(folder: Path, text: str, base: str = "base", flange: str = "f") -> ArmFile:
    file = folder / "r.urdf"
    file.write_text(text)
    return ArmFile(file=file, facts=ArmFacts(base=base, flange=flange, payload_kg=1, reach_m=1))


def test_fixed_links_become_one(tmp_path: Path) -> None:
    """Two equal masses fixed to each other: centre half way, Steiner's terms in the inertia."""
    urdf = written(tmp_path, ROBOT)
    arm = urdf.read(looks=True)
    model = arm.spec.compile()
    assert (arm.joint_names, arm.limits.speed_rad_per_s) == (("j",), (4.0,))
    assert [model.body(i).name for i in range(model.nbody)] == ["world", "base", "link1"]
    link, turn = model.body("link1"), np.zeros(9)
    assert link.mass == 4.0
    # Analytic.
    np.testing.assert_allclose(link.ipos, [0.5, 0.0, 0.0])
    mujoco.mju_quat2Mat(turn, link.iquat)
    axes = turn.reshape(3, 3)
    np.testing.assert_allclose(axes * link.inertia @ axes.T, np.diag([2.0, 3.0, 3.0]), atol=1e-12)
    np.testing.assert_allclose(model.jnt_axis, [[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(model.site(FLANGE_SITE).pos, [1.0, 0.0, 3.0])
    wanted = equations_of(urdf)
    np.testing.assert_allclose(wanted.mass_matrix([0.3]), [[4.0]])  # 2 (1 + 1 m²) kg m² about z
    np.testing.assert_allclose(wanted.flange_pose([0.0])[:3, 3], [1.0, 0.0, 3.0])


def test_a_flange_that_turns_is_a_link(tmp_path: Path) -> None:
    """Where the last joint moves the flange's link, the mass of that link counts."""
    model = written(tmp_path, ROBOT, flange="a").read(looks=False).spec.compile()
    assert model.body("link1").mass == 2.0
    np.testing.assert_array_equal(model.site(FLANGE_SITE).pos, np.zeros(3))


def test_a_continuous_joint_turns_once_to_each_side(tmp_path: Path) -> None:
    spec = written(tmp_path, ROBOT.replace("revolute", "continuous")).read(looks=False).spec
    np.testing.assert_array_equal(spec.compile().jnt_range, [[-2.0 * np.pi, 2.0 * np.pi]])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("</robot>", "", "cannot be read as URDF"),
        ('ixx="1" iyy="1"', 'ixx="1" iyy="x"', "cannot be read as URDF"),
        ('"revolute"', '"planar"', "joint 'j' is planar; needs a hinge or a slide"),
        (
            'effort="3"',
            "",
            r"does not say the torque limit of any joint: robot\.arm\.torque_limit_n_m",
        ),
        ('velocity="4"', 'velocity="fast"', "joint 'j': could not convert string to float: 'fast'"),
        ('<child link="a"/>', "<child/>", "joint 'j' has no child link"),
        ('upper="1"', 'upper="-1"', "joint 'j' lacks a range, lower < upper"),
        (MASS, "", "link 'a' moves and has no mass"),
    ],
)
def test_a_file_that_is_no_arm_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        written(tmp_path, ROBOT.replace(old, new)).read(looks=False)


@pytest.mark.parametrize(
    ("base", "flange", "says"),
    [
        ("base", "x", "robot.arm.flange = 'x': no such link"),
        ("x", "f", "robot.arm.base = 'x': no such link; there are base, f, a, b, c"),
        ("a", "f", "no chain of joints from 'a' to 'f'"),
        ("f", "a", "no chain of joints from 'f' to 'a'"),
    ],
)
def test_a_chain_needs_a_joint_from_base_to_flange(
    tmp_path: Path, base: str, flange: str, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        written(tmp_path, ROBOT, base, flange).read(looks=False)


def test_a_mesh_is_coarsened_where_it_is() -> None:
    """Corners move by half a grain at most; a square of many triangles keeps its area."""
    x, y = np.meshgrid(np.arange(21) * 1e-3, np.arange(21) * 1e-3, indexing="ij")
    points = np.stack((x, y, np.zeros_like(x)), axis=-1)
    cells = [points[i : i + 2, j : j + 2].reshape(4, 3) for i in range(20) for j in range(20)]
    corners = np.concatenate([cell[[0, 1, 2, 1, 3, 2]] for cell in cells])
    mesh = meshes.coarsened(corners, (1.0, 1.0, 1.0, 1.0))
    assert len(mesh.faces) < 0.2 * len(corners) / 3
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    edge = 0.02
    # Geometry: each side loses up to half a grain at either end.
    assert (edge - meshes.GRAIN_M) ** 2 <= area <= edge**2 * (1.0 + 1e-12)


@pytest.mark.parametrize(("name", "text"), [("a.dae", "<a>"), ("a.stl", "solid"), ("a.stl", None)])
def test_a_file_that_is_no_mesh_is_named(tmp_path: Path, name: str, text: str | None) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=rf"{name}: .*mesh"):
        meshes.read_mesh(tmp_path / name)


def test_a_cell_of_pumas_does_without_the_mesh_reader() -> None:
    code = (
        "import sys; from dualbend.arm.pair import paper_pair; paper_pair().left.model.spec(); "
        "print([m for m in ('trimesh', 'collada') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_missing_package_is_named() -> None:
    with pytest.raises(InputError, match="pip install no-such-robots"):
        package_folder("no-such-robots")
    assert (package_folder(PACKAGE) / "robots").is_dir()


def test_an_unknown_arm_is_told_the_nearest() -> None:
    with pytest.raises(InputError, match=r"--arm = 'ur55'.*panda.*did you mean 'ur5'"):
        known_arm("ur55", "--arm")
