"""Arms of users' own files: each structure of makers' descriptions loads, or one line says why not.

What loads is compared with the equations of the file itself, read without MuJoCo.
"""

import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from dualbend.arm.chain import serial_chain
from dualbend.arm.facts import ArmFacts
from dualbend.arm.mjcf import FLANGE_SITE, GRIP_SITE, with_gripper
from dualbend.arm.model import ArmModel, arm_model
from dualbend.errors import InputError
from dualbend.validation.urdf import equations_of
from support.arm_files import MASSES, NAMES, J, Robot, link, six, write_mjcf

Array = NDArray[np.float64]


def loaded(robot: Robot, folder: Path, **facts: object) -> ArmModel:
    return arm_model(str(robot.write(folder)), ArmFacts(**facts))  # type: ignore[arg-type]


def flange(model: mujoco.MjModel, q: Array) -> tuple[Array, Array]:
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    site = data.site(FLANGE_SITE)
    return site.xpos.copy(), site.xmat.reshape(3, 3).copy()


def fastened() -> Robot:
    """Return the arm with a motor of 5 kg fixed beside the forearm, 0.3 m off its joint."""
    motor = J(name="bolts", kind="fixed", parent="link_3", child="motor", xyz="0.3 0 0.1")
    cover = J(name="clips", kind="fixed", parent="motor", child="cover", xyz="0 0.1 0")
    links = {"motor": link("motor", 5.0), "cover": link("cover", 1.0)}
    return six().with_links(**links).plus([], motor, cover)


def seven() -> Robot:
    """Return seven joints: the upper arm turns about itself, too."""
    robot = six().with_joints(elbow={"parent": "link_2b"}).with_links(link_2b=link("link_2b", 2.0))
    roll = J(name="roll", parent="link_2", child="link_2b", xyz="0 0 0.1", low=-3.0, high=3.0)
    return robot.plus([], roll)


def on_rail() -> Robot:
    """Return the arm on a slide of 1.5 m."""
    rail = J(
        **{"name": "rail", "kind": "prismatic", "parent": "floor", "child": "base_link"},
        **{"axis": "0 1 0", "low": -0.75, "high": 0.75, "effort": 2000.0, "speed": 1.0},
    )
    carriage = {"base_link": link("base_link", 30.0)}
    return six().with_links(**carriage).plus(["floor"], rail)


def with_stub() -> Robot:
    """Return the arm with a frame that has no mass between shoulder and upper arm."""
    robot = six().with_joints(elbow={"parent": "stub"})
    roll = J(name="roll", parent="link_2", child="stub", low=-1.0, high=1.0)
    return robot.plus(["stub"], roll)


def gripping() -> Robot:
    """Return the arm with a gripper of two fingers on its flange, one of which follows."""
    slide = {"kind": "prismatic", "parent": "palm", "low": 0.0, "high": 0.04, "axis": "0 1 0"}
    palm = J(name="palm_joint", kind="fixed", parent="tool0", child="palm")
    left = J(name="left_slide", child="left_part", **slide)  # type: ignore[arg-type]
    mimic = '<mimic joint="left_slide"/>'
    right = J(name="right_slide", child="right_part", more=mimic, **slide)  # type: ignore[arg-type]
    parts = {name: link(name, 0.5) for name in ("palm", "left_part", "right_part")}
    return six().with_links(**parts).plus([], palm, left, right)


def pedestal() -> Robot:
    """Return the arm on a column that stands in the file's world, turned and 0.7 m high."""
    column = J(name="column", kind="fixed", parent="world", child="stand", xyz="1 2 0")
    top = J(
        name="top", kind="fixed", parent="stand", child="base_link", xyz="0 0 0.7", rpy="0 0 0.5"
    )
    return six().with_links(stand=link("stand", 50.0)).plus(["world"], column, top)


LOADING: dict[str, tuple[Callable[[], Robot], int]] = {
    "six hinges": (six, 6),
    "fixed masses beside a link": (fastened, 6),
    "seven joints": (seven, 7),
    "a rail": (on_rail, 7),
    "a frame that moves": (with_stub, 7),
    "a gripper on it": (gripping, 6),
    "a column under it": (pedestal, 6),
    "continuous": (lambda: six().with_joints(pan={"kind": "continuous", "low": 0, "high": 0}), 6),
}


