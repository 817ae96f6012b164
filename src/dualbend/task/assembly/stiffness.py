"""What the arms' control works against: stiffness of the held sheet, of its grips, of the loop."""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from dualbend.beam import elastica
from dualbend.control.clock import steps_per_cycle
from dualbend.control.compliance.object import critical_rate
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import LowPass
from dualbend.control.response import CommandResponse
from dualbend.mechanics.compliance import endpoint_compliance
from dualbend.mechanics.jacobian import site_jacobian
from dualbend.run.cell import RobotCell
from dualbend.run.known_sheet import reading_age_steps
from dualbend.scenario.scenario import Scenario
from dualbend.scene.arm_compliance import ArmCompliance
from dualbend.scene.cell import PAD_SITE
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, bend_joint, twist_joint
from dualbend.task.assembly.program.middle import Yields
from dualbend.types import SIDES, Vector


def object_stiffness(
    cell: RobotCell, q: Vector, alpha_rad: float, pinned_m: tuple[float, float]
) -> Vector:
    """Return the stiffness (3, 3) that both grips moving together feel: x, y [N/m], yaw [N m/rad].

    The sheet is pinned between both of ``pinned_m``, from its middle. Beyond that, each half yields
    by its hinges, its grasp's rubber and its arm's joints, ``C = Σ J k⁻¹ Jᵀ``, at the joint angles
    ``q`` (n,) and in the zero-moment shape; what the end force adds to the sheet's is left out.
    With A_i the motion of grip i per motion of the middle, ``K = Σ A_iᵀ C_i⁻¹ A_i`` (6, 6). Pins
    hold the middle along x and y and against yaw; it may rise and tilt, so K is condensed to those.
    """
    scenario, simulation = cell.scenario, cell.simulation
    model, data = simulation.model, mujoco.MjData(simulation.model)
    length = scenario.sheet.length_m
    arcs = np.linspace(0.0, length, scenario.sheet.model.sections + 1)
    _, _, slopes = elastica.shape(alpha_rad, length, arcs)
    place = np.array([0.0, 0.0, 1.0])
    data.qpos[:] = simulation.positions(q, 0.0, slopes, place)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    grasp, total = scenario.grasp, np.zeros((6, 6))
    rubber = np.repeat(
        [grasp.translational_stiffness_n_per_m, grasp.rotational_stiffness_n_m_per_rad], 3
    )
    ends = zip(SIDES, (LEFT_END, RIGHT_END), (-1.0, 1.0), pinned_m, strict=True)
    for side, end, sign, pinned in ends:
        pad = model.site(f"{side}_{PAD_SITE}").id
        turn = np.kron(np.eye(2), data.site_xmat[pad].reshape(3, 3))
        mine = cell.arms.joints(side)
        dofs = np.array([model.joint(name).dofadr[0] for name in simulation.joints[mine]])
        by_arm = site_jacobian(model, data, pad)[:, dofs]
        hinges = _hinges(model, sign, pinned, cell)
        by_sheet = site_jacobian(model, data, model.site(end).id)[:, model.jnt_dofadr[hinges]]
        compliance = (
            endpoint_compliance(by_arm, cell.servo.stiffness[mine])
            + endpoint_compliance(turn, rubber)
            + endpoint_compliance(
                by_sheet, model.jnt_stiffness[hinges].reshape(len(hinges), -1)[:, 0]
            )
        )
        reach = data.site_xpos[model.site(end).id] - place
        moves = np.eye(6)
        moves[:3, 3:] = np.cross(np.eye(3), reach).T
        total += moves.T @ np.linalg.solve(compliance, moves)
    held, free = [0, 1, 5], [2, 3, 4]
    across = total[np.ix_(free, held)]
    softened = across.T @ np.linalg.solve(total[np.ix_(free, free)], across)
    return np.asarray(total[np.ix_(held, held)] - softened)


def grip_yields(cell: RobotCell, pose: Vector, place: Vector) -> Yields:
    """Return how a grip yields to the bent sheet, at x, z, α (3,) carried to a place (4,).

    Of the left arm; the right one stands alike.
    """
    grasp, integral = cell.scenario.grasp, cell.scenario.robot.servo.integral
    arm = ArmCompliance(cell.arms, cell.servo.stiffness, grasp, integrates=integral is not None)
    arm.move(pose, place)
    return partial(arm.displacement, held_n_m=cell.integral.most_n_m)


def stable_rate(scenario: Scenario) -> float:
    """Return the stiffness over damping [1/s] at which the loop of the held sheet is marginal.

    With the response of the arm whose loop is marginal first.
    """
    step_s, period_s, robot = scenario.step_s, scenario.period_s, scenario.robot
    shared = [
        LowPass(scenario.filter, period_s=period_s).transfer_function(),
        TransportDelay(robot.longest_delay, 1).transfer_function(),
    ]
    steps, age = steps_per_cycle(step_s, period_s), reading_age_steps(scenario) * step_s / period_s
    responses = (
        CommandResponse(robot.response_of(side), 1, steps, period_s=period_s).transfer_function()
        for side in SIDES
    )
    return min(critical_rate([*shared, response], age, period_s) for response in responses)


def _hinges(model: mujoco.MjModel, sign: float, pinned_m: float, cell: RobotCell) -> list[int]:
    """Return the joints between a pinned hole and its end of the sheet, bending and twist."""
    hinges, length = cell.scenario.sheet.model.sections, cell.sheet.length_m
    names = [model.joint(i).name for i in range(model.njnt)]
    found = []
    for i in range(hinges):
        if sign * ((i + 0.5) * length / hinges - 0.5 * length - pinned_m) > 0.0:
            wanted = (bend_joint(i), twist_joint(i))
            found += [names.index(name) for name in wanted if name in names]
    return found
