"""What is found in an arm's file, and what the arm does on its own servo: before it has a cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec
import mujoco
import numpy as np

from dualbend.arm.mjcf import FLANGE_SITE, with_gripper
from dualbend.arm.model import ArmModel
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.run.arms import side_arm
from dualbend.scenario.load import load_scenario
from dualbend.table import Column, Table, quantity
from dualbend.types import Vector

_STEP, _STEP_S, _WATCHED_S = 1e-3, 2.5e-4, 0.5
"""A step of 1 mrad, or 1 mm of a slide, watched for half a second."""

DOWN: Final = np.array([0.0, 0.0, -1.0])
"""Where the weights of an upright arm go."""

_HALF_WAY = 1.678
"""ω t at which 1 − (1 + ω t) e^(−ω t), the answer of critical damping to a step, is a half."""


class JointFound(msgspec.Struct, frozen=True, kw_only=True):
    """A joint as it will be simulated; of a slide in m, N, m/s and kg.

    ``frequency_hz`` and ``overshoot`` are of a small step on its servo, in the middle of the
    ranges, the other joints held; ``expected_hz`` is √(k / M) / 2π.
    """

    name: str
    kind: str
    range: tuple[float, float]
    speed_limit: float
    torque_limit: float
    rotor: float
    stiffness: float
    weight_torque: float
    link_kg: float
    frequency_hz: float
    expected_hz: float
    overshoot: float


class ArmFound(msgspec.Struct, frozen=True, kw_only=True):
    """An arm as a scenario would have it, before it has a place.

    ``weight_torque`` of each joint is the largest that the arm's own weight asks for, over 1000
    seeded configurations; ``flange_m`` the flange's place over the base in the middle of the
    ranges.
    """

    name: str
    file: str
    base: str
    flange: str
    flange_rpy_rad: tuple[float, ...]
    flange_m: tuple[float, ...]
    mass_kg: float
    reach_m: float
    payload_kg: float
    source: str
    grade: str
    assumed: tuple[str, ...]
    joints: tuple[JointFound, ...]


def model_of(name: str, settings: Sequence[str] = ()) -> tuple[ArmModel, Vector]:
    """Return an arm by its name or file, and where down is in its base frame (3,).

    ``settings``: ``robot.arm...`` of what the file does not say, ``cell.base_pitch_rad`` and
    ``cell.base_roll_rad`` of how it is mounted.
    """
    scenario = load_scenario("exact", (f'robot.model="{name}"', *settings))
    cell, turn = scenario.cell, np.empty(4)
    mujoco.mju_euler2Quat(
        turn, np.array([cell.base_pitch_rad or 0.0, cell.base_roll_rad or 0.0, 0.0]), "yxz"
    )
    mujoco.mju_negQuat(turn, turn)
    down = np.empty(3)
    mujoco.mju_rotVecQuat(down, np.array([0.0, 0.0, -1.0]), turn)
    return side_arm(scenario, "left"), down


def look_at(arm: ArmModel, down: Vector = DOWN) -> ArmFound:
    """Measure an arm by itself: weights, limits, a step on each joint's servo. Takes seconds."""
    model = with_gripper(arm.spec(looks=False)).compile()
    bare = arm.spec(looks=False).compile()
    bare.opt.gravity[:] = GRAVITY_M_PER_S2 * down
    middle = middle_of(arm)
    weights = _weights(bare)
    data = mujoco.MjData(bare)
    data.qpos[:] = middle
    mujoco.mj_kinematics(bare, data)
    joints = []
    for i, name in enumerate(arm.joint_names):
        frequency, expected, overshoot = _step(arm, model, i, middle)
        joints.append(
            JointFound(
                name=name,
                kind="slide" if arm.slides[i] else "hinge",
                range=arm.range_rad[i],
                speed_limit=arm.speed_limit_rad_per_s[i],
                torque_limit=arm.torque_limit_n_m[i],
                rotor=arm.armature_kg_m2[i],
                stiffness=arm.stiffness_n_m_per_rad[i],
                weight_torque=float(weights[i]),
                link_kg=float(bare.body(f"link{i + 1}").mass[0]),
                frequency_hz=frequency,
                expected_hz=expected,
                overshoot=overshoot,
            )
        )
    facts = None if arm.file is None else arm.file.facts
    return ArmFound(
        name=arm.name,
        file=arm.fingerprint,
        base="base" if facts is None else str(facts.base),
        flange=FLANGE_SITE if facts is None else str(facts.flange),
        flange_rpy_rad=() if facts is None else facts.flange_rpy_rad or (),
        flange_m=tuple(data.site(FLANGE_SITE).xpos.tolist()),
        mass_kg=float(bare.body_mass.sum()),
        reach_m=arm.reach_m,
        payload_kg=arm.payload_kg,
        source=arm.source,
        grade=arm.grade,
        assumed=arm.assumed,
        joints=tuple(joints),
    )