@pytest.mark.parametrize("name", LOADING)
def test_an_arm_is_its_file(name: str, tmp_path: Path) -> None:
    """Flange, weight and mass matrix by Lagrange's equations from the file's own numbers."""
    make, count = LOADING[name]
    arm = loaded(make(), tmp_path)
    assert arm.file is not None
    assert arm.count == count
    assert arm.file.facts.flange == "tool0"
    model, theory = arm.spec(looks=False).compile(), equations_of(arm.file)
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    for q in np.random.default_rng(3).uniform(*np.transpose(arm.range_rad), (5, count)):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        wanted = theory.mass_matrix(q) + np.diag(arm.armature_kg_m2)
        place, turn = flange(model, q)
        # Analytic, but for the milligram of a frame without mass.
        np.testing.assert_allclose(mass, wanted, atol=2e-5)
        np.testing.assert_allclose(data.qfrc_bias, theory.gravity_torque(q), atol=2e-5)
        np.testing.assert_allclose(place, theory.flange_pose(q)[:3, 3], atol=1e-9)
        np.testing.assert_allclose(turn, theory.flange_pose(q)[:3, :3], atol=1e-9)


def test_what_is_fixed_beside_a_link_weighs(tmp_path: Path) -> None:
    plain, more = loaded(six(), tmp_path / "a"), loaded(fastened(), tmp_path / "b")
    mass = [arm.spec(looks=False).compile().body_mass.sum() for arm in (plain, more)]
    assert mass[1] - mass[0] == pytest.approx(6.0)


def test_a_gripper_that_is_already_there_is_left_out(tmp_path: Path) -> None:
    bare, gripped = loaded(six(), tmp_path / "a"), loaded(gripping(), tmp_path / "b")
    assert bare.spec(looks=False).compile().body_mass.sum() == pytest.approx(sum(MASSES))
    for name in ("joint_names", "range_rad", "stiffness_n_m_per_rad", "reach_m", "payload_kg"):
        assert getattr(bare, name) == getattr(gripped, name)


def test_a_column_of_the_file_moves_nothing(tmp_path: Path) -> None:
    """The place of an arm is the cell's: the file's own world, its column and turn do not count."""
    plain, raised = loaded(six(), tmp_path / "a"), loaded(pedestal(), tmp_path / "b")
    q = np.linspace(-1.0, 1.0, 6)
    for one, other in zip(
        flange(plain.spec().compile(), q), flange(raised.spec().compile(), q), strict=True
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("rpy", "outward"),
    [("0 0 0", 1), ("-1.5707963 0 0", 2), ("0 0 1.5707963", 0), ("0 0 -1.5707963", 0)],
)
def test_a_flange_is_turned_so_that_z_is_outward(rpy: str, outward: int, tmp_path: Path) -> None:
    """Whichever axis a maker points outward, the tool comes out along the last joint's axis."""
    arm = loaded(six().with_joints(mount={"rpy": rpy}), tmp_path)
    model = arm.spec(looks=False).compile()
    _, turn = flange(model, np.zeros(6))
    np.testing.assert_allclose(turn[:, 2], [0.0, 1.0, 0.0], atol=1e-7)  # the axis of wrist_3
    assert arm.file is not None
    quat, own = np.empty(4), np.empty(9)
    mujoco.mju_euler2Quat(quat, np.array(arm.file.facts.flange_rpy_rad), "XYZ")
    mujoco.mju_quat2Mat(own, quat)
    assert abs(own.reshape(3, 3)[outward, 2]) == pytest.approx(1.0)


def test_a_rail_slides(tmp_path: Path) -> None:
    """The chain moves the grip by as much as the rail; its limits and rotor are a slide's."""
    arm = loaded(on_rail(), tmp_path)
    assert arm.slides == (True, *[False] * 6)
    assert arm.armature_kg_m2[0] == 10.0
    assert arm.torque_limit_n_m[0] == 2000.0
    assert arm.range_rad[0] == (-0.75, 0.75)
    # 20 Hz of all that the rail carries: 30 kg of carriage, 18.8 of arm, gripper, 10 of rotor.
    carried = arm.stiffness_n_m_per_rad[0] / (2.0 * math.pi * 20.0) ** 2
    model = with_gripper(arm.spec(looks=False)).compile()
    assert carried == pytest.approx(float(model.body_mass.sum()) + 10.0, rel=1e-2)
    chain, data = serial_chain(arm), mujoco.MjData(model)
    q = np.random.default_rng(2).uniform(*np.transpose(arm.range_rad), (4, 7))
    rotation, place, axes, points = chain.forward(q)
    found = chain.jacobian(place, axes, points)
    jacobian, site = np.zeros((6, 7)), model.site(f"tool_{GRIP_SITE}").id
    for i, angles in enumerate(q):
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        np.testing.assert_allclose(place[i], data.site_xpos[site], atol=1e-12)
        np.testing.assert_allclose(rotation[i].ravel(), data.site_xmat[site], atol=1e-12)
        np.testing.assert_allclose(found[i, :3] * chain.length_m, jacobian[:3], atol=1e-12)
        np.testing.assert_allclose(found[i, 3:], jacobian[3:], atol=1e-12)


