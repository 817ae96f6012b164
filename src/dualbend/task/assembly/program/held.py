"""What finds, by the held sheet, what arms do not know of themselves: heights and distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dualbend.task.assembly.program.state import State
from dualbend.task.assembly.program.steps import Step
from dualbend.types import Vector

PRESS_RATE_PER_S = 2.0
"""Rate at which the press on a sheet that is held up is corrected; the loop bears four times it."""

_LEVEL_RATE_PER_S = 1.0
"""The same of what holds up each end of a flat sheet, which may be shorter and stiffer."""

_SLACK_RATE_PER_S = 5.0
"""The same of the tension of a flat sheet, if arms were rigid; as they are not, it is far less."""


@dataclass(frozen=True, kw_only=True)
class Correction(Step):
    """Raise or lower arms little by little, for ``timeout_s`` and by ``most`` [m] at most.

    ``force`` [N] that is wanted, or let be.
    """

    force: float
    most: float
    timeout_s: float
    period_s: float

    def late(self, state: State) -> bool:
        """Tell whether the time is over."""
        return state.cycle * self.period_s > self.timeout_s


@dataclass(frozen=True, kw_only=True)
class Press(Correction):
    """Press the seated middle as hard as is wanted: arms do not know how high they stand.

    Their height changes with the excess of force until that is at most ``band`` [N]. ``softness``
    [m/N] of what is pressed on.
    """

    softness: float
    band: float

    def advance(self, state: State) -> bool:
        """Go up or down a little."""
        excess = state.support() - self.force
        at_the_end = abs(state.height) == self.most and excess * state.height > 0.0
        if abs(excess) <= self.band or at_the_end or self.late(state):
            return False
        moved = state.height + PRESS_RATE_PER_S * self.period_s * self.softness * excess
        state.height = min(max(moved, -self.most), self.most)
        state.cycle += 1
        return True


@dataclass(frozen=True, kw_only=True)
class Slack:
    """What keeps a sheet that is all but flat between two arms without tension.

    Arms do not know their distance to some tenths of a millimetre, a flat sheet does not yield, and
    integral action of the servos goes on until it does. ``force`` [N]: of tension that is let be;
    ``buckling_n``: end force of a sheet that is bent a little. Beyond them the arms come together,
    or go apart, by ``most`` [m] at most. ``softness`` [m/N] of both grips. Bent beyond ``flat_rad``
    a sheet takes up what arms are off.
    """

    force: float
    buckling_n: float
    softness: float
    most: float
    flat_rad: float
    period_s: float

    def excess(self, state: State) -> float:
        """Return the tension beyond what is let be [N]."""
        tension, alpha = float(state.mean_of("tension", quick=True)), state.posture.alpha
        lowest = -self.force - (self.buckling_n if alpha else 0.0)
        return 0.0 if alpha > self.flat_rad else tension - min(max(tension, lowest), self.force)

    def update(self, state: State) -> None:
        """Go in or out a little."""
        step = _SLACK_RATE_PER_S * self.period_s * self.softness * self.excess(state)
        state.slack = min(max(state.slack - step, -self.most), self.most)


@dataclass(frozen=True, kw_only=True)
class Level(Correction):
    """Raise or lower each arm by itself until the flat sheet's end neither carries nor pulls it.

    The end of a flat sheet holds up an arm that is 0.3 mm too low as much as a tip does, but not
    one that is raised by ``most`` [m]. ``softness`` (2,) [m/N] of the ends. Then it waits until
    what was felt before is forgotten: by half a second's mean it is told whether the ends are still
    held up.
    """

    softness: Vector

    def advance(self, state: State) -> bool:
        """Raise or lower them a little."""
        if state.cycle == 0:
            state.still = state.mean_cycles
        excess, levels = state.ends_held_up(quick=True), np.array(state.levels)
        at_the_end = (np.abs(levels) == self.most) & (excess * levels > 0.0)
        off = (np.abs(excess) > self.force) & ~at_the_end
        state.cycle += 1
        if not off.any() or self.late(state):
            state.still += 1
            return state.still < state.mean_cycles
        state.still = 0
        moved = levels + _LEVEL_RATE_PER_S * self.period_s * self.softness * excess * off
        left, right = np.clip(moved, -self.most, self.most).tolist()
        state.levels = left, right
        return True


@dataclass(frozen=True, kw_only=True)
class Slacken(Step):
    """Wait for rest, and for `Slack` to take the tension off: the last arm would pull the sheet."""

    slack: Slack
    timeout_s: float

    def advance(self, state: State) -> bool:
        """Wait for another cycle."""
        late = state.cycle * self.slack.period_s > self.timeout_s
        if state.cycle >= state.mean_cycles and (late or not self.slack.excess(state)):
            return False
        state.cycle += 1
        return True
