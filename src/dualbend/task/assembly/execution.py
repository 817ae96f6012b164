"""One execution of the assembly's program: every observation advances it by one cycle."""

from __future__ import annotations

from dataclasses import dataclass, field

from dualbend.task.assembly.motions import Goal, Posture, Sensed
from dualbend.task.assembly.state import State
from dualbend.task.assembly.steps import Phase, Step


@dataclass
class Execution:
    """An explicit state machine over a table of phases; it may be copied or pickled in any cycle.

    Parameters
    ----------
    table
        Phases in their order; it is only read.
    start
        Posture in which the arms begin.
    bend_rad
        Bending angle at which a sheet is laid.
    """

    table: tuple[Phase, ...]
    start: Posture
    bend_rad: float
    state: State = field(init=False)
    goal: Goal | None = field(init=False)
    """What is wanted in the present cycle; None when all sheets are laid."""

    def __post_init__(self) -> None:
        self.state = State(posture=self.start, begin=self.start, end=self.start)
        self.goal = self._next_goal(entered=False)

    def advance(self, sensed: Sensed) -> Goal | None:
        """Return the goal of the next cycle, given what was sensed in the present one.

        Raises
        ------
        TaskStopped
            What was sensed tells that the assembly cannot go on.
        """
        self.state.seen.append(sensed)
        self.goal = self._next_goal(entered=True)
        return self.goal

    def _next_goal(self, *, entered: bool) -> Goal | None:
        """Return the goal of the first step that needs a cycle, from the present one on."""
        state = self.state
        while state.row < len(self.table):
            phase = self.table[state.row]
            if state.step == len(phase.steps):
                self._leave(phase)
                continue
            step = phase.steps[state.step]
            if (entered or step.enter(state)) and step.advance(state):
                return state.goal(self._alpha_ratio(step))
            state.step, entered = state.step + 1, False
        return None

    def _leave(self, phase: Phase) -> None:
        """Go to the next phase, or back by one for another attempt."""
        state = self.state
        state.step = 0
        if phase.retry is not None and phase.retry.needed(state):
            state.row, state.attempt = state.row - 1, state.attempt + 1
            return
        state.row += 1
        if phase.retry is not None:
            state.attempt = 0

    def _alpha_ratio(self, step: Step) -> float | None:
        if step.alpha_ratio is None:
            return None
        return min(step.alpha_ratio, self.state.posture.alpha / self.bend_rad)