def test_reach_and_payload_are_those_of_the_stretched_arm(tmp_path: Path) -> None:
    """By hand: all links along z from the shoulder on; the weights at their levers."""
    arm = loaded(six(), tmp_path)
    # Shoulder to wrist 0.42 + 0.40; beyond it 0.1 (z) and 0.1 + 0.08 across, turned into line by
    # joint 5, and 0.13 - 0.12 beside. The farthest is near their hypotenuse, within 2 %.
    straight = math.hypot(0.42 + 0.40 + 0.1, 0.01 - 0.12 + 0.13 + 0.1 + 0.08)
    assert 0.82 < arm.reach_m < straight * 1.05
    lifted = arm_model(str(six().with_joints(lift={"effort": 100.0}).write(tmp_path / "weak")))
    # The lift holds the arm's own 14.8 kg near 0.4 m with 60 N m: 100 N m leave less than 330.
    assert lifted.payload_kg < arm.payload_kg


def meshed(folder: Path, kind: str, name: str) -> Robot:
    """Return the arm whose upper arm is a mesh in a package beside the file's folder."""
    (folder / "my_arm_description" / "meshes").mkdir(parents=True)
    box = trimesh.creation.box((0.1, 0.1, 0.4)).subdivide()
    box.export(folder / "my_arm_description" / "meshes" / f"part.{kind}")
    mesh = f'<geometry><mesh filename="{name}"/></geometry>'
    shapes = f"<visual>{mesh}</visual><collision>{mesh}</collision>"
    return six().with_links(link_2=link("link_2", 8.0, shape=False, more=shapes))


@pytest.mark.parametrize("kind", ["stl", "obj", "dae", "glb", "gltf"])
def test_meshes_of_a_package_are_found_upward_of_the_file(kind: str, tmp_path: Path) -> None:
    name = f"package://my_arm_description/meshes/part.{kind}"
    arm = loaded(meshed(tmp_path, kind, name), tmp_path / "my_arm_description" / "urdf")
    model = arm.spec().compile()
    (mesh,) = range(model.nmesh)
    size = np.ptp(model.mesh_vert[model.mesh_vertadr[mesh] :], axis=0)
    np.testing.assert_allclose(sorted(size), [0.1, 0.1, 0.4], atol=1e-6)
    body = model.body("link2").id
    capsules = [g for g in np.flatnonzero(model.geom_bodyid == body) if model.geom_contype[g]]
    # As long as the box, as thick as its sides.
    np.testing.assert_allclose(model.geom_size[capsules[0]][:2], [0.05, 0.15], atol=1e-6)


def test_a_package_elsewhere_is_said_or_asked_for(tmp_path: Path) -> None:
    name = "package://my_arm_description/meshes/part.stl"
    robot = meshed(tmp_path / "ws", "stl", name)
    with pytest.raises(
        InputError, match=r"part\.stl: not found upward of the file; robot\.arm\.pa"
    ):
        loaded(robot, tmp_path / "a")
    assert loaded(robot, tmp_path / "a", packages=(str(tmp_path / "ws"),)).count == 6
    beside = meshed(tmp_path / "b", "stl", "my_arm_description/meshes/part.stl")
    assert loaded(beside, tmp_path / "b").count == 6


