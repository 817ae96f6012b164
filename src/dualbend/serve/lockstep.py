"""Lock step: the simulated cell waits in every cycle until its controllers have answered."""

from __future__ import annotations

import dataclasses
import selectors
import time
from collections.abc import Callable, Sequence

import numpy as np

from dualbend.control.alter import angles_of
from dualbend.control.controller import Observation
from dualbend.control.guard import ProtectiveStop
from dualbend.run.loop import Asking, Run
from dualbend.run.outcome import TaskStopped
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServeConfig
from dualbend.scene.simulation import BENDING_TO_WORLD
from dualbend.scene.warnings import warnings_counted_only
from dualbend.serve.port import ArmState, Port, RobotPort, SensorPort
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
        run: Run,
        config: ServeConfig,
        robots: Sequence[RobotPort],
        sensors: Sequence[SensorPort],
    ) -> None:
        self._run, self._config = run, config
        self._robots, self._sensors = robots, sensors
        self._ports: tuple[Port, ...] = (*robots, *sensors)
        self._deviation = np.zeros((len(SIDES), 6))
        self._cycle, self._wait_s = 0, config.wait_s
        self.client_ended: Callable[[], str] = str
        self.failure = ""

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunRecord:
        """Simulate the motion to its end, whatever ends it."""
        self._run.outside, self._run.records_all_axes = "dualbend serve", True
        walk = self._run.walk(on_cycle)
        with warnings_counted_only(), selectors.DefaultSelector() as self._selector:
            for port in self._ports:
                self._selector.register(port, selectors.EVENT_READ, port)
            try:
                observed = next(walk)
                while True:
                    observed = self._advance(walk, observed)
            except StopIteration as end:
                record: RunRecord = end.value
        counted = tuple(port.counted() for port in self._ports)
        return dataclasses.replace(record, ports=counted)

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
        for sensor in self._sensors:
            clipped = bool(run.reading.clipped[self._sensor_row(sensor.side)].any())
            sensor.publish(self._cycle, self._wrench(sensor.side), clipped=clipped)
        asked = [robot for robot in self._robots if robot.side not in run.stopped]
        for robot in asked:
            robot.ask(self._state(robot.side, observed))
        self._wait(asked)
        self._wait_s = self._config.timeout_s
        deviation = np.zeros_like(self._deviation)
        for robot in asked:
            assert robot.answer is not None
            row = SIDES.index(robot.side)
            deviation[row] = self._bounded(robot.side, robot.answer)
        self._deviation = deviation
        return deviation.copy()

    def _state(self, side: Side, observed: Observation) -> ArmState:
        row, arms = SIDES.index(side), self._run.cell.arms
        measured, nominal = np.zeros(6), np.zeros(6)
        measured[::2] = observed.measured.coordinates[row]
        measured[1::2] = observed.aside[row]
        nominal[::2] = observed.nominal.coordinates[row]
        joints = observed.joints_rad[arms.joints(side)]
        slides = [slide for name, slide in arms.slides.items() if name.startswith(side)]
        return ArmState(
            cycle=self._cycle,
            measured=measured,
            nominal=nominal,
            joints=np.where(slides, 1e3 * joints, np.degrees(joints)),
            wrench=self._wrench(side) if row in self._run.sensors.arms else None,
            read_turn=self._read_turn(row) if row in self._run.sensors.arms else None,
        )

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
        while silent := _silent(asked):
            for key, _ in self._selector.select(max(min(again_at, deadline) - now, 0.0)):
                key.data.receive()
            for robot in silent:
                if robot.wrong_in_a_row >= self._config.late_limit:
                    raise ProtectiveStop(
                        f"the {robot.side} arm's controller gave {robot.wrong_in_a_row} wrong "
                        "answers in a row (serve.late_limit)",
                        robot.side,
                    )
            now = time.monotonic()
            if now >= deadline and (late := _silent(asked)):
                sides = " and ".join(robot.side for robot in late)
                raise TaskStopped(
                    f"no answer from the controller of the {sides} arm in cycle {self._cycle} "
                    f"for {self._wait_s:g} s (serve.{'timeout_s' if self._cycle else 'wait_s'})"
                )
            if now >= again_at:
                again_at = now + _REFUSED_S
                if _silent(asked) and (ended := self.client_ended()):
                    raise TaskStopped(f"{ended}, in cycle {self._cycle}")
                for robot in silent:
                    if robot.refused:
                        robot.again()
            if now >= repeat_at:
                repeat_at = now + _REPEAT_S
                for sensor in self._sensors:
                    sensor.again()

    def _bounded(self, side: Side, answer: Vector) -> Vector:
        """Return the deviation (6,) that an answer means; ProtectiveStop beyond the bounds."""
        config = self._config
        before = self._deviation[SIDES.index(side)]
        whole = answer if config.correction == "absolute" else before + answer
        for what, value, limits in (
            ("deviation", whole, (config.limit_m, config.limit_rad)),
            ("step", whole - before, (config.step_m, config.step_rad)),
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
