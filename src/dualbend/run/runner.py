"""The loop: every 28 ms observe, sense, comply, solve, send, until motion or robot ends it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.control.admittance import Compliance
from dualbend.control.alter import COMMAND_PERIOD_S, PlanarPathModification, TransportDelay
from dualbend.control.controller import Command, ComplianceController, Reading
from dualbend.control.filters import LowPass
from dualbend.control.force_torque import Sensor, ToolGravityCompensation, WrenchChain
from dualbend.errors import InputError
from dualbend.run.arm_load import refuse_overload
from dualbend.run.arms import shown_placements, with_placements
from dualbend.run.guard import (
    Guard,
    ProtectiveStop,
    SimulationFailed,
    refuse_warnings,
    warnings_counted_only,
)
from dualbend.run.known_sheet import make_admittance
from dualbend.run.robot_cell import RobotCell
from dualbend.run.scenario import Outcome, Scenario
from dualbend.run.trace import Trace
from dualbend.scene.cell import SIDES
from dualbend.scene.ik import Targets, grip_targets
from dualbend.scene.simulation import Observation, SensorSample, tool_mass_and_centre
from dualbend.task.assembly_motion import TaskStopped
from dualbend.task.bending import PHASES, nominal_motion
from dualbend.task.misalignment import errors_over_time

Vector = NDArray[np.float64]

_SNAPPED_SAG_M, _SNAPPED_FROM_RAD = -1e-3, 0.1
"""A sheet bent this far sags by centimetres: a middle this much above its ends is another shape."""

SPACE_COLUMNS = tuple(
    (f"{side}_{place}_{turn}", "rad")
    for place in ("grip", "edge")
    for side in SIDES
    for turn in ("roll", "yaw")
)
"""What the trace of a misaligned run has beside a plane one's columns."""

