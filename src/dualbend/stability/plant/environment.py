"""What the admittance loop feels of the bent sheet: its tangent, softened by arms and grasps.

The six coordinates are x, z [m], α [rad] of the left and then of the right grip, each in its own
bending frame; a stiffness K says that the wrench on the arms changes by −K times their change.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from dualbend.beam import elastica
from dualbend.control.compliance.admittance import AdmittanceAxis
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.errors import InputError
from dualbend.mechanics.series import in_series
from dualbend.run.known_sheet import make_admittance, zero_moment
from dualbend.scenario.scenario import Scenario
from dualbend.stability.plant.arm import Joints, YieldingArm
from dualbend.stability.plant.coupling import Coupling, ModeName
from dualbend.stability.plant.equilibrium import Equilibrium, rest, sheet_mass, sheet_tangent
from dualbend.stability.plant.pose import PosedArm
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class Environment:
    """The stiffness matrices at one bending angle.

    ``sheet`` (6, 6): the oracle's tangent with weight; ``series`` (6, 6): the same between
    commanded positions, with arms and grasps in series; ``compliance`` (3, 3): what one arm and its
    grasp give way per wrench. ``loops``: for each way in which the complying arms can move, the
    (2, 2) matrix of force x and moment read against δx and δα; ``rigid_loops`` the same with
    rigid arms and grasps. ``moved`` (6,): how far the grips at rest are from the path;
    ``inertia`` (2, 2): of the tool, as the sensing arm reads it when it moves itself.
    ``settled``: False where no such rest was found and the path's own poses were taken.
    """

    alpha_rad: float
    settled: bool
    moved: Vector
    sheet: Vector
    series: Vector
    compliance: Vector
    inertia: Vector
    loops: dict[ModeName, Vector]
    rigid_loops: dict[ModeName, Vector]
    arms: dict[ModeName, YieldingArm]


def environments(
    scenario: Scenario, alphas_rad: Sequence[float], *, at_rest: bool = True
) -> list[Environment]:
    """Return what the loop meets at bending angles of the path.

    With ``at_rest`` about the equilibrium that the compliance has with the sheet, otherwise about
    the nominal poses; a tared axis sees hardly any load, so nominal poses serve there.

    Raises InputError where the sheet's state is not found or a pose is out of the arms' reach.
    """
    sheet = scenario.sheet.sheet()
    path = scenario.path.make(sheet.length_m)

    def nominal(alpha: float) -> Vector:
        half_distance, rise = path.at(alpha)
        return np.array([-half_distance, scenario.cell.sheet_height_m + rise, alpha])

    with _named(scenario.path.start_rad):
        arm = PosedArm(scenario, nominal(scenario.path.start_rad))
    found: list[Environment] = []
    for alpha in alphas_rad:
        with _named(alpha):
            pose = nominal(float(alpha))
            arm.move(pose)
            found.append(_environment(scenario, arm, pose, at_rest=at_rest))
    return found


@contextmanager
def _named(alpha_rad: float) -> Iterator[None]:
    """Say of an error at which bending angle it is."""
    try:
        yield
    except InputError as error:
        raise InputError(f"path at {alpha_rad:.3f} rad: {error}") from error


def _environment(scenario: Scenario, arm: PosedArm, pose: Vector, *, at_rest: bool) -> Environment:
    """Return what the loop meets where the arm is posed."""
    alpha = float(pose[2])
    coupling = Coupling.of(scenario, alpha)
    sheet = scenario.sheet.sheet()
    both = _on_both(arm.compliance + arm.grasp, arm.compliance + arm.grasp)
    total = coupling.compliance(_static_compliance(scenario, alpha)) + both if at_rest else 0 * both
    nominal = np.array([pose[0], 0.0, alpha] * 2)
    state = _rest(scenario, pose, total)
    tangent = sheet_tangent(state.state)
    # At the small amplitude of an onset dry friction holds an arm that nothing commands.
    gives = [arm.compliance * float(i in coupling.source) + arm.grasp for i in range(2)]
    series = in_series(tangent, _on_both(*gives))
    tool = arm.tool_inertia()
    behind_pads = in_series(tangent, _on_both(arm.grasp, arm.grasp))
    felt = tool * float(coupling.feels_itself)
    return Environment(
        alpha_rad=alpha,
        settled=state.settled,
        moved=state.grips - nominal,
        sheet=tangent,
        series=series,
        compliance=arm.compliance + arm.grasp,
        inertia=coupling.tool(tool),
        loops=coupling.loops(series),
        rigid_loops=coupling.loops(tangent),
        arms=_yielding(arm.joints(), coupling, felt, behind_pads, sheet_mass(sheet, state.state)),
    )


def _yielding(
    joints: Joints, coupling: Coupling, tool: Vector, stiffness: Vector, mass: Vector
) -> dict[ModeName, YieldingArm]:
    """Return the moving arm for each way, from what the grips meet behind their pads (6, 6)."""
    springs, masses = coupling.ways(stiffness), coupling.ways(mass)
    return {
        way: YieldingArm(
            joints=joints,
            sent=coupling.sent,
            load=load,
            carried=masses[way][0],
            read=coupling.read @ read,
            read_mass=coupling.read @ (tool + masses[way][1]),
        )
        for way, (load, read) in springs.items()
    }


def _on_both(left: Vector, right: Vector) -> Vector:
    joined = np.zeros((6, 6))
    joined[:3, :3], joined[3:, 3:] = left, right
    return joined


def _static_compliance(scenario: Scenario, alpha_rad: float) -> Vector:
    """Return δ per steady load (2, 2); 0 where an axis is off, tared or does not act yet."""
    admittance = make_admittance(scenario)
    counts = np.array(
        [
            axis is not None and not scenario.compliance.tare and acts(axis, alpha_rad)
            for axis in (admittance.x, admittance.rotation)
        ]
    )
    if isinstance(admittance, ModelAdmittance):
        return counts[:, np.newaxis] * admittance.rest_compliance(alpha_rad)
    static = [
        axis.static_compliance if axis else 0.0 for axis in (admittance.x, admittance.rotation)
    ]
    return np.diag(counts * np.array(static))


def _rest(scenario: Scenario, pose: Vector, total: Vector) -> Equilibrium:
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
    return rest(sheet, nominal, total)


def acts(axis: AdmittanceAxis, alpha_rad: float) -> bool:
    """Say whether an axis acts at a bending angle."""
    return axis.from_alpha_rad <= alpha_rad
