"""The one loop: every 28 ms observe, sense, comply, solve, send, until motion or robot ends it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.beam import elastica
from dualbend.control.admittance import Admittance
from dualbend.control.alter import (
    COMMAND_PERIOD_S,
    PlanarPathModification,
    TransportDelay,
    steps_per_cycle,
)
from dualbend.control.command_response import CommandResponse
from dualbend.control.controller import ComplianceController
from dualbend.control.filters import LowPass
from dualbend.control.force_torque import Sensor, ToolGravityCompensation, WrenchChain
from dualbend.control.servo import JointServo
from dualbend.errors import InputError
from dualbend.run.guard import (
    JOINT_LABELS,
    Guard,
    ProtectiveStop,
    SimulationFailed,
    refuse_warnings,
)
from dualbend.run.scenario import Outcome, Scenario
from dualbend.run.trace import Trace
from dualbend.scene.arm import JOINT_SPEED_LIMIT_RAD_PER_S
from dualbend.scene.cell import SIDES, compose_cell, robots_only, without_looks
from dualbend.scene.ik import InverseKinematics, Targets, grip_targets
from dualbend.scene.simulation import SensorSample, Simulation, tool_mass_and_centre
from dualbend.task.bending import PHASES, nominal_motion

Vector = NDArray[np.float64]

JOINTS_OF_BOTH = len(JOINT_LABELS)
HOME_GUESS_RAD = np.radians([0.0, 45.0, -180.0, 0.0, 45.0, 0.0] * len(SIDES))
"""Elbow up, forearm down, hand level: the branch of solutions that the cell is laid out for."""

_SNAPPED_SAG_M = -1e-3
_CHECKED_POSES = 40


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run left: how it ended, why, its trace, the compiled model and the time it took."""

    scenario: Scenario
    outcome: Outcome
    reason: str
    trace: Trace
    model: mujoco.MjModel
    bend_stiffness: float
    wall_time_s: float

    @property
    def simulated_s(self) -> float:
        """Time that the physics advanced."""
        return self.trace.rows * COMMAND_PERIOD_S

    @property
    def expected(self) -> bool:
        """The scenario allows this outcome."""
        return self.outcome in self.scenario.expect.outcome