def middle_of(arm: ArmModel) -> Vector:
    """Return the middle of the joints' ranges (n,)."""
    return np.asarray(np.mean(arm.range_rad, axis=1))


def _weights(model: mujoco.MjModel) -> Vector:
    """Return the largest torques (n,) that the arm's own weight asks for."""
    data, largest = mujoco.MjData(model), np.zeros(model.nv)
    low, high = model.jnt_range.T
    for q in np.random.default_rng(0).uniform(low, high, (1000, model.nv)):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        largest = np.maximum(largest, np.abs(data.qfrc_bias))
    return largest


def _step(
    arm: ArmModel, model: mujoco.MjModel, joint: int, q: Vector
) -> tuple[float, float, float]:
    """Step one joint's servo, critically damped; return frequency, √(k/M)/2π [Hz], overshoot."""
    spec = with_gripper(arm.spec(looks=False))
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    stiffness = np.array(arm.stiffness_n_m_per_rad)
    damping = 2.0 * np.sqrt(stiffness * np.diag(mass)) - arm.viscous_n_m_s_per_rad
    for i, name in enumerate(arm.joints):
        drive = spec.add_actuator(target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0] = stiffness[i]
        drive.biasprm[1:3] = [-stiffness[i], -max(float(damping[i]), 0.0)]
    spec.option.timestep = _STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    own = spec.compile()
    own.dof_frictionloss[:] = 0.0
    # What touches in the middle of the ranges is no matter of the servo.
    own.geom_contype[:] = own.geom_conaffinity[:] = 0
    data = mujoco.MjData(own)
    data.qpos[:] = data.ctrl[:] = q
    data.ctrl[joint] += _STEP
    moved = np.empty(round(_WATCHED_S / _STEP_S))
    for i in range(len(moved)):
        mujoco.mj_step(own, data)
        moved[i] = (data.qpos[joint] - q[joint]) / _STEP
    half = int(np.argmax(moved >= 0.5))
    below = moved[half - 1] if half else 0.0
    time_s = _STEP_S * (half + (0.5 - below) / (moved[half] - below))
    expected = float(np.sqrt(stiffness[joint] / mass[joint, joint])) / (2.0 * np.pi)
    frequency = _HALF_WAY / (2.0 * np.pi * time_s)
    return float(frequency), expected, max(float(moved.max()) - 1.0, 0.0)


def found_text(found: ArmFound) -> str:
    """Return what was found, for people."""
    columns: list[Column | str] = [
        *("joint", "kind", "range"),
        *(quantity(name) for name in ("speed", "torque", "weight", "rotor", "stiffness")),
        *(quantity("link", "kg"), quantity("step", "Hz"), quantity("sqrt(k/M)", "Hz")),
        quantity("overshoot", "%"),
    ]
    rows: list[tuple[object, ...]] = []
    for joint in found.joints:
        slide = joint.kind == "slide"
        angle, force, inertia = ("m", "N", "kg") if slide else ("rad", "N m", "kg m²")
        rows.append(
            (
                *(joint.name, joint.kind, f"{joint.range[0]:.4g} to {joint.range[1]:.4g} {angle}"),
                *(f"{joint.speed_limit:.3g} {angle}/s", f"{joint.torque_limit:.4g} {force}"),
                *(f"{joint.weight_torque:.3g} {force}", f"{joint.rotor:.3g} {inertia}"),
                *(f"{joint.stiffness:.3g} {force}/{angle}", float(f"{joint.link_kg:.3g}")),
                *(float(f"{joint.frequency_hz:.3g}"), float(f"{joint.expected_hz:.3g}")),
                float(f"{100 * joint.overshoot:.2g}"),
            )
        )
    weak = [joint.name for joint in found.joints if joint.weight_torque > joint.torque_limit]
    turn = ", ".join(f"{angle:.4g}" for angle in found.flange_rpy_rad)
    place = ", ".join(f"{value:.3f}" for value in found.flange_m)
    lines = [
        f"{found.name}: {len(found.joints)} joints from {found.base!r} to {found.flange!r}",
        f"  file      {found.file or found.source}",
        f"  flange    z outward after roll, pitch, yaw {turn or '0, 0, 0'} of {found.flange!r}; "
        f"at {place} m in the middle of the ranges",
        f"  moves     {found.mass_kg:.4g} kg; reach {found.reach_m:.3g} m; "
        f"payload {found.payload_kg:.3g} kg",
        *(f"  assumed   {text}" for text in found.assumed),
        *(f"  weak      {name} cannot hold the arm's own weight everywhere" for name in weak),
    ]
    return "\n".join(lines) + "\n\n" + Table(columns, rows).text()
