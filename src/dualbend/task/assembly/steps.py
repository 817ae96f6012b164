"""The kinds of steps that the assembly's program is made of.

A step holds what is the same for every execution of the program; what changes is in the `State`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dualbend.task.assembly.motions import Pace, interpolate
from dualbend.task.assembly.state import MEAN_CYCLES, SUPPORT_CYCLES, State
from dualbend.types import SIDES

_PRESS_RATE_PER_S = 2.0
"""Rate at which the press on a sheet that is held up is corrected; the loop bears four times it."""

_LEVEL_RATE_PER_S = 1.0
"""The same of what holds up each end of a flat sheet, which may be shorter and stiffer."""

_SLACK_RATE_PER_S = 5.0
"""The same of the tension of a flat sheet, if arms were rigid; as they are not, it is far less."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One line of the table.

    ``alpha_ratio``: the compliance is that of a sheet bent as far as it is now, and at most this
    far, over the bending angle at which it is laid; None: no compliance. ``retry_only``: not in the
    first attempt.
    """

    alpha_ratio: float | None = None
    retry_only: bool = False

    def advance(self, state: State) -> bool:
        """Choose the next cycle's posture, the first one at ``state.cycle`` 0; False: it is over.

        A step that is over in the first needs no cycle.
        """
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Move(Step):
    """Move some components of the posture, each to a value or to one value for each attempt."""

    to: Mapping[str, float | tuple[float, ...]]
    pace: Pace

    def advance(self, state: State) -> bool:
        """Go on until the motion's time is over."""
        if state.cycle == 0:
            target = {
                name: value[state.attempt] if isinstance(value, tuple) else value
                for name, value in self.to.items()
            }
            state.begin, state.end = state.posture, replace(state.posture, **target)
            state.cycles = self.pace.cycles(state.begin, state.end)
        return state.go_on()


@dataclass(frozen=True, kw_only=True)
class HolePair:
    """Two holes that go down on their pins together, and the force by which a pin's tip is felt.

    ``coordinate`` of the posture falls to ``target``; ``support`` tells the force [N]. Above
    ``touch_n`` it stops the motion; above ``missed_n``, or where the motion ended ``short`` of its
    target, the holes are not on their pins. ``softness``: motion per force [m/N] or [rad/N].
    Pressed for ``patience_s`` without ``progress``, they come no further.
    """

    name: Literal["middle", "outer"]
    coordinate: Literal["z", "alpha"]
    target: float
    support: Callable[[State, int], float]
    touch_n: float
    missed_n: float
    short: float
    softness: float
    attempts: int
    patience_s: float = math.inf
    progress: float = 0.0

    def value(self, state: State) -> float:
        """Return the present value of the coordinate."""
        return float(getattr(state.posture, self.coordinate))

    def missed(self, state: State) -> bool:
        """Tell whether to try again; stop the task after the last attempt."""
        support, short = self.support(state, MEAN_CYCLES), self.value(state) - self.target
        if support < self.missed_n and short <= self.short:
            return False
        if state.attempt + 1 < self.attempts:
            return True
        held = "the sheet" if self.name == "middle" else "an end"
        reason = f"above {self.missed_n:.2f} N"
        if support < self.missed_n:
            left = f"{1e3 * short:.3g} mm" if self.coordinate == "z" else f"{short:.3g} rad"
            reason = f"{left} short of its place"
        raise state.stopped(
            f"the {self.name} holes did not find their pins in {self.attempts} attempts: "
            f"{held} is held up with {support:.2f} N, {reason}"
        )


@dataclass(frozen=True, kw_only=True)
class MoveDown(Move):
    """Move until something holds the sheet up; give it time to find its pins, and go on.

    Meanwhile it is pressed lightly: the flank of a tip multiplies what presses on it. The step
    ends above its target where the time for that is over; it is left out where the one before has
    not come down to ``top``.
    """

    holes: HolePair
    bottom: float
    top: float = math.inf
    timeout_s: float

    def advance(self, state: State) -> bool:
        """Go on, press or end, by the force that holds the sheet up."""
        holes, value = self.holes, self.holes.value(state)
        if state.cycle == 0:
            state.lowest, state.still = value, 0
            return self.bottom < value <= self.top and super().advance(state)
        support = holes.support(state, SUPPORT_CYCLES)
        if not state.seeking and support <= holes.touch_n and state.go_on():
            return True
        state.seeking = False
        if value <= self.bottom:
            return False
        if support <= 0.3 * holes.touch_n:
            state.cycle = 0
            return super().advance(state)
        if value < state.lowest - holes.progress:
            state.lowest, state.still = value, 0
        period_s = self.pace.period_s
        if state.pressed * period_s > self.timeout_s or state.still * period_s > holes.patience_s:
            return False
        # Up or down a little, to reduce the excess of force.
        excess_n = support - 0.8 * holes.touch_n
        back = _PRESS_RATE_PER_S * self.pace.period_s * holes.softness * excess_n
        pressed = {holes.coordinate: max(value + back, self.bottom)}
        state.posture = replace(state.posture, **pressed)
        state.pressed, state.still, state.seeking = state.pressed + 1, state.still + 1, True
        return True


