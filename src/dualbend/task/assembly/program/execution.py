"""One execution of the assembly's program: every observation advances it by one cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from dualbend.task.assembly.program.held import Slack
from dualbend.task.assembly.program.motions import PHASES, Goal, Posture, Sensed
from dualbend.task.assembly.program.search import HolePair
from dualbend.task.assembly.program.seats import PinGuard
from dualbend.task.assembly.program.state import State
from dualbend.task.assembly.program.steps import Step


@dataclass(frozen=True)
class Phase:
    """A phase of the program; where ``holes`` are not on their pins at its end, back by one.

    ``slack`` and ``guard`` act in all its steps.
    """

    name: str
    steps: Sequence[Step]
    holes: HolePair | None = None
    slack: Slack | None = None
    guard: PinGuard | None = None


@dataclass
class Execution:
    """An explicit state machine over a table of phases; it may be copied or pickled in any cycle.

    ``table`` is only read; ``start``: posture in which the arms begin; ``bend_rad``: bending angle
    at which a sheet is laid; ``period_s``: of the commands [s].
    """

    table: tuple[Phase, ...]
    start: Posture
    bend_rad: float
    period_s: float
    state: State = field(init=False)
    goal: Goal | None = field(init=False)
    """What is wanted in the present cycle; None when all sheets are laid."""

    def __post_init__(self) -> None:
        self.state = State(
            posture=self.start, period_s=self.period_s, begin=self.start, end=self.start
        )
        self.goal = self._next_goal()

    def advance(self, sensed: Sensed) -> Goal | None:
        """Return the goal of the next cycle, given what was sensed in the present one.

        Raises
        ------
        TaskStopped
            What was sensed tells that the assembly cannot go on.
        """
        self.state.seen.append(sensed)
        guard = self.table[self.state.row].guard
        if guard is not None:
            guard.check(self.state)
        self.goal = self._next_goal()
        return self.goal

    def _next_goal(self) -> Goal | None:
        """Return the goal of the first step that needs a cycle, from the present one on."""
        state = self.state
        while state.row < len(self.table):
            phase = self.table[state.row]
            if state.step == len(phase.steps):
                self._leave(phase)
            elif self._wanted(step := phase.steps[state.step]) and step.advance(state):
                return self._goal(step.alpha_ratio, step.relax)
            else:
                state.step, state.cycle, state.pressed = state.step + 1, 0, 0
        return None

    def _wanted(self, step: Step) -> bool:
        return self.state.attempt > 0 or not step.retry_only

    def _leave(self, phase: Phase) -> None:
        """Go to the next phase, or back by one for another attempt."""
        state, again = self.state, False
        if phase.holes is not None:
            again = phase.holes.missed(state)
            state.attempt = state.attempt + 1 if again else 0
            if not again:
                state.tried.clear()
        state.row, state.step = state.row - 1 if again else state.row + 1, 0
        if state.phase <= PHASES.index("lower"):
            # The next sheet, or the middle once more.
            state.height, state.levels = 0.0, (0.0, 0.0)
        if state.phase == 0:
            state.slack = 0.0

    def _goal(self, alpha_ratio: float | None, relax: bool) -> Goal:
        state, slack = self.state, self.table[self.state.row].slack
        if slack is not None:
            slack.update(state)
        if alpha_ratio is not None:
            alpha_ratio = min(alpha_ratio, state.posture.alpha / self.bend_rad)
        posture = state.posture
        return Goal(
            phase=state.phase,
            posture=replace(
                posture, z=posture.z + state.height, retreat=posture.retreat + state.slack
            ),
            levels=state.levels,
            alpha_ratio=alpha_ratio,
            seeking=state.seeking,
            relax=relax,
            attempt=state.attempt,
        )