def two_armed() -> Robot:
    """Return two arms on one torso."""
    right = six()
    links = {
        f"r_{name}": text.replace('name="', 'name="r_', 1) for name, text in right.links.items()
    }
    joints = [
        J(**{**vars(j), "name": f"r_{j.name}", "parent": f"r_{j.parent}", "child": f"r_{j.child}"})
        for j in right.joints
    ]
    mounts = (
        J(name="left_mount", kind="fixed", parent="torso", child="base_link", xyz="0 0.3 1"),
        J(name="right_mount", kind="fixed", parent="torso", child="r_base_link", xyz="0 -0.3 1"),
    )
    return six().with_links(**links).plus(["torso"], *joints, *mounts)


def test_of_two_arms_each_is_had_by_its_flange(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"several chains.*'base_link' to 'tool0', 'r_base_link' to"
    ):
        loaded(two_armed(), tmp_path)
    left = loaded(two_armed(), tmp_path, flange="tool0")
    right = loaded(two_armed(), tmp_path, base="r_base_link")
    assert left.joint_names == NAMES
    assert right.joint_names == tuple(f"r_{name}" for name in NAMES)
    assert left.stiffness_n_m_per_rad == right.stiffness_n_m_per_rad


UNEVEN = link("link_4", 1.0).replace('ixx="0.01"', 'ixx="0.05"')
NO_INERTIA = link("link_4", 1.0).replace("0.01", "0")