_CHECKED_POSES = 40
"""Poses of the path that are solved before the run: one in 25 mrad on the shipped ones."""


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run left: how it ended, why, its trace, the model with its looks, the time it took.

    ``controller``: name of the compliance that took the place of the scenario's own, if one did.
    ``laid``: of each sheet of an assembly, (4, 3) as its holes lie over their pins [m].
    """

    scenario: Scenario
    outcome: Outcome
    reason: str
    phases: tuple[str, ...]
    trace: Trace
    model: mujoco.MjModel
    bend_stiffness: float
    simulated_s: float
    wall_time_s: float
    controller: str = ""
    laid: tuple[Vector, ...] = ()

    @property
    def expected(self) -> bool:
        """The scenario allows this outcome."""
        return self.outcome in self.scenario.expect.outcome


class Run:
    """A scenario made ready: everything that can be refused has been when this exists.

    One run's loop is that of a subclass; what surrounds it is here.
    """

    phases: tuple[str, ...]
    trace: Trace
    foreseen: Vector
    """Joint angles (k, n) of the poses that were tried before the run."""
    task_columns: tuple[tuple[str, str], ...] = ()
    compliance: Callable[[Scenario], Compliance] = staticmethod(make_admittance)

    def __init__(self, scenario: Scenario, cell: RobotCell) -> None:
        self.scenario, self.cell = scenario, cell
        self.laid: list[Vector] = []

    @property
    def cycles(self) -> int:
        """Number of command cycles, at most."""
        raise NotImplementedError

    def start(self) -> SensorSample:
        """Put the cell where the run begins."""
        raise NotImplementedError

    def _loop(self, controller: ComplianceController, cycle: Cycle) -> None:
        """Run to the end, one :meth:`Cycle.observe` and :meth:`Cycle.send` after the other."""
        raise NotImplementedError

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunResult:
        """Simulate the motion; call ``on_cycle`` with the number of cycles done.

        ``self.trace`` is the run's trace from its start on.
        """
        # Anew for each run: filters, delays and noise streams have a memory.
        simulation = self.cell.simulation
        controller = make_controller(self.scenario, simulation.model, self.compliance)
        trace = Trace(
            self.cycles,
            list(controller.chains),
            simulation.model.nq,
            self.scenario.sheet.sections,
            simulation.joints,
            self.task_columns,
        )
        self.trace = trace
        guard = Guard(
            self.scenario.guard,
            simulation.joints,
            simulation.joint_range,
            simulation.torque_limit,
            self.cell.arms.speed_limit,
        )
        cycle = Cycle(self.cell, guard, trace, on_cycle)
        started = time.perf_counter()
        outcome: Outcome = "completed"
        reason = ""
        try:
            with warnings_counted_only():
                cycle.sample = self.start()
                self._loop(controller, cycle)
                refuse_warnings(simulation.data)
        except ProtectiveStop as stop:
            outcome, reason = "protective_stop", str(stop)
        except TaskStopped as stop:
            outcome, reason = "aborted", str(stop)
        except SimulationFailed as failure:
            outcome, reason = "failed", str(failure)
        except KeyboardInterrupt:
            outcome, reason = "failed", "interrupted by the user"
        wall_time_s = time.perf_counter() - started
        if reason:
            reason = f"{reason}, at {simulation.data.time:.3f} s"
        return RunResult(
            scenario=self.scenario,
            outcome=outcome,
            reason=reason,
            phases=self.phases,
            trace=trace,
            model=self.cell.model,
            bend_stiffness=simulation.bend_stiffness,
            simulated_s=float(simulation.data.time),
            wall_time_s=wall_time_s,
            controller="" if self.compliance is make_admittance else _name_of(self.compliance),
            laid=tuple(self.laid),
        )

    def scene_xml(self) -> str:
        """Return the composed MJCF, with the start of the run as key frame ``start``.

        Raises
        ------
        InputError
            The sheet is a shell, whose elasticity no MJCF can hold.
        """
        if self.scenario.sheet.model == "shell":
            raise InputError(
                'sheet.model = "shell": its elasticity is written after compilation, no MJCF file '
                'can hold it; export "strips"'
            )
        self.start()
        spec, data = self.cell.spec.copy(), self.cell.simulation.data
        spec.add_key(name="start", qpos=data.qpos.copy(), ctrl=data.ctrl.copy())
        spec.compile()
        return str(spec.to_xml())


class Cycle:
    """What every cycle of every run does: look, check and record; solve, send and record.

    ``sample`` is what the sensors say at the start of the next cycle.
    """

    sample: SensorSample

    def __init__(
        self,
        cell: RobotCell,
        guard: Guard,
        trace: Trace,
        on_cycle: Callable[[int], None] | None,
    ) -> None:
        self.trace = trace
        self._cell, self._guard, self._on_cycle = cell, guard, on_cycle
        self._q = self._previous = cell.home
        self._began = 0.0

    def observe(self, phase: int, nominal: Vector) -> Observation:
        """Look at the cell; ``nominal`` is α [rad], half distance and height of the grips [m]."""
        self._began = time.perf_counter()
        simulation, trace = self._cell.simulation, self.trace
        seen = simulation.observe()
        refuse_warnings(simulation.data)
        trace.observe(
            trace.rows * COMMAND_PERIOD_S,
            phase,
            nominal,
            seen,
            simulation.data.qpos,
            simulation.bending_angles,
        )
        self._guard.check(seen.q, seen.speed, seen.torque, self._cell.response.position)
        return seen

    def send(self, targets: Targets, readings: dict[int, Reading], command: Command) -> None:
        """Command both grips' poses in the world and run the physics to the next cycle."""
        ik = self._cell.ik
        solution = ik.solve(targets, 2.0 * self._q - self._previous)
        if not solution.reached:
            raise ProtectiveStop(f"commanded {ik.describe_miss(solution)}")
        self._previous, self._q = self._q, solution.q
        self.sample = self._cell.send(self._q)
        self.trace.act(readings, command, solution, time.perf_counter() - self._began)
        if self._on_cycle is not None:
            self._on_cycle(self.trace.rows)


