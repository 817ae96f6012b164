"""The data of one kind of arm: joints, limits, drives, ratings, and where each is from.

Names are the same on every arm: ``joint1`` to ``joint<n>`` from the base on, site ``flange``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np

from dualbend.arm.catalog import PACKAGE, URDF_ARMS, ArmName
from dualbend.arm.mjcf import load_puma, with_gripper
from dualbend.arm.urdf import UrdfFile, package_folder

PUMA: Final = "puma560"
"""The arm of the paper, and the default."""

SERVO_HZ: Final = 20.0
"""Natural frequency of each joint by itself on its servo, by which stiffness is set [Hz]."""

_SEED, _SAMPLES = 7, 256


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where an arm stands in its bending frame, whose origin is on the floor in the mid-plane.

    The base frame's origin is at (−distance, lateral, height) and its z up; yaw turns it about z.
    ``home_rad`` is a joint configuration near the start of the work: it picks the branch of the
    inverse kinematics, and is the posture that a redundant arm keeps.
    """

    base_distance_m: float
    base_lateral_m: float
    base_height_m: float
    base_yaw_rad: float
    home_rad: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class ArmModel:
    """A serial arm of n joints, base to flange, without tool.

    Attributes
    ----------
    name : as a scenario gives it, one of :data:`dualbend.arm.catalog.ArmName`
    joint_names : what the data calls the joints (n,); in the scene they are joint1 ... joint<n>
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
    urdf : the file that the arm is made from; None: the package's own MJCF
    """

    name: ArmName
    joint_names: tuple[str, ...]
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
    urdf: UrdfFile | None = None

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints in the scene, base to flange."""
        return scene_joints(self.count)

    def spec(self, *, looks: bool = True) -> mujoco.MjSpec:
        """Return a fresh specification without actuators or tool; without meshes if no looks.

        The frame of ``base`` is the arm's own, z up; gravity compensation reaches the joints only
        in a model with at least one actuator.
        """
        return load_puma() if self.urdf is None else self.urdf.read(looks=looks).spec


def scene_joints(count: int) -> tuple[str, ...]:
    """Return the names that the joints of an arm have in the scene."""
    return tuple(f"joint{i + 1}" for i in range(count))


@functools.cache
def arm_model(name: ArmName) -> ArmModel:
    """Return the arm of a name: what its URDF holds, the rest from the facts beside it.

    Raises InputError where the package with the arm's files is missing, or a file cannot be read.
    """
    if name == PUMA:
        return _puma()
    share, facts = package_folder(PACKAGE), URDF_ARMS[name]
    urdf = UrdfFile(file=share / "robots" / facts.file, share=share, facts=facts)
    arm = urdf.read(looks=False)
    joints = _joints(arm.spec.compile())
    assumed = [f"rotor inertia {facts.armature_kg_m2:g} kg m² at every joint (no URDF has it)"]
    if not any((*joints["viscous_n_m_s_per_rad"], *joints["coulomb_n_m"])):
        assumed.append("no friction in the joints (the URDF gives none)")
    if facts.torque_limit_n_m is not None:
        assumed.append("torque limits of the manufacturer (the URDF has another arm's)")
    return ArmModel(
        name=name,
        joint_names=arm.joint_names,
        speed_limit_rad_per_s=arm.speed_limit_rad_per_s,
        stiffness_n_m_per_rad=rule_stiffness(arm.spec),
        payload_kg=facts.payload_kg,
        reach_m=facts.reach_m,
        source=f"{PACKAGE}, {facts.file}, from {facts.upstream}; ratings: {facts.rated}",
        grade=facts.grade,
        assumed=tuple(assumed),
        urdf=urdf,
        **joints,
    )


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