REFUSED = {
    "effort of one": (
        six().with_joints(lift={"effort": None}),
        r"not say the torque limit of lift: robot\.arm\.torque_limit_n_m = \[6 values",
    ),
    "effort and speed of all": (
        six().with_joints(**{name: {"effort": None, "speed": 0.0} for name in NAMES}),
        r"torque limit of any joint: .* usual are 10 to 300 N m.*; nor the speed limit of any",
    ),
    "no range": (six().with_joints(elbow={"limited": False}), "joint 'elbow' lacks a range"),
    "a plane": (
        six().with_joints(elbow={"kind": "planar"}),
        "'elbow' is planar; needs a hinge or a slide",
    ),
    "five": (
        six().with_joints(elbow={"kind": "fixed"}),
        "5 joints from 'base_link' to 'tool0' .*an arm has 6 to 8",
    ),
    "nine": (
        six("r3")
        .with_links(**{f"r{i}": link(f"r{i}", 1.0) for i in range(4)})
        .plus([], *[J(name=f"e{i}", parent=f"r{i}", child=f"r{i + 1}") for i in range(3)]),
        r"9 joints from 'r0' to 'tool0' \(e0, e1, e2, pan, lift, elbow, \.\.\.\); an arm has 6 to",
    ),
    "coupled": (
        six().with_joints(elbow={"more": '<mimic joint="lift"/>'}),
        "joint 'elbow' follows 'lift': an arm whose joints are coupled",
    ),
    "no mass": (six().with_links(link_4=link("link_4")), "link 'link_4' moves and has no mass"),
    "no inertia": (six().with_links(link_4=NO_INERTIA), "link 'link_4' moves and has no inertia"),
    "an inertia that no body has": (
        six().with_links(link_4=UNEVEN),
        "cannot be simulated: .*inertia must satisfy .*'link_4'",
    ),
    "a mass that no arm has": (
        six().with_links(link_4=link("link_4", 1e7)),
        r"a mass \[kg\] is 1e\+07; 100000 at most",
    ),
    "no end of a torque": (
        six().with_joints(lift={"effort": math.inf}),
        r"a torque limit \[N m\] is inf; 1e\+06 at most",
    ),
    "xacro": (
        Robot(links={}, joints=(), more='<xacro:include filename="a.xacro"/>'),
        r"is xacro, not expanded: xacro arm\.urdf > arm\.urdf",
    ),
    "nothing that moves": (Robot(links={"a": link("a")}, joints=()), "no chain of joints"),
    "a link that is not there": (
        six().plus([], J(name="x", parent="tool0", child="nowhere")),
        "joint 'x' moves the link 'nowhere', which there is not",
    ),
    "a circle": (
        six().plus([], J(name="x", parent="tool0", child="base_link")),
        "no link that is not moved by another",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_one_line_says_what_a_file_lacks(name: str, tmp_path: Path) -> None:
    robot, says = REFUSED[name]
    with pytest.raises(InputError, match=says) as caught:
        loaded(robot, tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "arm.urdf"))
    assert "\n" not in str(caught.value)


def test_what_a_file_lacks_is_given_by_key(tmp_path: Path) -> None:
    lacking = six().with_joints(**{name: {"effort": None, "speed": None} for name in NAMES})
    torque, speed, rotor = (tuple(np.arange(1.0, 7.0) * scale) for scale in (50.0, 1.0, 0.1))
    arm = loaded(
        lacking,
        tmp_path,
        torque_limit_n_m=torque,
        speed_limit_rad_per_s=speed,
        armature_kg_m2=rotor,
        coulomb_n_m=rotor,
        viscous_n_m_s_per_rad=speed,
        payload_kg=4.0,
        reach_m=0.9,
    )
    assert arm.torque_limit_n_m == torque
    assert arm.speed_limit_rad_per_s == speed
    assert arm.armature_kg_m2 == arm.coulomb_n_m == rotor
    assert arm.viscous_n_m_s_per_rad == speed
    assert (arm.payload_kg, arm.reach_m) == (4.0, 0.9)
    assert arm.assumed == ()
    with pytest.raises(InputError, match="torque_limit_n_m has 7 values, the arm 6 joints"):
        loaded(lacking, tmp_path, torque_limit_n_m=(*torque, 1.0), speed_limit_rad_per_s=speed)


SPEED = (3.0,) * 6


def of_mjcf(folder: Path, *changes: tuple[str, str], **facts: object) -> ArmModel:
    given = ArmFacts(**{"speed_limit_rad_per_s": SPEED, **facts})  # type: ignore[arg-type]
    return arm_model(str(write_mjcf(folder, *changes)), given)


MJCF_CHANGES: dict[str, tuple[tuple[str, str], ...]] = {
    "as it is": (),
    "no site": (('<site name="attachment_site" pos="0 0.1 0" quat="-1 1 0 0"/>', ""),),
    "a rail": (
        ('<body name="base" ', '<body name="foot"><body name="base" '),
        (
            '<inertial mass="4" ',
            '<joint name="rail" type="slide" axis="1 0 0" range="-0.5 0.5" ref="0.1"'
            ' actuatorfrcrange="-900 900"/><inertial mass="4" ',
        ),
        ('<body name="cube"', '</body><body name="cube"'),
        ('qpos="0', 'qpos="0 0'),
    ),
    "inertia from shapes": (
        ('<inertial mass="1.2" pos="0 0.1 0" diaginertia="0.003 0.003 0.002"/>', ""),
        ('<joint name="w1" class="small"/>', '<joint name="w1"/><geom size=".05" mass="1"/>'),
    ),
}


@pytest.mark.parametrize("name", MJCF_CHANGES)
def test_an_arm_of_an_mjcf_is_what_mujoco_compiles(name: str, tmp_path: Path) -> None:
    """Also with joints off their body's origin, references, and masses fixed beside a link."""
    count = 7 if name == "a rail" else 6
    arm = of_mjcf(tmp_path, *MJCF_CHANGES[name], speed_limit_rad_per_s=(1.0,) * count)
    assert arm.file is not None
    assert arm.file.facts.flange == ("gripper" if name == "no site" else "attachment_site")
    model, theory = arm.spec(looks=False).compile(), equations_of(arm.file)
    data, mass = mujoco.MjData(model), np.zeros((count, count))
    assert (model.nu, model.nkey, model.neq, model.ntendon, model.nsensor) == (0, 0, 0, 0, 0)
    for q in np.random.default_rng(3).uniform(*np.transpose(arm.range_rad), (5, count)):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        place, turn = flange(model, q)
        # Analytic.
        np.testing.assert_allclose(
            mass, theory.mass_matrix(q) + np.diag(arm.armature_kg_m2), atol=1e-9
        )
        np.testing.assert_allclose(data.qfrc_bias, theory.gravity_torque(q), atol=1e-9)
        np.testing.assert_allclose(place, theory.flange_pose(q)[:3, 3], atol=1e-9)
        np.testing.assert_allclose(turn, theory.flange_pose(q)[:3, :3], atol=1e-9)


def test_an_mjcf_s_own_numbers_arrive(tmp_path: Path) -> None:
    arm = of_mjcf(tmp_path)
    # Its actuators' force range; times the gear; of a motor what its largest control gives.
    assert arm.torque_limit_n_m == (150.0, 150.0, 150.0, 28.0, 50.0, 25.0)
    assert arm.armature_kg_m2 == (0.12, 0.12, 0.12, 0.05, 0.05, 0.05)
    assert set(arm.viscous_n_m_s_per_rad) == {0.5}
    assert set(arm.coulomb_n_m) == {0.3}
    np.testing.assert_allclose(arm.range_rad, [[-2.0 * math.pi, 2.0 * math.pi]] * 6)
    with pytest.raises(InputError, match="does not say the speed limit of any joint"):
        of_mjcf(tmp_path, speed_limit_rad_per_s=None)


def test_an_mjcf_looks_as_it_does_in_its_file(tmp_path: Path) -> None:
    """Its mesh, in millimetres and turned with its body, and its colour."""
    model = of_mjcf(tmp_path).spec().compile()
    (shown,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    np.testing.assert_allclose(model.geom_rgba[shown], [0.2, 0.3, 0.8, 1.0], atol=1e-6)
    assert model.body(model.geom_bodyid[shown]).name == "link2"
    vertices = model.mesh_vert + model.geom_pos[shown]
    assert np.ptp(vertices, axis=0).max() == pytest.approx(0.4, abs=1e-6)
    np.testing.assert_allclose(model.geom_pos[shown], [0.0, 0.0, 0.2], atol=1e-6)


KEY = '<key name="home" qpos="0 0 0 0 0 0 0 0 1 0 0 1 0 0 0" ctrl="0 0 0 0 0 0 0"/>'
ELBOW = '<joint name="elbow" pos="0 0 0.01"/>'
DRIVE = '<general class="arm" name="{0}" joint="{0}"/>'


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ([("</mujoco>", "")], "cannot be read as MJCF"),
        ([('file="upper.stl"', 'file="none.stl"')], "cannot be read as MJCF: .*none.stl"),
        (
            [(ELBOW, f'{ELBOW}<joint name="second" axis="1 0 0"/>'), (KEY, "")],
            "joint 'elbow' is one of 2 of its body; needs one hinge or slide",
        ),
        (
            [(ELBOW, ""), (DRIVE.format("elbow"), ""), (KEY, "")],
            "5 joints from 'base' to 'attachment_site'",
        ),
        ([('joint1="fr" joint2="fl"', 'joint1="w2" joint2="w3"')], "'w2' follows 'w3'"),
        (
            [(DRIVE.format("lift"), ""), (KEY, "")],
            r"the torque limit of lift: robot\.arm\.torque_limit_n_m = \[6 values",
        ),
    ],
)
def test_an_mjcf_that_is_no_arm_is_refused(
    changes: list[tuple[str, str]], says: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=says):
        of_mjcf(tmp_path, *changes)


