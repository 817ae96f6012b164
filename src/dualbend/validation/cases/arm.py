"""The arm against its published table, and the wrist's wrench chain against a known weight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from dualbend.arm import mjcf as arm
from dualbend.arm.model import ArmModel
from dualbend.arm.pair import paper_pair
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.filters import LowPass, NoFilterConfig
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.scene.cell import robots_only
from dualbend.scene.observation import tool_mass_and_centre
from dualbend.types import Vector
from dualbend.validation import dh
from dualbend.validation.lagrange import SerialArm
from dualbend.validation.row import Row, absolute, of_property

_SEED = 20
_SIDE = "left"

PAYLOAD_KG = 0.4
PAYLOAD_GRIP_M = (0.03, 0.02, -0.04)
"""The known weight and where it is in the grip frame; as much as both sheets weigh, and more."""

_HOLD_STEP_S, _HOLD_S, _HOLD_DAMPING_S = 1e-3, 2.0, 0.02


def random_configurations(count: int) -> Vector:
    """Return seeded joint angles within the published ranges (count, 6) [rad]."""
    ranges = np.array([row.range_rad for row in dh.PUMA560])
    return np.random.default_rng(_SEED).uniform(ranges[:, 0], ranges[:, 1], (count, len(ranges)))


def table_rows(configurations: int = 30) -> Iterator[Row]:
    """Compare flange pose, gravity torques and mass matrix with the table's equations."""
    model, armature = arm.load_puma().compile(), [row.armature_kg_m2 for row in dh.PUMA560]
    angles = random_configurations(configurations)
    name = "arm {}, rel. difference from the DH table"
    for row in difference_rows(name, model, dh.puma(), armature, angles, 1e-6):
        yield of_property(row)


def difference_rows(
    name: str,
    model: mujoco.MjModel,
    reference: SerialArm,
    armature_kg_m2: Sequence[float],
    angles: Vector,
    limit: float,
) -> Iterator[Row]:
    """Compare three quantities, filled into the name, of model and equations over angles (k, n).

    The worst relative difference: its largest |entry| over the largest |entry| of the equations'.
    """
    data, inertia = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    worst = np.zeros(3)
    for q in angles:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia)
        flange = data.site(arm.FLANGE_SITE)
        pose = np.column_stack([flange.xmat.reshape(3, 3), flange.xpos])
        pairs: tuple[tuple[Vector, Vector], ...] = (
            (pose, reference.flange_pose(q)[:3]),
            (data.qfrc_bias, reference.gravity_torque(q)),
            (inertia, reference.mass_matrix(q) + np.diag(armature_kg_m2)),
        )
        worst = np.maximum(worst, [np.abs(a - b).max() / np.abs(b).max() for a, b in pairs])
    for what, found in zip(("flange pose", "gravity torque", "mass matrix"), worst, strict=True):
        yield absolute(name.format(what), found, 0.0, "1", limit)


def held_weight_errors(sensor: ForceTorqueConfig, poses: int = 10) -> tuple[float, float]:
    """Return the worst error of force [N] and moment [N m] at the grip for a known held weight.

    The weight is fixed to the hand, the arm holds each pose by stiff servos and comes to rest; what
    MuJoCo's sensor at the wrist reads then goes through the chain. Expected in the grip frame:
    F = m g R_WGᵀ (0, 0, −1) and M = c × F.
    """
    arms = paper_pair()
    spec = robots_only(arms)
    chain = WrenchChain(
        Sensor(sensor, np.random.default_rng(_SEED)),
        ToolGravityCompensation(*tool_mass_and_centre(spec.copy().compile(), _SIDE)),
        LowPass(NoFilterConfig(), period_s=COMMAND_PERIOD_S),
        np.eye(3),
    )
    centre = np.array(PAYLOAD_GRIP_M)
    load = spec.body(f"{_SIDE}_hand").add_body(name="load", explicitinertial=True)
    load.mass, load.inertia = PAYLOAD_KG, [1e-4, 1e-4, 1e-4]
    load.ipos = spec.site(f"{_SIDE}_{arm.GRIP_SITE}").pos + centre
    _hold_by_servos(spec, arms.left.model)
    model = spec.compile()
    data, joints = mujoco.MjData(model), arms.left.model.count
    errors = []
    for q in random_configurations(poses):
        mujoco.mj_resetData(model, data)
        data.qpos[:joints] = data.ctrl[:joints] = q
        mujoco.mj_step(model, data, nstep=round(_HOLD_S / _HOLD_STEP_S))
        mujoco.mj_forward(model, data)
        # The sensor tells what the arm exerts on the tool; the chain wants its opposite.
        wrench = np.concatenate([-data.sensor(f"{_SIDE}_{name}").data for name in arm.FT_SENSORS])
        rotation = data.site(f"{_SIDE}_{arm.FT_SITE}").xmat.reshape(3, 3)
        sample = chain.update(wrench, rotation)
        upward = data.site(f"{_SIDE}_{arm.GRIP_SITE}").xmat.reshape(3, 3)[2]
        weight = -PAYLOAD_KG * GRAVITY_M_PER_S2 * upward
        wanted = weight, np.cross(centre, weight)
        found = sample.raw.force_n, sample.raw.torque_nm
        errors.append([np.linalg.norm(a - b) for a, b in zip(found, wanted, strict=True)])
    worst_force, worst_torque = np.max(errors, axis=0)
    return float(worst_force), float(worst_torque)


def _hold_by_servos(spec: mujoco.MjSpec, model: ArmModel) -> None:
    spec.option.timestep = _HOLD_STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Random poses may put links into each other, which is not what is measured.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    for joint, stiffness in zip(model.joints, model.stiffness_n_m_per_rad, strict=True):
        name = f"{_SIDE}_{joint}"
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=stiffness, kv=_HOLD_DAMPING_S * stiffness)


def held_weight_rows(poses: int = 10) -> Iterator[Row]:
    """Check the wrench at the grip for a known weight in ten poses, exact sensor.

    The sensor's default resolution alone (0.05 N, 0.003 N m) would add up to 0.025 N and
    0.0045 N m at the grip per axis: more than the tolerance, and nothing that the chain could help.
    """
    exact = ForceTorqueConfig(
        force_noise_n=0.0, torque_noise_nm=0.0, force_resolution_n=0.0, torque_resolution_nm=0.0
    )
    force, torque = held_weight_errors(exact, poses)
    yield absolute("grip force error, held weight, exact sensor", force, 0.0, "N", 0.02)
    yield absolute("grip moment error, held weight, exact sensor", torque, 0.0, "N m", 0.002)