@dataclass(frozen=True, kw_only=True)
class Wait(Step):
    """Stay until a quantity lies between two bounds, and stop the task where it takes too long.

    It is looked at after half a second, or where the time-out ends before; ``rest_cycles`` pass
    before all that.
    """

    quantity: Callable[[State], float]
    above: float = -math.inf
    below: float = math.inf
    otherwise: str
    timeout_s: float
    period_s: float
    rest_cycles: int = 0

    def advance(self, state: State) -> bool:
        """Stay for another cycle, or stop the task."""
        waited, allowed = state.cycle - self.rest_cycles, math.ceil(self.timeout_s / self.period_s)
        if waited >= min(MEAN_CYCLES, allowed):
            if self.above < self.quantity(state) < self.below:
                return False
            if waited == allowed:
                raise state.stopped(f"{self.otherwise} after {self.timeout_s:g} s")
        state.cycle += 1
        return True


@dataclass(frozen=True, kw_only=True)
class Press(Step):
    """Press the seated middle as hard as is wanted: arms do not know how high they stand.

    Their height changes with the excess of force, by ``most`` at most, until a third of the force
    is all that it is off by, or for ``timeout_s``.
    """

    force: float
    softness: float
    most: float
    timeout_s: float
    period_s: float

    def advance(self, state: State) -> bool:
        """Go up or down a little."""
        excess = state.support(SUPPORT_CYCLES) - self.force
        at_the_end = abs(state.height) == self.most and excess * state.height > 0.0
        waited = state.cycle * self.period_s
        if abs(excess) <= self.force / 3 or at_the_end or waited > self.timeout_s:
            return False
        moved = state.height + _PRESS_RATE_PER_S * self.period_s * self.softness * excess
        state.height = min(max(moved, -self.most), self.most)
        state.cycle += 1
        return True


@dataclass(frozen=True, kw_only=True)
class Level(Step):
    """Raise or lower each arm by itself until the flat sheet's end neither carries nor pulls it.

    The end of a flat sheet holds up an arm that is 0.3 mm too low as much as a tip does, but not
    one that is raised by ``most`` [m]. Until it is within ``force`` [N], or for ``timeout_s``.
    """

    force: float
    softness: float
    most: float
    timeout_s: float
    period_s: float

    def advance(self, state: State) -> bool:
        """Raise or lower them a little."""
        excess, levels = state.ends_held_up(SUPPORT_CYCLES), np.array(state.levels)
        at_the_end = (np.abs(levels) == self.most) & (excess * levels > 0.0)
        off = (np.abs(excess) > self.force) & ~at_the_end
        if not off.any() or state.cycle * self.period_s > self.timeout_s:
            return False
        moved = levels + _LEVEL_RATE_PER_S * self.period_s * self.softness * excess * off
        left, right = np.clip(moved, -self.most, self.most).tolist()
        state.levels = left, right
        state.cycle += 1
        return True


@dataclass(frozen=True, kw_only=True)
class Slacken(Step):
    """Wait for rest, and for `Slack` to take the tension off: the last arm would pull the sheet."""

    slack: Slack
    timeout_s: float

    def advance(self, state: State) -> bool:
        """Wait for another cycle."""
        late = state.cycle * self.slack.period_s > self.timeout_s
        if state.cycle >= MEAN_CYCLES and (late or not self.slack.excess(state)):
            return False
        state.cycle += 1
        return True


@dataclass(frozen=True)
class Measure(Step):
    """Keep the mean of the last half second for later comparison."""

    name: Literal["empty", "free", "seated"]

    def advance(self, state: State) -> bool:
        """Keep it."""
        setattr(state, self.name, state.mean())
        return False