def test_an_included_file_counts(tmp_path: Path) -> None:
    """Where a part of the arm is in another file, a change of that is a change of the arm."""
    compiler = '<compiler angle="degree" autolimits="true" meshdir="assets"/>'
    part = (compiler, '<include file="head.xml"/>')
    (tmp_path / "head.xml").write_text(f"<mujoco>{compiler}</mujoco>")
    before = of_mjcf(tmp_path, part)
    (tmp_path / "head.xml").write_text(f"<mujoco>{compiler}<!-- new --></mujoco>")
    assert of_mjcf(tmp_path, part).fingerprint != before.fingerprint


def test_a_urdf_may_be_called_xml(tmp_path: Path) -> None:
    file = six().write(tmp_path, "arm.xml")
    assert arm_model(str(file)).count == 6


def test_a_file_is_read_again_when_it_changed(tmp_path: Path) -> None:
    before = loaded(six(), tmp_path)
    after = loaded(six().with_joints(lift={"effort": 200.0}), tmp_path)
    assert before.torque_limit_n_m[1] == 330.0
    assert after.torque_limit_n_m[1] == 200.0
    with pytest.raises(InputError, match=r"was changed since the run: .*robot\.arm\.sha256 = none"):
        loaded(six(), tmp_path, sha256=before.fingerprint.split()[-1][::-1])
    assert before.file is not None
    assert loaded(six(), tmp_path, sha256=before.file.sha256) == before


@pytest.mark.parametrize("text", ["", "<robot", "<html/>", "\0"])
def test_a_file_that_is_no_urdf_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(text)
    with pytest.raises(InputError, match=r"arm\.urdf: (cannot be read as URDF|is no URDF)"):
        arm_model(str(tmp_path / "arm.urdf"))
    with pytest.raises(InputError, match=r"none\.urdf: cannot be read: No such file"):
        arm_model(str(tmp_path / "none.urdf"))
