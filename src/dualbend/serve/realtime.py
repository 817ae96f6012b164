"""Real time: the simulated robot does not wait, a late answer is late, and lateness is counted."""

from __future__ import annotations

import bisect
import dataclasses
import time
from collections import Counter
from collections.abc import Callable, Sequence

from dualbend.control.guard import ProtectiveStop
from dualbend.run.record import RunRecord, TableRow
from dualbend.serve.lockstep import LockStep
from dualbend.serve.port import RobotPort
from dualbend.types import Vector

_EDGES_MS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_CELL_LATE = 0.5
"""Of a period that the cell told its state too late: then a missed answer is its own fault."""


class RealTime(LockStep):
    """Run a scenario by the clock of the machine, from the first cycle's answers on.

    Cycle n is told at n periods, or as soon as the cell has computed it. What is not answered
    before the next cycle is due is missed: the last deviation stands, or, where the protocol has
    it so, what a late answer of an earlier cycle asks for. A cell that is a period late sets its
    clock anew.
    """

    def run(self, on_cycle: Callable[[int], None] | None = None) -> RunRecord:
        """Simulate the motion to its end, whatever ends it."""
        self._due_s: float | None = None
        self._missed_in_a_row = Counter[str]()
        self._missed, self._excused = Counter[str](), Counter[str]()
        self._late_s = {"cell": list[float](), **{_name(robot): [] for robot in self._robots}}
        self._slips = 0
        record = super().run(on_cycle)
        return dataclasses.replace(record, lateness=self._histogram())

    def _on_time(self) -> None:
        if self._due_s is None:
            return
        self._due_s += self._run.scenario.period_s
        while (left_s := self._due_s - time.monotonic()) > 0.0:
            self._take(left_s, ())
        late_s = time.monotonic() - self._due_s
        self._late_s["cell"].append(late_s)
        if late_s > self._run.scenario.period_s:
            self._slips += 1
            self._due_s = time.monotonic()

    def _wait(self, asked: Sequence[RobotPort]) -> None:
        """Take packets until all robots are answered or the next cycle is due."""
        sent_s = time.monotonic()
        if self._due_s is None:
            super()._wait(asked)
            self._due_s = time.monotonic()
            return
        end_s = self._due_s + self._run.scenario.period_s
        silent = [robot for robot in asked if robot.answer is None]
        left_s = 1.0
        while silent and left_s > 0.0:  # at the end it looks once more at what is there
            left_s = max(end_s - time.monotonic(), 0.0)
            self._take(left_s, asked)
            now_s = time.monotonic()
            for robot in [robot for robot in silent if robot.answer is not None]:
                silent.remove(robot)
                self._late_s[_name(robot)].append(now_s - sent_s)
                self._missed_in_a_row[robot.side] = 0
        for robot in silent:
            self._miss(robot, sent_s - self._due_s)

    def _miss(self, robot: RobotPort, cell_late_s: float) -> None:
        """Count a missed answer; ProtectiveStop after too many in a row."""
        robot.missed = True
        excused = cell_late_s > _CELL_LATE * self._run.scenario.period_s
        (self._excused if excused else self._missed)[robot.side] += 1
        self._missed_in_a_row[robot.side] += 1
        if self._missed_in_a_row[robot.side] >= self._config.late_limit:
            raise ProtectiveStop(
                f"the {robot.side} arm's controller missed {self._config.late_limit} cycles in a "
                "row (serve.late_limit)",
                robot.side,
            )

    def _given(self, robot: RobotPort) -> Vector | None:
        return robot.answer if robot.answer is not None else robot.late

    def _counted(self) -> tuple[TableRow, ...]:
        """Return what went through the ports, with the missed answers of each robot."""
        rows = list(super()._counted())
        for i, robot in enumerate(self._robots):
            missed = {"missed": self._missed[robot.side]}
            rows[i] |= missed | {"missed_cell_late": self._excused[robot.side]}
        return tuple(rows)

    def _histogram(self) -> tuple[TableRow, ...]:
        """Return how often the cell, and each controller's answers, took up to how long."""
        counts = {
            name: Counter(bisect.bisect_left(_EDGES_MS, 1e3 * late) for late in times)
            for name, times in self._late_s.items()
        }
        said = [*(f"up to {edge:g} ms" for edge in _EDGES_MS), f"above {_EDGES_MS[-1]:g} ms"]
        rows: list[TableRow] = [
            {"time": text, **{name: counts[name][i] for name in counts}}
            for i, text in enumerate(said)
        ]
        missed = {_name(r): self._missed[r.side] + self._excused[r.side] for r in self._robots}
        return (*rows, {"time": "missed; clock set anew", "cell": self._slips, **missed})


def _name(robot: RobotPort) -> str:
    return f"{robot.side} robot"
