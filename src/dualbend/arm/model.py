"""The data of one kind of arm: joints, limits, drives, ratings, and where each is from.

Names are the same on every arm: ``joint1`` to ``joint<n>`` from the base on, site ``flange``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import msgspec
import mujoco
import numpy as np

from dualbend.arm.catalog import PACKAGE, SHIPPED, ArmName, known_arm, package_folder
from dualbend.arm.facts import ArmFacts
from dualbend.arm.file import ROTOR_KG, ROTOR_KG_M2, ArmFile, FileArm, is_file, sha256_of
from dualbend.arm.mjcf import load_puma, with_gripper
from dualbend.arm.ratings import held_mass, largest_reach
from dualbend.errors import InputError, brief
from dualbend.types import Vector

PUMA: Final = "puma560"
"""The arm of the paper, and the default."""

SERVO_HZ: Final = 20.0
"""Natural frequency of each joint by itself on its servo, by which stiffness is set [Hz]."""

_SEED, _SAMPLES = 7, 256


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where an arm stands in its bending frame, whose origin is on the floor in the mid-plane.

    The base frame's origin is at (−distance, lateral, height), and its axes are turned by
    R_z(yaw) R_y(pitch) R_x(roll): z is up on the floor, forward at a pitch of π/2 (on a wall), down
    at a roll of π (hanging). ``home_rad`` is a joint configuration near the start of the work: it
    picks the branch of the inverse kinematics, and is the posture that a redundant arm keeps.
    """

    base_distance_m: float
    base_lateral_m: float
    base_height_m: float
    base_yaw_rad: float
    home_rad: tuple[float, ...]
    base_roll_rad: float = 0.0
    base_pitch_rad: float = 0.0

    @property
    def upright(self) -> bool:
        """Its z is up."""
        return self.base_roll_rad == self.base_pitch_rad == 0.0

    def quat(self, turn_rad: float = 0.0) -> Vector:
        """Return the axes' quaternion (4,), turned further by an angle about the vertical."""
        quat = np.empty(4)
        turns = (turn_rad + self.base_yaw_rad, self.base_pitch_rad, self.base_roll_rad)
        mujoco.mju_euler2Quat(quat, np.array(turns), "zyx")
        return quat


