"""Misaligned grips against Kirchhoff's rod: twist between ideal grips, twist and shear in the cell.

Theory is given the poses that the sheet's edges really have: neither pads nor arms enter; only
the flat sheet, whose strips are rigid in their plane, needs the pads in series with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import mujoco
import numpy as np

from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.space import RodStiffness, SpaceGrip, SpaceState, solve_space
from dualbend.beam.sheet import Sheet
from dualbend.mechanics.compliance import endpoint_compliance
from dualbend.run.record import RunRecord
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, StripConfig
from dualbend.task.bending.config import misalignment_of
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Vector
from dualbend.validation.cases.ideal_grips import (
    gripped_strips,
    left_wrench,
    roll_right_grip,
    start_on_elastica,
)
from dualbend.validation.cases.runs import LINEAR
from dualbend.validation.cases.sheet import default_sheet
from dualbend.validation.perfect import perfect_scenario
from dualbend.validation.row import Row, relative, worst

ROLL_RAD, LATERAL_M, YAW_RAD = 0.02, 0.5e-3, 2e-3
"""Errors of the right grip: small angles, and no more than the pads turn a moment of 1 N m into."""

TWIST_TOLERANCE, LATERAL_TOLERANCE = 0.02, 0.02

_DAMPING_RATIO, _STEP_S, _RAMP_S, _REST_S = 0.5, 2.5e-4, 0.05, 0.4
_WELD_ARM_M = 10.0
_HALF_TURN = np.diag([-1.0, -1.0, 1.0])
_FROM_RAD, _POINTS = 0.2, 5


def turn(roll: float, pitch: float, yaw: float) -> Vector:
    """Return R_z(yaw) R_y(pitch) R_x(roll) (3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def reference_state(sheet: Sheet, left: SpaceGrip, right: SpaceGrip, *, weight: bool) -> SpaceState:
    """Return the rod between two grips, started from the plane rod at their shadows in x and z."""
    q = sheet.weight_per_length_n_per_m if weight else 0.0
    EI, L, EA = sheet.bending_stiffness_nm2, sheet.length_m, sheet.axial_stiffness_n
    shadows = _shadow(left, 1.0), _shadow(right, -1.0)
    plane = rod.solve_planar(EI, L, *shadows, q, axial_stiffness_n=EA).left
    guess = np.array([plane.force_x_n, 0.0, plane.force_z_n, 0.0, plane.moment_nm, 0.0])
    return solve_space(RodStiffness.of(sheet, in_plane=False), L, left, right, guess, q)


def _shadow(grip: SpaceGrip, sign: float) -> rod.Grip:
    slope = math.atan2(-grip.axes[2, 0], grip.axes[0, 0])
    return rod.Grip(float(grip.position_m[0]), float(grip.position_m[2]), sign * slope)


def twisted_between_ideal_grips(
    sheet: Sheet, strips: StripConfig, alpha: float, roll_rad: float
) -> tuple[Vector, SpaceGrip, SpaceGrip]:
    """Settle the strips at α on the zero-moment path with the right grip rolled, no weight.

    Returns the wrench (6,) on the left gripper in the world, and both grips.
    """
    model = gripped_strips(sheet, strips, weight=False, step_s=_STEP_S, weld_arm_m=_WELD_ARM_M)
    half = float(elastica.half_distance(alpha, sheet.length_m))
    data = start_on_elastica(model, sheet, strips.hinges, alpha, half)
    roll_right_grip(model, data, roll_rad, round(_RAMP_S / _STEP_S))
    mujoco.mj_step(model, data, nstep=round(_REST_S / _STEP_S))
    mujoco.mj_forward(model, data)
    # Where the edges are: a weld of MuJoCo's yields by a few per cent of such a small torque.
    edges = [data.site(name) for name in (LEFT_END, RIGHT_END)]
    axes = [edge.xmat.reshape(3, 3) for edge in edges]
    left = SpaceGrip(edges[0].xpos.copy(), axes[0].copy())
    right = SpaceGrip(edges[1].xpos.copy(), axes[1] @ _HALF_TURN)
    return left_wrench(model, data), left, right


def twist_rows() -> Iterator[Row]:
    """Compare the torque about the grip's own x_G for a small roll, flat and bent, ideal grips.

    Flat, theory is GJ φ/L; bent, the rod in space, whose twist and bending are coupled.
    """
    sheet, settings = default_sheet()
    strips = StripConfig(hinges=settings.hinges, damping_ratio=_DAMPING_RATIO)
    wrench, _, _ = twisted_between_ideal_grips(sheet, strips, 0.0, ROLL_RAD)
    expected = -sheet.torsional_stiffness_nm2 * ROLL_RAD / sheet.length_m
    yield relative("twist torque, flat, ideal grips", wrench[3], expected, "N m", TWIST_TOLERANCE)
    for alpha in (0.3, 0.6, 1.0):
        wrench, left, right = twisted_between_ideal_grips(sheet, strips, alpha, ROLL_RAD)
        theory = reference_state(sheet, left, right, weight=False)
        loads = [(float(w[3:] @ left.axes[:, 0]), float(w[1])) for w in (wrench, theory.left)]
        names = ("torque", "lateral force")
        for name, found, wanted, unit in zip(names, *loads, ("N m", "N"), strict=True):
            what = f"twist, {name}, bent to {alpha:g} rad, ideal grips"
            yield relative(what, found, wanted, unit, TWIST_TOLERANCE)


def misaligned_run(*settings: str) -> RunRecord:
    """Bend the sheet of ``exact`` on linear pieces, with errors of the right grip."""
    changes = [f"task.misalignment.right.{setting}" for setting in settings]
    return BendingRun(perfect_scenario("exact", [*LINEAR, *changes])).run()


def edge_grips(result: RunRecord, row: int, place: str = "edge") -> tuple[SpaceGrip, SpaceGrip]:
    """Return where the trace says that the sheet's edges are, as the rod's ends in the world."""
    grips = []
    for side, flip in zip(SIDES, (np.eye(3), _HALF_TURN), strict=True):
        x, y, z, alpha, roll, yaw = (
            float(result.trace[f"{side}_{place}_{part}"][row])
            for part in ("x", "y", "z", "alpha", "roll", "yaw")
        )
        pitch = math.atan(math.tan(alpha) * math.cos(yaw))
        # The right arm's bending frame is the world turned by π; its x_G runs against the rod.
        grips.append(SpaceGrip(flip @ [x, y, z], flip @ turn(roll, pitch, yaw) @ flip))
    return grips[0], grips[1]


def true_wrench(result: RunRecord, row: int, side: str = "left") -> Vector:
    """Return the recorded wrench on a gripper (6,), in its bending frame."""
    parts = [f"{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz"]
    return np.array([result.trace[f"{side}_true_{part}"][row] for part in parts])


def bent_rows() -> Iterator[Row]:
    """Compare the loads on the left gripper out of the plane while the sheet is bent in the cell.

    Theory gets the poses of the sheet's edges. Each row is the worst of five bending angles from
    0.2 rad on, relative to the largest of that load among them.
    """
    names = ("lateral force", "moment about x", "moment about z")
    for label, settings in (
        ("rolled 20 mrad", (f"roll_rad={ROLL_RAD}",)),
        ("0.5 mm across", (f"lateral_m={LATERAL_M}",)),
    ):
        result = misaligned_run(*settings)
        sheet = result.scenario.sheet.sheet()
        alpha = result.trace["nominal_alpha"]
        rows = [int(np.argmax(alpha >= a)) for a in np.linspace(_FROM_RAD, alpha[-1], _POINTS)]
        found = np.array([true_wrench(result, row) for row in rows])
        wanted = np.array(
            [reference_state(sheet, *edge_grips(result, row), weight=True).left for row in rows]
        )
        for name, i, unit in zip(names, (1, 3, 5), ("N", "N m", "N m"), strict=True):
            scale = float(np.abs(wanted[:, i]).max())
            what = f"{name}, grip {label}, bent, at the edges' poses"
            yield worst(what, found[:, i], wanted[:, i], unit, LATERAL_TOLERANCE, scale)


def flat_loads(result: RunRecord, row: int) -> Vector:
    """Return lateral force [N] and moment about z [N m] on the right gripper, flat, by theory.

    Both pads are in series; the strips are rigid in the sheet's plane. The grips are where the
    trace says; dry friction in the joints may hold the arms or not.
    """
    errors = misalignment_of(result.scenario)
    assert errors is not None
    left, right = edge_grips(result, row, "grip")
    lateral, yaw = errors.errors()[1, [1, 5]]
    L, grasp = result.scenario.sheet.length_m, result.scenario.grasp
    pad = [grasp.translational_stiffness_n_per_m, grasp.rotational_stiffness_n_m_per_rad]
    turned = [math.atan2(g.axes[1, 0], g.axes[0, 0]) for g in (left, right)]
    across = -lateral + right.position_m[1] - left.position_m[1] - L * turned[0]
    gap = np.array([across, yaw + turned[1] - turned[0]])
    # Of y [m] and yaw [rad] at the right edge.
    compliance = endpoint_compliance([[1.0, 0.0, 1.0, L], [0.0, 1.0, 0.0, 1.0]], [*pad, *pad])
    on_sheet = np.linalg.solve(compliance, gap)
    # On the gripper it is the opposite, and the right bending frame's y is minus the world's.
    return np.array([on_sheet[0], -on_sheet[1]])


def flat_rows() -> Iterator[Row]:
    """Compare lateral force and moment of the flat sheet with the pads in series with the rod."""
    for label, setting in (
        ("0.5 mm across", f"lateral_m={LATERAL_M}"),
        ("yawed 2 mrad", f"yaw_rad={YAW_RAD}"),
    ):
        result = misaligned_run(setting)
        row = int(np.argmax(result.trace["phase"] > 0)) - 1
        found = true_wrench(result, row, "right")[[1, 5]]
        wanted = flat_loads(result, row)
        pairs = zip(("lateral force", "moment about z"), found, wanted, ("N", "N m"), strict=True)
        for name, a, b, unit in pairs:
            yield relative(f"{name}, grip {label}, flat", a, b, unit, LATERAL_TOLERANCE)


def space_rows() -> Iterator[Row]:
    """Check the loads of misaligned grips; takes 15 s."""
    yield from twist_rows()
    yield from bent_rows()
    yield from flat_rows()
