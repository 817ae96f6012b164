"""What the admittance loop works against: the bent sheet's tangent, softened by arms and grasps.

Coordinates of both grips are those of `dualbend.mechanics.coupling`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from dualbend.arm.mjcf import LEVER_ARM_M
from dualbend.beam import elastica
from dualbend.beam.rod.tangent import sheet_tangent
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.errors import refusing
from dualbend.mechanics.compliance import series_stiffness
from dualbend.mechanics.coupling import Coupling, ModeName, deviation_angle
from dualbend.run.known_sheet import zero_moment
from dualbend.scenario.scenario import Scenario
from dualbend.stability.controller import analysed_controller
from dualbend.stability.plant.arm import CompliantArm, Joints
from dualbend.stability.plant.equilibrium import Equilibrium, find_equilibrium, sheet_mass
from dualbend.stability.plant.pose import PosedArm
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class Environment:
    """What the loop works against at one bending angle.

    ``loops``: for each mode of the complying arms, the (2, 2) matrix of force x and moment read
    against δx and δα, of the sheet with arms and grasps in series; ``rigid_loops`` the same with
    rigid arms and grasps; ``arms``: the moving arm. ``moved`` (6,): how far the grips at rest are
    from the path; ``inertia`` (2, 2): of the tool, as the sensing arm reads it when it moves
    itself. ``settled``: False where no equilibrium was found and the path's poses were taken.
    """

    alpha_rad: float
    settled: bool
    moved: Vector
    inertia: Vector
    loops: dict[ModeName, Vector]
    rigid_loops: dict[ModeName, Vector]
    arms: dict[ModeName, CompliantArm]


def environments(
    scenario: Scenario, alphas_rad: Sequence[float], *, at_rest: bool = True
) -> list[Environment]:
    """Return what the loop works against at bending angles of the path.

    With ``at_rest`` about the equilibrium of admittance, arms and sheet, otherwise about the
    nominal poses; a tared axis sees hardly any load, so nominal poses serve there.

    Raises InputError where the sheet's state is not found or a pose is out of the arms' reach.
    """
    sheet = scenario.sheet.sheet()
    path = scenario.path.make(sheet.length_m)

    def nominal(alpha: float) -> Vector:
        half_distance, rise = path.at(alpha)
        return np.array([-half_distance, scenario.cell.sheet_height_m + rise, alpha])

    start = scenario.path.start_rad
    with refusing(f"path at {start:.3f} rad"):
        arm = PosedArm(scenario, nominal(start))
    found: list[Environment] = []
    for alpha in alphas_rad:
        with refusing(f"path at {alpha:.3f} rad"):
            pose = nominal(float(alpha))
            arm.move(pose)
            found.append(_environment(scenario, arm, pose, at_rest=at_rest))
    return found


def _environment(scenario: Scenario, arm: PosedArm, pose: Vector, *, at_rest: bool) -> Environment:
    """Return what the loop works against where the arm is posed."""
    alpha = float(pose[2])
    coupling = scenario_coupling(scenario, alpha)
    compliance, tool = arm.rest_compliance + arm.grasp, arm.tool_inertia
    total = np.zeros((6, 6))
    if at_rest:
        total = coupling.admittance_compliance(_static_compliance(scenario, alpha))
        total += block_diag(compliance, compliance)
    rest = _equilibrium(scenario, pose, total)
    tangent = sheet_tangent(rest.state)
    series = series_stiffness(tangent, coupling.arm_compliance(arm.compliance, arm.grasp))
    return Environment(
        alpha_rad=alpha,
        settled=rest.settled,
        moved=rest.grips - np.array([pose[0], 0.0, alpha] * 2),
        inertia=coupling.tool(tool),
        loops=coupling.loops(series),
        rigid_loops=coupling.loops(tangent),
        arms=_arms(
            arm.joints(),
            coupling,
            tool * float(coupling.moves_its_sensor),
            series_stiffness(tangent, block_diag(arm.grasp, arm.grasp)),
            sheet_mass(scenario.sheet.sheet(), rest.state),
        ),
    )


def _arms(
    joints: Joints, coupling: Coupling, tool: Vector, stiffness: Vector, mass: Vector
) -> dict[ModeName, CompliantArm]:
    """Return the moving arm of each mode, from what the grips meet behind their pads (6, 6)."""
    masses = coupling.modes(mass)
    return {
        mode: CompliantArm(
            joints=joints,
            deviation_jacobian=coupling.deviation_jacobian,
            stiffness=own,
            mass=masses[mode][0],
            stiffness_read=coupling.reading @ response,
            mass_read=coupling.reading @ (tool + masses[mode][1]),
        )
        for mode, (own, response) in coupling.modes(stiffness).items()
    }


def scenario_coupling(scenario: Scenario, alpha_rad: float) -> Coupling:
    """Return the coupling that ComplianceController makes at one bending angle.

    A lever arm that is believed wrongly mixes forces into the moment.
    """
    error = LEVER_ARM_M - scenario.sensor.lever_arm_m
    c, s = math.cos(alpha_rad), math.sin(alpha_rad)
    reference = scenario.compliance.reference
    # A vertical force that is known is not read: its lever arm's moment is missing.
    known = scenario.sensor.lever_arm_m if reference and reference.known_weight else 0.0
    return Coupling.between(
        scenario.compliance.sensing,
        scenario.compliance.complying,
        deviation_angle(scenario.robot.alter.mode, alpha_rad, scenario.path.start_rad),
        np.array([[1.0, 0.0, 0.0], [-error * s, -(error + known) * c, 1.0]]),
    )


def _static_compliance(scenario: Scenario, alpha_rad: float) -> Vector:
    """Return δ per steady load (2, 2); 0 where an axis is off, tared or does not act yet."""
    admittance = analysed_controller(scenario)
    axes = admittance.axes_at(alpha_rad)
    tared = scenario.compliance.tare
    acts = np.array([not tared and a is not None for a in axes])
    if isinstance(admittance, ModelAdmittance):
        return acts[:, np.newaxis] * admittance.rest_compliance(alpha_rad)
    return np.diag(acts * np.array([a.static_compliance if a else 0.0 for a in axes]))


def _equilibrium(scenario: Scenario, pose: Vector, total: Vector) -> Equilibrium:
    """Return where the compliance comes to rest.

    With a force reference that is the zero-moment state, but for the part k of the error.
    """
    sheet, nominal = scenario.sheet.sheet(), np.array([pose[0], 0.0, pose[2]] * 2)
    if scenario.compliance.reference and scenario.compliance.x and total.any():
        found = zero_moment(sheet, float(pose[2]))
        if found is not None:
            offset, state = found
            x = -elastica.half_distance(float(pose[2]), sheet.length_m) - offset
            return Equilibrium(grips=np.array([x, 0.0, pose[2]] * 2), state=state, settled=True)
    return find_equilibrium(sheet, nominal, total)