class BendingRun:
    """A scenario made ready: everything that can be refused has been when this exists.

    Raises
    ------
    InputError
        A pose of the nominal path is out of reach, or its joint speeds are above the arm's.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.motion = nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)
        robots = robots_only(scenario.cell).compile()
        self._ik = InverseKinematics(robots)
        self._z_m = scenario.cell.sheet_height_m + self.motion.rise_m
        self._home = self._plan_home()
        self._servo = make_servo(scenario, robots, self._home)
        self.spec = compose_cell(
            scenario.cell,
            scenario.grasp,
            scenario.sheet.sheet(),
            scenario.sheet.strips,
            self._servo,
            scenario.physics.step_s,
        )
        self.model = self.spec.compile()
        physics = without_looks(self.spec).compile()
        latency = scenario.sensor.latency_steps(scenario.physics.step_s)
        self.simulation = Simulation(
            physics, scenario.grasp, scenario.sheet.strips, latency_steps=latency
        )
        self._response = CommandResponse(
            scenario.response, JOINTS_OF_BOTH, steps_per_cycle(scenario.physics.step_s)
        )
        self._controller = make_controller(scenario, physics)

    def _plan_home(self) -> Vector:
        """Walk the nominal path with the IK alone; return the joint angles of its start."""
        home = q = self._reach(0, HOME_GUESS_RAD)
        first = int(np.flatnonzero(self.motion.phase == PHASES.index("bend"))[0])
        cycles = np.linspace(first, self.motion.cycles - 1, _CHECKED_POSES).astype(int)
        before = -1
        for cycle in np.unique(cycles).tolist():
            there = self._reach(cycle, q)
            if before >= 0:
                self._refuse_speed(np.abs(there - q) / ((cycle - before) * COMMAND_PERIOD_S))
            q, before = there, cycle
        return home

    def _reach(self, cycle: int, guess: Vector) -> Vector:
        try:
            return self._ik.solve_from_home(self._nominal_targets(cycle), guess).q
        except InputError as error:
            cell = self.scenario.cell
            raise InputError(
                f"scenario {self.scenario.name!r}: path at {self.motion.alpha_rad[cycle]:.3f} rad: "
                f"{error}; look at cell.base_distance_m = {cell.base_distance_m}, "
                f"cell.base_lateral_m = {cell.base_lateral_m}, "
                f"cell.sheet_height_m = {cell.sheet_height_m}"
            ) from error

    def _refuse_speed(self, speed: Vector) -> None:
        limit = self.scenario.guard.speed_fraction * np.tile(JOINT_SPEED_LIMIT_RAD_PER_S, 2)
        i = int(np.argmax(speed / limit))
        if speed[i] > limit[i]:
            slower = self.scenario.motion.speed_rad_per_s * limit[i] / speed[i]
            raise InputError(
                f"motion.speed_rad_per_s = {self.scenario.motion.speed_rad_per_s}: "
                f"{JOINT_LABELS[i]} would turn at {speed[i]:.2f} rad/s, above {limit[i]:.2f}; "
                f"at most {slower:.2f} rad/s of bending here"
            )

    def _nominal_targets(self, cycle: int) -> Targets:
        pose = (
            -self.motion.half_distance_m[cycle],
            self._z_m[cycle],
            self.motion.alpha_rad[cycle],
        )
        return grip_targets(np.array([pose, pose]))

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunResult:
        """Simulate the motion; call ``on_cycle`` with the number of cycles done."""
        trace = Trace(
            self.motion.cycles,
            list(self._controller.chains),
            self.model.nq,
            self.scenario.sheet.strips.hinges,
        )
        started = time.perf_counter()
        outcome: Outcome = "completed"
        reason = ""
        try:
            self._loop(trace, on_cycle)
        except ProtectiveStop as stop:
            outcome, reason = "protective_stop", str(stop)
        except SimulationFailed as failure:
            outcome, reason = "failed", str(failure)
        except KeyboardInterrupt:
            outcome, reason = "failed", "interrupted by the user"
        if reason and trace.rows:
            reason = f"{reason}, at {trace['time'][-1]:.3f} s"
        return RunResult(
            scenario=self.scenario,
            outcome=outcome,
            reason=reason,
            trace=trace,
            model=self.model,
            bend_stiffness=self.simulation.bend_stiffness,
            wall_time_s=time.perf_counter() - started,
        )

    def scene_xml(self) -> str:
        """Return the composed MJCF, with the start of the run as key frame ``start``."""
        self._start()
        spec, data = self.spec.copy(), self.simulation.data
        spec.add_key(name="start", qpos=data.qpos.copy(), ctrl=data.ctrl.copy())
        spec.compile()
        return str(spec.to_xml())

    def _start(self) -> SensorSample:
        """Put the cell at rest in the first nominal pose."""
        sheet, motion = self.scenario.sheet, self.motion
        arcs = np.linspace(0.0, sheet.length_m, sheet.strips.hinges + 1)
        _, _, slopes = elastica.shape(float(motion.alpha_rad[0]), sheet.length_m, arcs)
        self._response.reset(self._home)
        return self.simulation.reset(
            self._home, sheet.thickness_m / 2, slopes, self.scenario.cell.sheet_height_m
        )

    def _loop(self, trace: Trace, on_cycle: Callable[[int], None] | None) -> None:
        simulation, motion, controller = self.simulation, self.motion, self._controller
        guard = Guard(self.scenario.guard, simulation.joint_range, simulation.torque_limit)
        sample = self._start()
        q = previous = self._home
        for cycle in range(motion.cycles):
            began = time.perf_counter()
            seen = simulation.observe()
            refuse_warnings(simulation.data)
            x, z, alpha = (
                -float(motion.half_distance_m[cycle]),
                float(self._z_m[cycle]),
                float(motion.alpha_rad[cycle]),
            )
            trace.observe(
                cycle * COMMAND_PERIOD_S,
                int(motion.phase[cycle]),
                np.array([alpha, -x, z]),
                seen,
                simulation.data.qpos,
                simulation.bending_angles,
            )
            guard.check(seen.q, seen.speed, seen.torque, self._response.position)
            refuse_snapped(seen.sag, alpha)
            readings = controller.sense(sample.wrench, sample.rotation, seen.grip[:, 3])
            command = controller.command(readings, x, z, alpha)
            solution = self._ik.solve(grip_targets(command.pose), 2.0 * q - previous)
            if not solution.reached:
                miss = 1e3 * solution.position_residual_m
                raise ProtectiveStop(f"commanded pose out of reach: nearest is {miss:.2f} mm off")
            previous, q = q, solution.q
            reference = self._response.update(q)
            sample = simulation.advance(
                self._servo.setpoint(reference.position, reference.velocity, reference.acceleration)
            )
            trace.act(readings, command, solution, time.perf_counter() - began)
            if on_cycle is not None:
                on_cycle(cycle + 1)
        refuse_warnings(simulation.data)


def refuse_snapped(sag_m: float, alpha_rad: float) -> None:
    """Raise SimulationFailed where the sheet's middle has gone to the other side of its ends."""
    if alpha_rad > 0.1 and sag_m < _SNAPPED_SAG_M:
        raise SimulationFailed(
            "the sheet snapped into another buckled shape: "
            f"its middle is {-1e3 * sag_m:.1f} mm above its ends"
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


def make_controller(scenario: Scenario, model: mujoco.MjModel) -> ComplianceController:
    """Return the controller of both arms, each sensor with a noise stream of its own."""
    streams = np.random.SeedSequence(scenario.seed).spawn(len(SIDES))
    chains = {}
    for i, side in enumerate(SIDES):
        if side in scenario.arms.sensing:
            mass, centre = tool_mass_and_centre(model, side)
            chains[i] = WrenchChain(
                Sensor(scenario.sensor, np.random.default_rng(streams[i])),
                ToolGravityCompensation(mass, centre),
                LowPass(scenario.filter),
                np.eye(3),
            )
    return ComplianceController(
        chains=chains,
        admittances={i: Admittance(scenario.compliance) for i in chains},
        complying=[SIDES.index(side) for side in scenario.arms.complying],
        delay=TransportDelay(scenario.alter.delay_cycles, 2 * len(SIDES)),
        modifications=(
            PlanarPathModification(scenario.alter.mode),
            PlanarPathModification(scenario.alter.mode),
        ),
    )
