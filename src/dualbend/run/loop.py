"""The loop: once per command period observe, sense, comply, solve the IK, send, run the physics."""

from __future__ import annotations

import signal
import time
import uuid
from collections.abc import Callable, Generator
from typing import TypeVar

import numpy as np

from dualbend.control.compliance.own import OwnComplianceConfig
from dualbend.control.controller import (
    AT_REST,
    IN_PLANE,
    Command,
    ControlledPath,
    Controller,
    ControllerFailed,
)
from dualbend.control.controller import Observation as Observed
from dualbend.control.force_torque import WrenchReading
from dualbend.control.guard import ProtectiveStop
from dualbend.control.wrist import WristSensors
from dualbend.errors import shortened
from dualbend.run import cell as parts
from dualbend.run.cell import RobotCell
from dualbend.run.identity import RunIdentity
from dualbend.run.known_sheet import make_compliance
from dualbend.run.outcome import TaskStopped
from dualbend.run.record import RunRecord, Scene, TableRow, task_of
from dualbend.run.trace import TraceRecorder
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sections import Outcome
from dualbend.scene.ik import IKSolution, Targets
from dualbend.scene.observation import PLANAR, Observation, SensorSample
from dualbend.scene.warnings import SimulationFailed, refuse_warnings, warnings_counted_only
from dualbend.types import SIDES, PlanarPose, Side, Vector

T = TypeVar("T")
Asking = Generator[Observed, Vector | None, T]
"""Yields what the controller observes before it is asked; a deviation (2, 6) that is sent in takes
the place of its answer."""