@dataclass(frozen=True, kw_only=True)
class ArmModel:
    """A serial arm of n joints, base to flange, without tool.

    Attributes
    ----------
    name : one of :data:`dualbend.arm.catalog.ArmName`, or that of the arm's file
    joint_names : what the data calls the joints (n,); in the scene they are joint1 ... joint<n>
    slides : (n,) which joints are slides; their numbers are in m and N for rad and N m
    range_rad : (n, 2) lower and upper limit
    speed_limit_rad_per_s, torque_limit_n_m : (n,)
    armature_kg_m2 : (n,) inertia of the rotor at the joint
    viscous_n_m_s_per_rad, coulomb_n_m : (n,) friction at the joint
    stiffness_n_m_per_rad : (n,) of the position servo, unless the scenario says otherwise
    payload_kg, reach_m : as the manufacturer rates it; reach from the shoulder to the wrist or
        flange, as the data sheet counts
    source : where geometry, masses and limits are from
    grade : how good the dynamics are: measured, manufacturer, or what is assumed
    assumed : what the data lacks, and what stands in for it
    placement : a documented place for the paper's experiment; None: found for each scenario
    file : that the arm is made from; None: the package's own MJCF
    """

    name: str
    joint_names: tuple[str, ...]
    slides: tuple[bool, ...]
    range_rad: tuple[tuple[float, float], ...]
    speed_limit_rad_per_s: tuple[float, ...]
    torque_limit_n_m: tuple[float, ...]
    armature_kg_m2: tuple[float, ...]
    viscous_n_m_s_per_rad: tuple[float, ...]
    coulomb_n_m: tuple[float, ...]
    stiffness_n_m_per_rad: tuple[float, ...]
    payload_kg: float
    reach_m: float
    source: str
    grade: str
    assumed: tuple[str, ...] = ()
    placement: Placement | None = None
    file: ArmFile | None = None

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def fingerprint(self) -> str:
        """Path and SHA-256 of a user's file; "" of an arm that is shipped."""
        if self.file is None or not self.file.sha256:
            return ""
        return f"{self.file.file}, sha256 {self.file.sha256}"

    @property
    def rated(self) -> bool:
        """Its payload is a manufacturer's or a user's, and not computed from the torques."""
        return self.file is None or self.file.facts.payload_kg is not None

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints in the scene, base to flange."""
        return scene_joints(self.count)

    @property
    def scene_slides(self) -> dict[str, bool]:
        """Which joints are slides, by their names in the scene."""
        return dict(zip(self.joints, self.slides, strict=True))

    def spec(self, *, looks: bool = True) -> mujoco.MjSpec:
        """Return a fresh specification without actuators or tool; without meshes if no looks.

        The frame of ``base`` is the arm's own, z up; gravity compensation reaches the joints only
        in a model with at least one actuator.
        """
        return load_puma() if self.file is None else self.file.read(looks=looks).spec


def scene_joints(count: int) -> tuple[str, ...]:
    """Return the names that the joints of an arm have in the scene."""
    return tuple(f"joint{i + 1}" for i in range(count))


def arm_model(name: str, facts: ArmFacts | None = None) -> ArmModel:
    """Return the arm of a name, or of a file: what its file holds, the rest from the facts.

    Raises InputError where there is no such arm or file, the package with the arm's files is
    missing, or the file lacks something, or is not the one of ``facts.sha256``.
    """
    facts = facts or ArmFacts()
    if is_file(name):
        return _of_file(_unchanged(Path(name), facts))
    return _shipped(known_arm(name), facts)


@functools.cache
def _shipped(name: ArmName, facts: ArmFacts) -> ArmModel:
    shipped = SHIPPED.get(name)
    if shipped is None:
        if facts != ArmFacts():
            raise InputError(f"robot.arm: is of an arm's file, and of {PUMA!r} nothing is missing")
        return _puma()
    file = package_folder(PACKAGE) / "robots" / shipped.file
    model = _of_file(ArmFile(file=file, facts=facts.over(shipped.facts)))
    return replace(
        model,
        name=name,
        source=f"{PACKAGE}, {shipped.file}, from {shipped.upstream}; ratings: {shipped.rated}",
        grade=shipped.grade,
        assumed=(*model.assumed, *shipped.assumed),
    )


def _unchanged(file: Path, facts: ArmFacts) -> ArmFile:
    """Return a file with its content's SHA-256; InputError where another one is asked for."""
    sha256 = sha256_of(file)
    if facts.sha256 not in (None, sha256):
        raise InputError(
            f"{file}: was changed since the run: its sha256 is {sha256[:12]}..., that of "
            f"robot.arm.sha256 {brief(facts.sha256)[1:13]}...; robot.arm.sha256 = none takes it so"
        )
    return ArmFile(file=file, facts=msgspec.structs.replace(facts, sha256=None), sha256=sha256)


@functools.cache
def _of_file(given: ArmFile) -> ArmModel:
    file = given.resolved()
    arm = file.read(looks=False)
    model = arm.spec.compile()
    joints, facts = _joints(model), file.facts
    return ArmModel(
        name=file.file.name,
        joint_names=arm.joint_names,
        slides=arm.slides,
        speed_limit_rad_per_s=arm.limits.speed_rad_per_s,
        stiffness_n_m_per_rad=rule_stiffness(arm.spec),
        payload_kg=facts.payload_kg or float(f"{held_mass(model):.3g}"),
        reach_m=facts.reach_m or round(largest_reach(model), 3),
        source=str(file.file),
        grade="as its file says",
        assumed=_assumed(file, arm, joints),
        file=file,
        **joints,
    )


