"""The strips against the rod: end force, end moment and order of convergence.

The sheet hangs here between two ideal grips, a scene of its own: no arms and no pads, and welds so
stiff that they give way by less than 0.2 µm. What is compared are statics at the poses that the
grips impose, so the strips are settled at each point; their damping, which statics do not feel,
is far above the shipped one to make that quick.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.beam import elastica
from dualbend.beam.path import BendingPath, ExactPath, PiecewiseLinearPath
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.scenario.load import load_scenario
from dualbend.scene.ik import grip_targets
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, StripConfig, add_sheet, bend_joint
from dualbend.types import Vector
from dualbend.validation.row import Row, at_least, relative

FIRST_SLOPE_RAD, LAST_SLOPE_RAD = 0.05, 1.0
"""End slopes compared. Below the first, P on the linear piece nears the clamped load 4π² EI/L²:
half the wave length, so four times the strips' error, (2π h/L)²/12 = 0.8 % for 20 hinges."""

INTERVAL_RAD = 0.2
_SETTLING_DAMPING = 0.5
_STEP_S = 2.5e-4
_WELD_TIME_S = 5e-4
_MOVE_S, _SETTLE_S, _FIRST_SETTLE_S = 0.05, 0.15, 0.4


@dataclass(frozen=True, kw_only=True)
class EndLoads:
    """End force P [N] (compression positive) and moment at the left grip [N m], both (n,)."""

    force_n: Vector
    moment_nm: Vector


def default_sheet() -> tuple[Sheet, StripConfig]:
    """Return the shipped experiment's sheet and how it is divided."""
    settings = load_scenario("fig6").sheet
    return settings.sheet(), settings.strips