class Run:
    """A scenario made ready: everything that can be refused has been when this exists.

    A subclass says where the run begins (:meth:`start`) and what one command cycle is
    (:meth:`cycle`). :meth:`run` goes to the end; who wants to own the loop calls :meth:`begin` and
    then :meth:`step` until it returns False, or takes :meth:`walk` from cycle to cycle.

    Attributes
    ----------
    trace : of the run since :meth:`begin`
    checked_poses : joint angles (k, n) of the poses that were tried before the run
    sample : what the sensors say at the start of the next cycle
    identity : what names the run in every file; begun again, it is the same run
    learned : what was learned before and corrects the path, in words; "" where nothing does
    steered : a deviation has come from outside, in the controller's place; ``outside`` names it
    records_all_axes : deviations may have all six axes, whatever the scenario's controller has
    watched : somebody outside reads what the controller observes
    reading, read_axes
        Of the sensors in this cycle; their axes (2, 3, 3) in the world when it was sampled.
    """

    trace: TraceRecorder
    sensors: WristSensors
    path: ControlledPath
    sample: SensorSample
    checked_poses: Vector
    learned: str = ""
    steered = records_all_axes = False
    watched = True
    outside = "dualbend.Cell.step"
    reading: WrenchReading
    read_axes: Vector
    compliance: Callable[[Scenario], Controller] = staticmethod(make_compliance)

    def __init__(self, scenario: Scenario, cell: RobotCell) -> None:
        self.scenario, self.cell = scenario, cell
        self.laid: list[Vector] = []
        self.identity = RunIdentity.of(scenario, uuid.uuid4().hex)

    @property
    def cycles(self) -> int:
        """Number of command cycles, at most."""
        raise NotImplementedError

    def start(self) -> SensorSample:
        """Put the cell where the run begins."""
        raise NotImplementedError

    def controller(self) -> Controller:
        """Return what deviates from the nominal path; each run has its own."""
        return self.compliance(self.scenario)

    def cycle(self) -> Asking[bool]:
        """Run one command cycle, from :meth:`observe` to :meth:`send`; False: there is none left.

        Raises
        ------
        ProtectiveStop, TaskStopped, SimulationFailed, ControllerFailed
            What ends a run before its motion does.
        """
        raise NotImplementedError

    def step(self) -> bool:
        """Run one command cycle as :meth:`cycle` does, by the run's own controller."""
        self.watched = False
        return to_the_end(self.cycle())

    def begin(self, on_cycle: Callable[[int], None] | None = None) -> None:
        """Start again from the first cycle; ``on_cycle`` is called with the number of cycles done.

        Filters, delays and noise streams have a memory and are made again for each run.
        """
        simulation = self.cell.simulation
        self.sensors = parts.make_sensors(self.scenario, simulation.model, self.cell.calibrations)
        robot = self.scenario.robot
        self.path = ControlledPath(
            self.controller(),
            delay_cycles=[robot.delay_of(side) for side in SIDES],
            mode=robot.alter.mode,
        )
        self.trace = self.recorder(self.cycles + self.scenario.after_stop_cycles)
        self.link = parts.make_link(self.scenario, self.cell)
        self._guard = parts.make_guard(self.scenario, self.cell)
        self._sensor_guard = parts.make_sensor_guard(self.scenario, self.sensors)
        self.stopped: set[Side] = set()
        self.steered = False
        self._on_cycle = on_cycle
        self._q = self._previous = self.cell.home
        self.sample = self.start()

    def recorder(self, rows: int, shape: tuple[int, ...] = ()) -> TraceRecorder:
        """Return a trace to be recorded, of any leading shape."""
        return TraceRecorder(
            rows,
            self.sensors.arms,
            self.cell.compiled.nq,
            self.scenario.sheet.model.sections,
            self.cell.arms.slides,
            task_of(self.scenario).part("columns")(self.scenario),
            shape,
            link=self.scenario.imperfections.link.errs,
            slips=self.scenario.grasp.friction is not None,
            in_space=self.scenario.compliance.in_space or self.records_all_axes,
        )

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunRecord:
        """Simulate the motion to its end, whatever ends it."""
        with warnings_counted_only():
            return to_the_end(self.walk(on_cycle, watched=False))

    def walk(
        self, on_cycle: Callable[[int], None] | None = None, *, watched: bool = True
    ) -> Asking[RunRecord]:
        """Do what :meth:`run` does, and wait in each cycle before the controller is asked.

        ``watched``: who waits reads what the controller observes.
        """
        self.watched = watched
        simulation = self.cell.simulation
        outcome: Outcome = "completed"
        reason, ended_by = "", 0
        started = time.perf_counter()
        try:
            self.begin(on_cycle)
            started = time.perf_counter()
            try:
                while (yield from self.cycle()):
                    pass
            except ProtectiveStop as stop:
                outcome, reason = "protective_stop", (yield from self._run_on(stop))
            else:
                refuse_warnings(simulation.warned)
        except TaskStopped as stop:
            outcome, reason = "aborted", str(stop)
        except (SimulationFailed, ControllerFailed) as failure:
            outcome, reason = "failed", str(failure)
        except KeyboardInterrupt as interrupt:
            ended_by = getattr(interrupt, "signal", signal.SIGINT)
            outcome, reason = "failed", "interrupted by the user"
        if reason and outcome != "protective_stop":
            reason = f"{reason}, at {simulation.data.time:.3f} s"
        return self.record(outcome, reason, time.perf_counter() - started, ended_by)

    def _run_on(self, stop: ProtectiveStop) -> Asking[str]:
        """Run on as long after a stop as the scenario says; return all that happened, in words."""
        data = self.cell.simulation.data
        told = self._stop(stop)
        # The cycle in which an arm stops is begun: nobody commands any more in it.
        begun = True
        try:
            for _ in range(self.scenario.after_stop_cycles):
                try:
                    if begun or self.stopped == set(SIDES):
                        self._coast(begun=begun)
                        begun = False
                    elif not (yield from self.cycle()):
                        break
                except ProtectiveStop as another:
                    told, begun = f"{told}; {self._stop(another)}", True
        except (TaskStopped, SimulationFailed, ControllerFailed) as ended:
            told = f"{told}; then {ended}, at {data.time:.3f} s"
        return told

    def _stop(self, stop: ProtectiveStop) -> str:
        """Stop the arms that a stop is of, and the other one where it stops with it.

        Or where the arm had stopped already: then something that both need has failed.
        """
        alone = self.scenario.guard.other_arm == "continue" and not self.stopped >= {*stop.sides}
        self.stopped |= {*(stop.sides if alone else SIDES)}
        self._guard.release(self.cell.stop(self.stopped))
        self._sensor_guard.release(self.stopped)
        return f"{stop}, at {self.cell.simulation.data.time:.3f} s"

    def _coast(self, *, begun: bool) -> None:
        """Let a cycle pass without a command: an arm that has not stopped goes on as it did."""
        if begun:
            self.cell.simulation.observe()
        else:
            self.observe(0, self._nominal)
        self._previous, self._q = self._q, 2.0 * self._q - self._previous
        self.sample = self.cell.send(self._q)
        if self._on_cycle is not None:
            self._on_cycle(self.trace.rows)

    def record(
        self, outcome: Outcome, reason: str = "", wall_time_s: float = 0.0, signal: int = 0
    ) -> RunRecord:
        """Return what the run has left so far."""
        simulation = self.cell.simulation
        return RunRecord(
            scenario=self.scenario,
            outcome=outcome,
            reason=reason,
            trace=self.trace,
            scene=Scene(compiled=self.cell.with_looks, bend_stiffness=simulation.bend_stiffness),
            simulated_s=float(simulation.data.time),
            wall_time_s=wall_time_s,
            controller=self._controlled_by(),
            learned=self.learned,
            laid=tuple(self.laid),
            lessons=self.lessons,
            contacts=tuple(simulation.contacts),
            identity=self.identity,
            signal=signal,
        )

    def _controlled_by(self) -> str:
        if self.steered:
            return self.outside
        return "" if self.compliance is make_compliance else self._named

    @property
    def _own(self) -> bool:
        """The controller is none of the package's; those read nothing out of the bending plane."""
        own = isinstance(self.scenario.compliance, OwnComplianceConfig)
        return own or self.compliance is not make_compliance

    @property
    def _named(self) -> str:
        """Return what the controller is called: as the scenario does, where a class is named."""
        config = self.scenario.compliance
        if self.compliance is make_compliance and isinstance(config, OwnComplianceConfig):
            return config.controller
        return _name_of(self.compliance)

    @property
    def lessons(self) -> tuple[TableRow, ...]:
        """What was found with each sheet of an assembly, a row each."""
        return ()

    def observe(self, phase: int, nominal: Vector) -> Observation:
        """Observe, record and check; ``nominal`` is α [rad], half distance and height [m]."""
        self._began, self._nominal = time.perf_counter(), nominal
        simulation, trace = self.cell.simulation, self.trace
        seen = simulation.observe()
        refuse_warnings(simulation.warned)
        trace.observe(
            trace.rows * self.scenario.period_s,
            len(task_of(self.scenario).phases) if self.stopped else phase,
            nominal,
            seen,
            simulation.data.qpos,
            simulation.bending_angles,
        )
        if self.scenario.guard.contact == "stop" and not self.stopped:
            for contact in simulation.contacts:
                raise ProtectiveStop(str(contact))
        self._guard.check(seen.q, seen.speed, seen.torque, self.cell.reference)
        self._watch_grips()
        stop = self.scenario.imperfections.events.arm_stop
        if stop is not None and stop.side not in self.stopped and stop.due(simulation.data.time):
            raise ProtectiveStop(f"the {stop.side} arm stops, as events.arm_stop says", stop.side)
        return seen

    def read(self, seen: Observation) -> WrenchReading:
        """Return what the wrist sensors tell, the tools' weight taken off by measured angles."""
        self.read_axes = self.cell.measured.sensor_axes(self.sample.rotation, seen)
        return self.sensors.read(self.sample.wrench, self.read_axes, new=self.sample.new)

    def _watch_grips(self) -> None:
        """Record how far the sheet has slid, and stop the task where a grip has lost it."""
        simulation, sliding = self.cell.simulation, self.cell.simulation.sliding
        if sliding is None:
            return
        events = self.scenario.imperfections.events
        if events.grips:
            sliding.share = events.friction_share(simulation.data.time)
        self.trace.record_slip(np.hypot(*sliding.slip[:, :2].T))
        for side, dropped in zip(SIDES, sliding.dropped, strict=True):
            if dropped:
                raise TaskStopped(f"the {side} gripper has dropped the sheet")

    def control(
        self,
        seen: Observation,
        phase: str,
        nominal: PlanarPose,
        reading: WrenchReading,
        place: Vector = AT_REST,
    ) -> Asking[tuple[Observed, Command]]:
        """Return what the controller observes and the command that it makes of it.

        The time that is waited for an answer from outside counts as none of the cycle's.
        ``nominal``: of both arms (2, 3), each in its own bending frame, which is carried to a
        ``place`` (4,) of x, y, z [m] and a turn [rad]. Raises ProtectiveStop where a sensor is at
        its range's end, or tells nothing new, for longer than the guard allows.
        """
        self.reading = reading
        self.trace.record_reading(reading)
        self._sensor_guard.check(reading.clipped, reading.fresh)
        observed = Observed.of(
            reading,
            time_s=(self.trace.rows - 1) * self.scenario.period_s,
            phase=phase,
            joints_rad=seen.q,
            measured=PlanarPose(self.cell.measured.grips(seen).take(PLANAR, axis=1)),
            nominal=nominal,
            aside=self.cell.measured.aside(seen) if self.watched or self._own else IN_PLANE,
            place=place,
        )
        asked = time.perf_counter()
        action = yield observed
        self._began += time.perf_counter() - asked
        self.steered |= action is not None
        try:
            return observed, self.path.command(observed, action)
        except ControllerFailed as error:
            said = shortened(f"controller {self._named}, cycle {self.trace.rows}: {error}")
            raise ControllerFailed(said) from error

    def solve(self, targets: Targets) -> IKSolution:
        """Return the joint angles for both grips' poses in the world, from where they are going."""
        return self.cell.ik.solve(targets, 2.0 * self._q - self._previous)

    def send(
        self, solution: IKSolution, observation: Observed, command: Command, *, free: bool = False
    ) -> None:
        """Command joint set-points and run the physics to the next cycle.

        ``free``: as :meth:`dualbend.run.cell.RobotCell.send` has it.
        """
        if not solution.reached:
            raise ProtectiveStop(f"commanded {self.cell.ik.describe_miss(solution)}")
        self._previous, self._q = self._q, solution.q
        link = self.link
        self.sample = self.cell.send(link.deliver(self._q) if link else self._q, free=free)
        wall_s = time.perf_counter() - self._began
        ages = link.age if link else ()
        self.trace.record_control(observation, command, solution, wall_s, ages)
        if self._on_cycle is not None:
            self._on_cycle(self.trace.rows)

    def scene_xml(self) -> str:
        """Return the composed MJCF, the run's start as key frame ``start``; InputError: a shell."""
        self.start()
        return self.cell.scene_xml("start")


def to_the_end(asking: Asking[T]) -> T:
    """Return what remains when nothing is answered from outside."""
    try:
        while True:
            next(asking)
    except StopIteration as end:
        value: T = end.value
        return value


def _name_of(made_by: Callable[[Scenario], Controller]) -> str:
    """Return module and name of a class or function, the class's name of anything else."""
    named = made_by if hasattr(made_by, "__qualname__") else type(made_by)
    return f"{named.__module__}.{named.__qualname__}"
