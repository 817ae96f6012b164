"""A scenario's cell made ready to be commanded: inverse kinematics, servos, response, physics."""

from __future__ import annotations

from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.beam import elastica
from dualbend.control.alter import steps_per_cycle
from dualbend.control.command_response import CommandResponse
from dualbend.control.servo import JointServo
from dualbend.run.scenario import Scenario
from dualbend.scene.cell import SIDES, compose_cell, robots_only, without_looks
from dualbend.scene.ik import InverseKinematics, carried_targets, grip_targets
from dualbend.scene.sheet_model import ShellModel
from dualbend.scene.simulation import SensorSample, Simulation

Vector = NDArray[np.float64]

HOME_GUESS_RAD = np.radians([0.0, 45.0, -180.0, 0.0, 45.0, 0.0] * len(SIDES))
"""Elbow up, forearm down, hand level: the branch of solutions that the cell is laid out for."""


class RobotCell:
    """Both arms with the sheet between them, at rest, tracking joint set-points cycle by cycle.

    Parameters
    ----------
    scenario
        Says everything about the cell.
    start
        x, z [m] and end slope α [rad] of both grips in their bending frames, (3,).
    place
        Where the bending frames are carried to at the start, (4,) as
        :func:`dualbend.scene.ik.carried_targets` has it; None: nowhere.

    Raises
    ------
    InputError
        The start is out of reach.
    """

    def __init__(self, scenario: Scenario, start: Vector, place: Vector | None = None) -> None:
        self.scenario, self.start = scenario, start
        robots = robots_only(scenario.cell).compile()
        self.ik = InverseKinematics(robots)
        self.home = self.reach(start, HOME_GUESS_RAD, place)
        self.servo = make_servo(scenario, robots, self.home)
        step_s = scenario.physics.step_s
        strips, task = scenario.sheet.strips, scenario.assembly
        self._shell = scenario.sheet.shell if scenario.sheet.model == "shell" else None
        sheet = scenario.sheet.sheet()
        self.sheet = sheet if task is None else task.errors.true_sheet(sheet)
        self.spec = compose_cell(
            scenario.cell,
            scenario.grasp,
            self.sheet,
            strips,
            self.servo,
            step_s,
            None if task is None else task.true_layout(),
            0 if task is None else task.sheets - 1,
            self._shell,
        )
        model = without_looks(self.spec).compile()
        self.simulation = Simulation(
            model,
            scenario.grasp,
            strips if self._shell is None else ShellModel(model, self.sheet, self._shell),
            latency_steps=scenario.sensor.latency_steps(step_s),
        )
        self.response = CommandResponse(scenario.response, len(self.home), steps_per_cycle(step_s))

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The model with its looks, for pictures; the same joints as the simulated one."""
        return self.spec.compile()

    def reach(self, pose: Vector, guess: Vector, place: Vector | None = None) -> Vector:
        """Return the joint angles (12,) for both grips at (x, z, α); InputError where none are."""
        both = np.array([pose, pose])
        targets = grip_targets(both) if place is None else carried_targets(both, place)
        return self.ik.solve_from_home(targets, guess).q

    def reset(self) -> SensorSample:
        """Put the cell at rest in its start, the sheet in its zero-moment shape."""
        sheet = self.scenario.sheet
        arcs = np.linspace(0.0, sheet.length_m, sheet.sections + 1)
        _, _, slopes = elastica.shape(float(self.start[2]), sheet.length_m, arcs)
        self.response.reset(self.home)
        middle = np.array([0.0, 0.0, self.scenario.cell.sheet_height_m])
        return self.simulation.reset(self.home, sheet.thickness_m / 2, slopes, middle)

    def send(self, q: Vector) -> SensorSample:
        """Run one command cycle towards the joint set-points (12,) [rad]."""
        reference = self.response.update(q)
        return self.simulation.advance(
            self.servo.setpoint(reference.position, reference.velocity, reference.acceleration)
        )


def make_servo(scenario: Scenario, robots: mujoco.MjModel, home: Vector) -> JointServo:
    """Return the servo of all joints, with the inertia that each sees at the home pose."""
    data = mujoco.MjData(robots)
    data.qpos[:] = home
    mujoco.mj_forward(robots, data)
    inertia = np.zeros((robots.nv, robots.nv))
    mujoco.mj_fullM(robots, data, inertia)
    return JointServo(
        stiffness=np.tile(scenario.servo.stiffness_n_m_per_rad, len(SIDES)),
        inertia=np.diag(inertia).copy(),
        viscous_friction=robots.dof_damping.copy().ravel(),
        coulomb_friction=robots.dof_frictionloss.copy().ravel(),
        damping_ratio=scenario.servo.damping_ratio,
    )