class BendingRun(Run):
    """The paper's experiment: bend the sheet along a path between two grips that hold it.

    Parameters
    ----------
    scenario
        Says everything about the run.
    compliance
        Makes what takes the place of the scenario's ``[compliance]``, anew for each sensing arm
        and run: it may have a memory. The result and its summary name it.

    Raises
    ------
    InputError
        A pose of the nominal path is out of reach, or its joint speeds are above the arm's.
    """

    phases = PHASES

    def __init__(
        self,
        scenario: Scenario,
        compliance: Callable[[Scenario], Compliance] = make_admittance,
    ) -> None:
        self.compliance = compliance
        scenario = with_placements(scenario)
        self.motion = nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)
        self._z_m = scenario.cell.sheet_height_m + self.motion.rise_m
        self._errors = errors_over_time(scenario.misalignment, self.motion)
        if self._errors is not None:
            self.task_columns = SPACE_COLUMNS
        self.scenario = scenario
        try:
            cell = RobotCell(scenario, self._nominal_pose(0))
        except InputError as error:
            raise self._out_of_reach(0, error) from error
        super().__init__(scenario, cell)
        self._foresee()

    @property
    def cycles(self) -> int:
        """Number of command cycles."""
        return self.motion.cycles

    def start(self) -> SensorSample:
        """Put the cell at rest in its start, the sheet in its zero-moment shape."""
        return self.cell.reset()

    def _nominal_pose(self, cycle: int) -> Vector:
        motion = self.motion
        return np.array([-motion.half_distance_m[cycle], self._z_m[cycle], motion.alpha_rad[cycle]])

    def _foresee(self) -> None:
        """Walk the nominal path with the IK alone and refuse what the arms cannot do."""
        first = int(np.flatnonzero(self.motion.phase == PHASES.index("bend"))[0])
        cycles = np.linspace(first, self.motion.cycles - 1, _CHECKED_POSES).astype(int)
        q, before, poses = self.cell.home, -1, list[Vector]()
        for cycle in np.unique(cycles).tolist():
            try:
                there = self.cell.reach(self._nominal_pose(cycle), q)
            except InputError as error:
                raise self._out_of_reach(cycle, error) from error
            if before >= 0:
                self._refuse_speed(np.abs(there - q) / ((cycle - before) * COMMAND_PERIOD_S))
            q, before = there, cycle
            poses.append(there)
        self.foreseen = np.array(poses)
        refuse_overload(self.scenario, self.cell.arms, self.cell.ik.model, self.foreseen)

    def _out_of_reach(self, cycle: int, error: InputError) -> InputError:
        return InputError(
            f"scenario {self.scenario.name!r}: path at {self.motion.alpha_rad[cycle]:.3f} rad: "
            f"{error}; look at {shown_placements(self.scenario)}, "
            f"cell.sheet_height_m = {self.scenario.cell.sheet_height_m}"
        )

    def _refuse_speed(self, speed: Vector) -> None:
        joints = self.cell.simulation.joints
        limit = self.scenario.guard.speed_fraction * self.cell.arms.speed_limit
        i = int(np.argmax(speed / limit))
        if speed[i] > limit[i]:
            slower = self.scenario.motion.speed_rad_per_s * limit[i] / speed[i]
            raise InputError(
                f"motion.speed_rad_per_s = {self.scenario.motion.speed_rad_per_s}: "
                f"{joints[i]} would turn at {speed[i]:.2f} rad/s, above {limit[i]:.2f}; "
                f"at most {slower:.2f} rad/s of bending here"
            )

    def _loop(self, controller: ComplianceController, cycle: Cycle) -> None:
        for n in range(self.motion.cycles):
            x, z, alpha = self._nominal_pose(n).tolist()
            seen = cycle.observe(int(self.motion.phase[n]), np.array([alpha, -x, z]))
            refuse_snapped(seen.sag, alpha)
            if self._errors is not None:
                self.trace.note(self.cell.simulation.roll_and_yaw().ravel().tolist())
                self.cell.simulation.displace_grasps(self._errors[n])
            sample = cycle.sample
            readings = controller.sense(sample.wrench, sample.rotation, seen.grip[:, 3])
            command = controller.command(readings, x, z, alpha)
            cycle.send(grip_targets(command.pose), readings, command)


def refuse_snapped(sag_m: float, alpha_rad: float) -> None:
    """Raise SimulationFailed where the sheet's middle has gone to the other side of its ends."""
    if alpha_rad > _SNAPPED_FROM_RAD and sag_m < _SNAPPED_SAG_M:
        raise SimulationFailed(
            "the sheet snapped into another buckled shape: "
            f"its middle is {-1e3 * sag_m:.1f} mm above its ends"
        )


def _name_of(made_by: Callable[[Scenario], Compliance]) -> str:
    """Return module and name of a class or function, the class's name of anything else."""
    named = made_by if hasattr(made_by, "__qualname__") else type(made_by)
    return f"{named.__module__}.{named.__qualname__}"


def make_controller(
    scenario: Scenario, model: mujoco.MjModel, compliance: Callable[[Scenario], Compliance]
) -> ComplianceController:
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
        admittances={i: compliance(scenario) for i in chains},
        complying=[SIDES.index(side) for side in scenario.arms.complying],
        delay=TransportDelay(scenario.alter.delay_cycles, 2 * len(SIDES)),
        modifications=(
            PlanarPathModification(scenario.alter.mode),
            PlanarPathModification(scenario.alter.mode),
        ),
    )