def _assumed(file: ArmFile, arm: FileArm, joints: dict[str, Any]) -> tuple[str, ...]:
    """Return what stands in for numbers that neither file nor facts hold."""
    facts, notes = file.facts, list(arm.notes)
    kind, has = "file", "the file has none"
    if file.file.suffix.lower() == ".urdf":
        kind, has = "URDF", "no URDF has it"
    if not arm.limits.armature_kg_m2:
        at = f"{ROTOR_KG_M2:g} kg m² at every {'hinge' if any(arm.slides) else 'joint'}"
        at += f", {ROTOR_KG:g} kg at every slide" if any(arm.slides) else ""
        notes.append(f"rotor inertia {at} ({has})")
    elif not all(arm.limits.armature_kg_m2):
        pairs = zip(arm.joint_names, arm.limits.armature_kg_m2, strict=True)
        notes.append(f"rotor inertia of {', '.join(name for name, rotor in pairs if not rotor)}")
    if not any((*joints["viscous_n_m_s_per_rad"], *joints["coulomb_n_m"])):
        notes.append(f"no friction in the joints (the {kind} gives none)")
    if facts.payload_kg is None:
        notes.append("payload: what the torques hold anywhere; the run looks at torques alone")
    if facts.reach_m is None:
        notes.append("reach: from the shoulder to the flange")
    return tuple(notes)


def rule_stiffness(spec: mujoco.MjSpec) -> tuple[float, ...]:
    """Return servo stiffnesses (n,) [N m/rad] that give each joint by itself 20 Hz.

    k_i = (2π 20 Hz)² I_i with I_i the mean over the ranges (256 seeded configurations) of what
    joint i moves, gripper and rotor included: every joint of every arm then has the same frequency,
    the upper end of what is reported of the PUMA's first resonance, whatever the pose.
    """
    model = with_gripper(spec).compile()
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    low, high = model.jnt_range.T
    total = np.zeros(model.nv)
    for q in np.random.default_rng(_SEED).uniform(low, high, (_SAMPLES, model.nv)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_fullM(model, data, mass)
        total += np.diag(mass)
    # Three digits: the rest is the sample's.
    rule = (2.0 * np.pi * SERVO_HZ) ** 2 * total / _SAMPLES
    return tuple(float(f"{value:.3g}") for value in rule)


def _puma() -> ArmModel:
    """Return the PUMA 560: what its MJCF holds is read from there."""
    model = load_puma().compile()
    return ArmModel(
        name=PUMA,
        joint_names=scene_joints(model.njnt),
        slides=(False,) * model.njnt,
        # Where the drive's voltage saturates; Corke (1996), Tables 2.18 and 2.21.
        speed_limit_rad_per_s=(1.92, 1.51, 2.40, 5.34, 5.09, 5.74),
        # Joints 1 to 3: (2π 20 Hz)² J, 20 Hz the upper end of a recalled first resonance of
        # 14-20 Hz and J = 2.88, 2.09, 0.36 kg m², what the published links have about each joint
        # at pose qn of the Robotics Toolbox (inferred). Joints 4 to 6 are assumed.
        stiffness_n_m_per_rad=(4.5e4, 3.3e4, 0.57e4, 2.0e3, 2.0e3, 2.0e3),
        payload_kg=2.5,
        reach_m=0.9,
        source="Corke and Armstrong-Hélouvry (1994), Corke (1996); models/puma560/README.md",
        grade="published measurements; reach from Walter (ch. 2), payload recalled",
        placement=Placement(
            base_distance_m=1.075,
            base_lateral_m=0.15005,
            # Shoulder axis, the base frame's origin, above the floor; RTB-Python, Puma560.py.
            base_height_m=0.672,
            base_yaw_rad=0.0,
            # Elbow up, forearm down, hand level.
            home_rad=tuple(math.radians(a) for a in (0.0, 45.0, -180.0, 0.0, 45.0, 0.0)),
        ),
        **_joints(model),
    )


def _joints(model: mujoco.MjModel) -> dict[str, Any]:
    """Return what a compiled arm says of its joints, by the fields of :class:`ArmModel`."""
    return {
        "range_rad": tuple(map(tuple, model.jnt_range.tolist())),
        "torque_limit_n_m": tuple(model.jnt_actfrcrange[:, 1].tolist()),
        "armature_kg_m2": tuple(model.dof_armature.ravel().tolist()),
        "viscous_n_m_s_per_rad": tuple(model.dof_damping.ravel().tolist()),
        "coulomb_n_m": tuple(model.dof_frictionloss.ravel().tolist()),
    }