@dataclass(frozen=True, kw_only=True)
class TouchPins(Step):
    """Move the sheet one way until its pins hold it; stop the task where they do not.

    ``axis``: x, y or yaw; ``step``: of a cycle, one way or the other, [m] or [rad]. They hold it
    where it is pushed back with ``force`` [N] or [N m], within ``most`` of motion, as the encoders
    tell it: arms that stick need not go where they are sent. ``slack``: sent further, an arm that
    has not moved is stuck.
    """

    axis: int
    step: float
    force: float
    most: float
    slack: float

    def advance(self, state: State) -> bool:
        """Go on until the force is felt."""
        seen, name, way = state.seen[-1], ("x", "y", "yaw")[self.axis], math.copysign(1, self.step)
        if state.cycle == 0:
            state.begin, state.touch_from = state.posture, seen.place
        assert state.touch_from is not None
        felt = -way * float(state.contact_wrench(seen.net)[self.axis])
        if felt >= self.force:
            return False
        moved = way * float(seen.place[self.axis] - state.touch_from[self.axis])
        sent = abs(state.cycle * self.step)
        if moved > self.most or sent > self.most + self.slack:
            raise state.stopped(self._said(moved, felt))
        here = getattr(state.posture, name) + self.step
        state.posture, state.cycle = replace(state.posture, **{name: here}), state.cycle + 1
        return True

    def _said(self, moved: float, felt: float) -> str:
        how = ("along it", "across it", "by turning it")[self.axis]
        way, push = ("mrad", "N m") if self.axis == 2 else ("mm", "N")
        return (
            f"not all holes are on their pins: moving the sheet {how} by {1e3 * moved:.2f} {way} "
            f"is held with {felt:.2f} {push}; pins would hold it with {self.force:.2f} {push} "
            f"within {1e3 * self.most:.2f} {way}"
        )


@dataclass(frozen=True, kw_only=True)
class Centre(Step):
    """Go back by half of the motion from one contact to the other."""

    pace: Pace

    def advance(self, state: State) -> bool:
        """Go on until the motion's time is over."""
        if state.cycle == 0:
            middle = interpolate(state.posture, state.begin, 0.5)
            state.begin, state.end = state.posture, middle
            state.cycles = self.pace.cycles(state.begin, state.end)
        return state.go_on()


@dataclass(frozen=True)
class CheckGrasp(Step):
    """Stop the task where jaws have closed with no sheet between them."""

    thickness_m: float

    def advance(self, state: State) -> bool:
        """Compare the gaps with half of the thickness."""
        for side, gap in zip(SIDES, state.mean().gap, strict=True):
            if gap < 0.5 * self.thickness_m:
                raise state.stopped(
                    f"nothing is between the {side} jaws: they closed to {1e3 * gap:.2f} mm, "
                    f"the sheet has {1e3 * self.thickness_m:.2f} mm"
                )
        return False


@dataclass(frozen=True)
class CheckWeight(Step):
    """Stop the task where the arms carry something else than the sheet."""

    weight_n: float

    def advance(self, state: State) -> bool:
        """Compare what has been added to the empty grippers; allow for half of the weight."""
        assert state.empty is not None
        carried = float(state.empty.net[2] - state.mean().net[2])
        if not 0.5 * self.weight_n < carried < 1.5 * self.weight_n:
            raise state.stopped(
                f"the arms carry {carried:.2f} N, the sheet weighs {self.weight_n:.2f} N"
            )
        return False


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
        tension, alpha = state.mean(SUPPORT_CYCLES).tension, state.posture.alpha
        lowest = -self.force - (self.buckling_n if alpha else 0.0)
        return 0.0 if alpha > self.flat_rad else tension - min(max(tension, lowest), self.force)

    def update(self, state: State) -> None:
        """Go in or out a little."""
        step = _SLACK_RATE_PER_S * self.period_s * self.softness * self.excess(state)
        state.slack = min(max(state.slack - step, -self.most), self.most)


@dataclass(frozen=True)
class Phase:
    """A phase of the program; where ``holes`` are not on their pins at its end, back by one.

    ``slack``: acts in all its steps.
    """

    name: str
    steps: Sequence[Step]
    holes: HolePair | None = None
    slack: Slack | None = None
