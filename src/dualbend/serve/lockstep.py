"""Lock step: the simulated cell waits in every cycle until its controllers have answered."""

from __future__ import annotations

import dataclasses
import selectors
import time
from collections.abc import Callable, Sequence

import numpy as np

from dualbend.control.alter import angles_of, turn
from dualbend.control.controller import Observation
from dualbend.control.guard import ProtectiveStop
from dualbend.run.loop import Asking
from dualbend.run.outcome import TaskStopped
from dualbend.run.planar import PlanarRun
from dualbend.run.record import RunRecord, TableRow
from dualbend.scenario.sections import ServeConfig
from dualbend.scene.observation import BENDING_TO_WORLD
from dualbend.scene.warnings import warnings_counted_only
from dualbend.serve.port import ArmState, Port, RobotPort, SensorPort
from dualbend.serve.robot.pose import deviation_from
from dualbend.types import SIDES, Side, Vector

_REFUSED_S, _REPEAT_S = 0.05, 0.25
"""Until a packet that found nobody, and a reading that nobody answers, are sent again."""


class LockStep:
    """Run a scenario by the answers that come to its ports; results do not depend on when.

    In each cycle the sensors publish, then the robots ask, then all wait for the answers. What a
    robot does not ask for any more, because its arm has stopped, or never, because it has no port,
    is a deviation of 0.

    ``client_ended`` says of a client that was started here how it has ended, "" while it runs;
    ``failure``, after the run, why nobody answered any more, where that ended it.
    """

    def __init__(
        self,
        run: PlanarRun,
        config: ServeConfig,
        robots: Sequence[RobotPort],
        sensors: Sequence[SensorPort],
    ) -> None:
        self._run, self._config = run, config
        self._robots, self._sensors = robots, sensors
        self._ports: tuple[Port, ...] = (*robots, *sensors)
        self._answers = np.zeros((len(SIDES), 6))
        self._cycle, self._wait_s = 0, config.wait_s
        self._streamed = config.path == "outside"
        self.client_ended: Callable[[], str] = str
        self.failure = ""

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunRecord:
        """Simulate the motion to its end, whatever ends it."""
        self._run.outside, self._run.records_all_axes = "dualbend serve", True
        walk = self._run.walk(on_cycle)
        with warnings_counted_only(), selectors.DefaultSelector() as self._selector:
            for port in self._ports:
                port.watch(self._selector)
            try:
                observed = next(walk)
                while True:
                    observed = self._advance(walk, observed)
            except StopIteration as end:
                record: RunRecord = end.value
        return dataclasses.replace(record, ports=self._counted())

    def _counted(self) -> tuple[TableRow, ...]:
        return tuple(port.counted() for port in self._ports)

    def _advance(self, walk: Asking[RunRecord], observed: Observation) -> Observation:
        """Go on by the answers of a cycle; what ends the run ends it from where it waits."""
        try:
            deviation = self._answered(observed)
        except (ProtectiveStop, TaskStopped, KeyboardInterrupt) as end:
            self.failure = str(end) if isinstance(end, TaskStopped) else ""
            return walk.throw(end)
        finally:
            self._cycle += 1
        return walk.send(deviation)

    def _answered(self, observed: Observation) -> Vector:
        """Return the deviation (2, 6) that the controllers answer."""
        run = self._run
        self._on_time()
        for sensor in self._sensors:
            clipped = bool(run.reading.clipped[self._sensor_row(sensor.side)].any())
            sensor.publish(self._cycle, self._wrench(sensor.side), clipped=clipped)
        asked = [robot for robot in self._robots if robot.side not in run.stopped]
        for robot in asked:
            robot.ask(self._state(robot.side, observed))
        self._wait(asked)
        self._wait_s = self._config.timeout_s
        found, before = np.zeros_like(self._answers), self._answers
        self._answers = np.zeros_like(before)
        for robot in asked:
            row = SIDES.index(robot.side)
            answer = self._given(robot)
            if answer is None:
                self._answers[row] = before[row]
            elif self._config.correction == "absolute":
                self._answers[row] = answer
            else:
                self._answers[row] = before[row] + answer
            found[row] = self._bounded(robot.side, self._answers[row], before[row])
        return found

    def _on_time(self) -> None:
        """Wait until the cycle may begin: in lock step it may as soon as it can."""

    def _given(self, robot: RobotPort) -> Vector | None:
        """Return what a robot is answered in this cycle; None: nothing."""
        return robot.answer

    def _state(self, side: Side, observed: Observation) -> ArmState:
        row, arms = SIDES.index(side), self._run.cell.arms
        measured = np.zeros(6)
        measured[::2] = observed.measured.coordinates[row]
        measured[1::2] = observed.aside[row]
        own = arms.joints(side)
        slides = [slide for name, slide in arms.slides.items() if name.startswith(side)]
        joints, setpoint = observed.joints_rad[own], self._run.cell.reference[own]
        sensed = row in self._run.sensors.arms
        return ArmState(
            cycle=self._cycle,
            measured=measured,
            nominal=self._nominal(self._cycle),
            origin=self._nominal(0 if self._streamed else self._cycle),
            joints=np.where(slides, 1e3 * joints, np.degrees(joints)),
            setpoint=np.where(slides, 1e3 * setpoint, np.degrees(setpoint)),
            wrench=self._wrench(side) if sensed else None,
            read_turn=self._read_turn(row) if sensed else None,
            force=observed.raw.components[row] if sensed else None,
        )

    def _nominal(self, cycle: int) -> Vector:
        """Return the pose (6,) of the nominal path in a cycle; at its end it stays."""
        pose = np.zeros(6)
        pose[::2] = self._run.nominal_poses[min(cycle, self._run.cycles - 1)]
        return pose

    def _read_turn(self, row: int) -> Vector:
        return angles_of(self._run.read_axes[row] * BENDING_TO_WORLD[row][:, np.newaxis])

    def _wrench(self, side: Side) -> Vector:
        """Return the raw reading (6,) of a side's sensor, along its axes."""
        reading: Vector = self._run.reading.sensor.components[self._sensor_row(side)]
        return reading

    def _sensor_row(self, side: Side) -> int:
        return self._run.sensors.arms.index(SIDES.index(side))

    def _wait(self, asked: Sequence[RobotPort]) -> None:
        """Take packets until all robots are answered.

        Raises TaskStopped where one is not in time, ProtectiveStop where it has too many answers
        that are none.
        """
        now = time.monotonic()
        deadline, repeat_at, again_at = now + self._wait_s, now + _REPEAT_S, now + _REFUSED_S
        while _silent(asked):
            self._take(max(min(again_at, deadline) - now, 0.0), asked)
            now = time.monotonic()
            if now >= deadline and (late := _silent(asked)):
                sides = " and ".join(robot.side for robot in late)
                hints = dict.fromkeys(f" ({robot.hint})" for robot in late if robot.hint)
                raise TaskStopped(
                    f"no answer from the controller of the {sides} arm in cycle {self._cycle} "
                    f"for {self._wait_s:g} s (serve.{'timeout_s' if self._cycle else 'wait_s'})"
                    f"{''.join(hints)}"
                )
            if now >= again_at:
                again_at = now + _REFUSED_S
                if _silent(asked) and (ended := self.client_ended()):
                    raise TaskStopped(f"{ended}, in cycle {self._cycle}")
                for robot in asked:
                    if robot.refused:
                        robot.again()
            if now >= repeat_at:
                repeat_at = now + _REPEAT_S
                for sensor in self._sensors:
                    sensor.again()

    def _take(self, seconds: float, asked: Sequence[RobotPort]) -> None:
        """Take the packets that come within a time, or are there."""
        for key, _ in self._selector.select(seconds):
            key.data()
        for robot in asked:
            if robot.gone_wrong:
                raise TaskStopped(f"the {robot.side} arm's controller {robot.gone_wrong}")
            if robot.wrong_in_a_row >= self._config.late_limit:
                raise ProtectiveStop(
                    f"the {robot.side} arm's controller gave {robot.wrong_in_a_row} wrong "
                    "answers in a row (serve.late_limit)",
                    robot.side,
                )

    def _bounded(self, side: Side, answer: Vector, before: Vector) -> Vector:
        """Return the deviation (6,) from the path that an answer (6,) means.

        Where the whole motion is streamed, an answer leads from the pose at the start to the one
        to go to: it is made a deviation of the pose that the path has when the command acts, after
        the transport delay. ProtectiveStop beyond the bounds.
        """
        config, whole = self._config, answer
        if self._streamed:
            start, delay = self._nominal(0), self._run.scenario.robot.delay_of(side)
            place, axes = start[:3] + answer[:3], turn(answer[3:]) @ turn(start[3:])
            whole = deviation_from(self._nominal(self._cycle + delay), place, axes)
        for what, value, limits in (
            ("deviation", whole, (config.limit_m, config.limit_rad)),
            ("step", answer - before, (config.step_m, config.step_rad)),
        ):
            for part, limit, unit in zip((value[:3], value[3:]), limits, ("m", "rad"), strict=True):
                largest = float(np.max(np.abs(part)))
                if not largest <= limit:
                    key = ("limit" if what == "deviation" else "step") + f"_{unit}"
                    raise ProtectiveStop(
                        f"the {side} arm's controller asks for a {what} of {largest:.4g} {unit}, "
                        f"beyond serve.{key} = {limit:g}",
                        side,
                    )
        return whole


def _silent(robots: Sequence[RobotPort]) -> list[RobotPort]:
    """Return those that are not answered."""
    return [robot for robot in robots if robot.answer is None]
