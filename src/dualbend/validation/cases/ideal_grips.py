"""A sheet alone between two ideal grips, which are moved at will: no arms and no pads."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.mechanics.jacobian import site_jacobian
from dualbend.scene.ik import grip_targets
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, StripConfig, add_sheet, bend_joint
from dualbend.types import Vector

STEP_S, WELD_TIME_S = 2.5e-4, 5e-4


def empty_scene(step_s: float, *, weight: bool) -> mujoco.MjSpec:
    """Return a scene in which nothing is yet, stepped as the simulation steps it."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.gravity = [0.0, 0.0, -GRAVITY_M_PER_S2 if weight else 0.0]
    return spec


def gripped_strips(
    sheet: Sheet,
    strips: StripConfig,
    *,
    weight: bool,
    step_s: float = STEP_S,
    weld_time_s: float = WELD_TIME_S,
    weld_arm_m: float = 1.0,
) -> mujoco.MjModel:
    """Return the sheet alone, its edges welded to two bodies that are moved at will.

    ``weld_arm_m`` is the length by which the weld weighs a turn against a displacement: with a
    longer one it yields less to torques.
    """
    spec = empty_scene(step_s, weight=weight)
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    add_sheet(spec, sheet, strips, np.zeros(3))
    add_ideal_grips(spec, weld_time_s, weld_arm_m)
    return spec.compile()


def add_ideal_grips(spec: mujoco.MjSpec, weld_time_s: float, weld_arm_m: float) -> None:
    """Weld both edges to bodies that are moved at will."""
    for name, end in (("left", LEFT_END), ("right", RIGHT_END)):
        grip = spec.worldbody.add_body(name=name, mocap=True)
        grip.add_site(name=f"{name}_grip")
        hold = spec.add_equality(
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"{name}_grip",
            name2=end,
            solref=[weld_time_s, 1.0],
            solimp=[0.9999, 0.9999, 0.001, 0.5, 2.0],
        )
        hold.data[10] = weld_arm_m


def place_grips(data: mujoco.MjData, alpha: float, half_distance: float) -> None:
    """Impose an end slope [rad] and a half distance [m] on both grips."""
    pose = np.array([[-half_distance, 0.0, alpha]] * 2)
    for i, target in enumerate(grip_targets(pose)):
        data.mocap_quat[i], data.mocap_pos[i] = np.split(target.wxyz_xyz, [4])


def roll_right_grip(
    model: mujoco.MjModel, data: mujoco.MjData, roll_rad: float, steps: int
) -> None:
    """Roll the right grip about its x_G in equal parts, one a physics step."""
    nominal = data.mocap_quat[1].copy()
    for i in range(steps):
        half = 0.5 * roll_rad * (i + 1) / steps
        rolled = np.array([math.cos(half), math.sin(half), 0.0, 0.0])
        mujoco.mju_mulQuat(data.mocap_quat[1], nominal, rolled)
        mujoco.mj_step(model, data)


def elastica_slopes(sheet: Sheet, half_distance: float, parts: int) -> tuple[Vector, float]:
    """Return slopes (parts + 1,) [rad] and rise [m] of the elastica of a half distance."""
    slope = float(elastica.end_slope_from_half_distance(half_distance, sheet.length_m))
    arcs = np.linspace(0.0, sheet.length_m, parts + 1)
    _, _, slopes = elastica.shape(slope, sheet.length_m, arcs)
    return np.asarray(slopes), float(elastica.rise(slope, sheet.length_m))


def start_on_elastica(
    model: mujoco.MjModel, sheet: Sheet, hinges: int, alpha: float, half_distance: float
) -> mujoco.MjData:
    """Put the strips on the elastica of this half distance: the branch that is meant."""
    data = mujoco.MjData(model)
    slopes, rise = elastica_slopes(sheet, half_distance, hinges)
    data.qpos[[model.joint(bend_joint(i)).qposadr[0] for i in range(hinges)]] = np.diff(slopes)
    data.qpos[2] = -rise
    place_grips(data, alpha, half_distance)
    return data


def end_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    """Return the Jacobian of both edges (12, nv): left v, ω, then right v, ω, in the world."""
    ends = [model.site(name).id for name in (LEFT_END, RIGHT_END)]
    return np.vstack([site_jacobian(model, data, end) for end in ends])


def left_wrench(model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    """Return force [N] and torque [N m] (6,) that the sheet exerts on the left grip, in the world.

    Both end wrenches w solve Jᵀ w = τ: all that the constraints do, they do at the ends.
    """
    wrench, *_ = np.linalg.lstsq(end_jacobian(model, data).T, data.qfrc_constraint, rcond=1e-12)
    # The constraint pushes the sheet; what the sheet exerts on the grip is the opposite.
    return -np.asarray(wrench[:6])