def ideal_grips(
    sheet: Sheet,
    strips: StripConfig,
    *,
    weight: bool,
    step_s: float = _STEP_S,
    weld_time_s: float = _WELD_TIME_S,
    weld_arm_m: float = 1.0,
) -> mujoco.MjModel:
    """Return the sheet alone, its edges welded to two bodies that are moved at will.

    ``weld_arm_m`` is the length at which the weld weighs a turn against a way: a longer one gives
    way less to torques.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.option.gravity = [0.0, 0.0, -GRAVITY_M_PER_S2 if weight else 0.0]
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


def start_on_elastica(
    model: mujoco.MjModel, sheet: Sheet, hinges: int, alpha: float, half_distance: float
) -> mujoco.MjData:
    """Put the strips on the elastica of this half distance: the branch that is meant."""
    data = mujoco.MjData(model)
    slope = elastica.end_slope_from_half_distance(half_distance, sheet.length_m)
    arcs = np.linspace(0.0, sheet.length_m, hinges + 1)
    _, _, slopes = elastica.shape(slope, sheet.length_m, arcs)
    data.qpos[[model.joint(bend_joint(i)).qposadr[0] for i in range(hinges)]] = np.diff(slopes)
    data.qpos[2] = -elastica.rise(slope, sheet.length_m)
    place_grips(data, alpha, half_distance)
    return data


def settled_loads(
    sheet: Sheet, hinges: int, path: BendingPath, alphas: Vector, *, weight: bool
) -> EndLoads:
    """Return the loads on the left grip at rest at each α of a path (n,)."""
    strips = StripConfig(hinges=hinges, damping_ratio=_SETTLING_DAMPING)
    model = ideal_grips(sheet, strips, weight=weight)
    alpha = float(alphas[0])
    data = start_on_elastica(model, sheet, hinges, alpha, path.at(alpha)[0])
    mujoco.mj_step(model, data, nstep=round(_FIRST_SETTLE_S / _STEP_S))
    loads = []
    for target in alphas.tolist():
        for between in np.linspace(alpha, target, round(_MOVE_S / _STEP_S)).tolist():
            place_grips(data, between, path.at(between)[0])
            mujoco.mj_step(model, data)
        mujoco.mj_step(model, data, nstep=round(_SETTLE_S / _STEP_S))
        mujoco.mj_forward(model, data)
        loads.append(_left_load(model, data))
        alpha = target
    force, moment = np.array(loads).T
    return EndLoads(force_n=force, moment_nm=moment)


def end_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    """Return the Jacobian of both edges (12, nv): left v, ω, then right v, ω, in the world."""
    jacobian = np.zeros((12, model.nv))
    for i, end in enumerate((LEFT_END, RIGHT_END)):
        rows = jacobian[6 * i : 6 * i + 6]
        mujoco.mj_jacSite(model, data, rows[:3], rows[3:], model.site(end).id)
    return jacobian


def _left_load(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[float, float]:
    """Find the two end wrenches w in Jᵀ w = τ: all that the constraints do, they do at the ends."""
    wrench, *_ = np.linalg.lstsq(end_jacobian(model, data).T, data.qfrc_constraint, rcond=None)
    return float(wrench[0]), -float(wrench[4])


def oracle_loads(sheet: Sheet, path: BendingPath, alphas: Vector, *, weight: bool) -> EndLoads:
    """Return the same loads of the rod that cannot stretch, as the strips cannot; NaN unsolved."""
    q = sheet.weight_per_length_n_per_m if weight else 0.0
    points = [(alpha, path.at(alpha)[0]) for alpha in alphas.tolist()]
    states = rod.follow_symmetric(sheet.bending_stiffness_nm2, sheet.length_m, points, q)
    loads = [(s.end_force_n, s.end_moment_nm) if s.converged else (np.nan, np.nan) for s in states]
    force, moment = np.array(loads).T
    return EndLoads(force_n=force, moment_nm=moment)


def first_peak_moment(sheet: Sheet) -> float:
    """Return the largest |M| on the first 0.2 rad piece [N m], by the oracle without weight."""
    path = PiecewiseLinearPath.from_interval(sheet.length_m, INTERVAL_RAD, INTERVAL_RAD)
    alphas = np.linspace(0.1, 0.9, 41) * INTERVAL_RAD
    return float(np.max(np.abs(oracle_loads(sheet, path, alphas, weight=False).moment_nm)))


def load_rows(points: int = 20) -> Iterator[Row]:
    """Compare force and moment with the oracle on two paths, with and without weight.

    The force's error is relative to the oracle's P or the Euler load, whichever is larger, because
    with weight P passes through zero; the moment's to the first peak of the 0.2 rad path. Each row
    is the worst of the points.
    """
    sheet, strips = default_sheet()
    length, peak = sheet.length_m, first_peak_moment(sheet)
    paths: tuple[tuple[str, BendingPath], ...] = (
        ("0.2 rad path", PiecewiseLinearPath.from_interval(length, LAST_SLOPE_RAD, INTERVAL_RAD)),
        ("exact path", ExactPath(length, LAST_SLOPE_RAD)),
    )
    alphas = np.linspace(FIRST_SLOPE_RAD, LAST_SLOPE_RAD, points)
    for path_name, path in paths:
        for weight, load in ((False, "no weight"), (True, "with weight")):
            found = settled_loads(sheet, strips.hinges, path, alphas, weight=weight)
            wanted = oracle_loads(sheet, path, alphas, weight=weight)
            where = f"{path_name}, {load}, from {FIRST_SLOPE_RAD:g} rad"
            scale = np.maximum(np.abs(wanted.force_n), sheet.euler_load_n)
            i = _worst((found.force_n - wanted.force_n) / scale)
            yield relative(
                f"sheet force, {where}",
                found.force_n[i],
                wanted.force_n[i],
                "N",
                0.005,
                scale[i],
            )
            i = _worst(found.moment_nm - wanted.moment_nm)
            yield relative(
                f"sheet moment / first peak, {where}",
                found.moment_nm[i],
                wanted.moment_nm[i],
                "N m",
                0.01,
                peak,
            )


def _worst(error: Vector) -> int:
    """Return where |error| is largest; a NaN counts as larger than anything."""
    return int(np.argmax(np.where(np.isnan(error), np.inf, np.abs(error))))


def convergence_order(hinges: Sequence[int] = (10, 20, 40), points: int = 4) -> float:
    """Return the order p of ΔP ~ N⁻ᵖ on the exact path without weight, by a fit over N.

    ΔP is the root mean square over end slopes from 0.4 to 1 rad of the difference from the oracle.
    """
    sheet, _ = default_sheet()
    path = ExactPath(sheet.length_m, LAST_SLOPE_RAD)
    alphas = np.linspace(0.4, LAST_SLOPE_RAD, points)
    wanted = oracle_loads(sheet, path, alphas, weight=False).force_n
    errors = [
        np.sqrt(
            np.mean((settled_loads(sheet, n, path, alphas, weight=False).force_n - wanted) ** 2)
        )
        for n in hinges
    ]
    return -float(np.polyfit(np.log(hinges), np.log(errors), 1)[0])


def order_row() -> Row:
    """Return the observed order of convergence in N: 2 by design, at least 1.8 is asked for."""
    return at_least("sheet force, order of convergence in N", convergence_order(), 1.8, "1")
