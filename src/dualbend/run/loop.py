"""The loop: every 28 ms observe, sense, comply, solve, send, until motion or robot ends it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.controller import Command, ControlledPath, Controller
from dualbend.control.controller import Observation as Observed
from dualbend.control.filters import LowPass
from dualbend.control.force_torque import (
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
    WrenchReading,
)
from dualbend.control.guard import Guard, ProtectiveStop
from dualbend.control.wrist import WristSensors
from dualbend.errors import InputError
from dualbend.run.cell import RobotCell
from dualbend.run.known_sheet import make_compliance
from dualbend.run.outcome import TaskStopped
from dualbend.run.trace import Trace
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sections import Outcome
from dualbend.scene.ik import Targets
from dualbend.scene.simulation import Observation, SensorSample, tool_mass_and_centre
from dualbend.scene.warnings import SimulationFailed, refuse_warnings, warnings_counted_only
from dualbend.types import SIDES, Vector


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
    compliance: Callable[[Scenario], Controller] = staticmethod(make_compliance)

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

    def _loop(self, sensors: WristSensors, path: ControlledPath, cycle: Cycle) -> None:
        """Run to the end, one :meth:`Cycle.observe` and :meth:`Cycle.send` after the other."""
        raise NotImplementedError

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunResult:
        """Simulate the motion; call ``on_cycle`` with the number of cycles done.

        ``self.trace`` is the run's trace from its start on.
        """
        # Anew for each run: filters, delays and noise streams have a memory.
        simulation = self.cell.simulation
        sensors = make_sensors(self.scenario, simulation.model)
        path = ControlledPath(
            self.compliance(self.scenario),
            delay_cycles=self.scenario.alter.delay_cycles,
            mode=self.scenario.alter.mode,
        )
        trace = Trace(
            self.cycles,
            sensors.arms,
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
                self._loop(sensors, path, cycle)
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
            controller="" if self.compliance is make_compliance else _name_of(self.compliance),
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

    def send(
        self, targets: Targets, reading: WrenchReading, observation: Observed, command: Command
    ) -> None:
        """Command both grips' poses in the world and run the physics to the next cycle."""
        ik = self._cell.ik
        solution = ik.solve(targets, 2.0 * self._q - self._previous)
        if not solution.reached:
            raise ProtectiveStop(f"commanded {ik.describe_miss(solution)}")
        self._previous, self._q = self._q, solution.q
        self.sample = self._cell.send(self._q)
        self.trace.act(reading, observation, command, solution, time.perf_counter() - self._began)
        if self._on_cycle is not None:
            self._on_cycle(self.trace.rows)


def _name_of(made_by: Callable[[Scenario], Controller]) -> str:
    """Return module and name of a class or function, the class's name of anything else."""
    named = made_by if hasattr(made_by, "__qualname__") else type(made_by)
    return f"{named.__module__}.{named.__qualname__}"


def make_sensors(scenario: Scenario, model: mujoco.MjModel) -> WristSensors:
    """Return the wrist sensors of the sensing arms, each with a noise stream of its own."""
    streams = np.random.SeedSequence(scenario.seed).spawn(len(SIDES))
    arms = [i for i, side in enumerate(SIDES) if side in scenario.arms.sensing]
    shape = (len(arms),)
    tools = [tool_mass_and_centre(model, SIDES[i]) for i in arms]
    chain = WrenchChain(
        Sensor(scenario.sensor, [np.random.default_rng(streams[i]) for i in arms], shape),
        ToolGravityCompensation([mass for mass, _ in tools], [centre for _, centre in tools]),
        LowPass(scenario.filter, period_s=COMMAND_PERIOD_S, shape=shape),
        np.eye(3),
    )
    return WristSensors(chain, arms)
