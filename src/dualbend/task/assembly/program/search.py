"""Steps that let holes down on their pins, and what is tried where they did not find them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np

from dualbend.task.assembly.program.held import PRESS_RATE_PER_S
from dualbend.task.assembly.program.motions import Posture, turned
from dualbend.task.assembly.program.state import State, Tried
from dualbend.task.assembly.program.steps import Motion, Move
from dualbend.types import Vector


def rigid(_: float) -> float:
    """Return how far a force holds up what does not yield: not at all."""
    return 0.0


class Support(Protocol):
    """What tells the force [N] that holds holes up."""

    def __call__(self, state: State, /, *, quick: bool = False) -> float:
        """Return its mean over half a second, or over the shorter time in which a motion ends."""


@dataclass(frozen=True, kw_only=True)
class HolePair:
    """Two holes that go down on their pins together, and the force by which a pin's tip is felt.

    ``coordinate`` of the posture falls to ``target`` and is ``highest`` at most; ``support`` tells
    the force [N]. Above ``touch_n`` it stops the motion; above ``missed_n``, or where the motion
    ended ``short`` of its target, the holes are not on their pins. ``softness``: motion per force
    [m/N] or [rad/N]. Pressed for ``patience_s`` without ``progress``, they come no further.
    ``yields``: how far a force [N] holds them above the coordinate. ``cannot``: what it means that
    they went ``felt`` down at two places, as with one hole on a pin, and did not come on; 0: of any
    end of the search. ``sunk``: height from where on down one of them must be on its pin.
    ``centre`` (2,) [m] between them, about which they turn. ``turning``: share of the least speed
    in turning with which they are sought: holes farther out move as fast as the middle.
    """

    name: Literal["middle", "outer"]
    coordinate: Literal["z", "alpha"]
    target: float
    support: Support
    touch_n: float
    missed_n: float
    short: float
    softness: float
    attempts: int
    cannot: str
    felt: float
    patience_s: float = math.inf
    progress: float = 0.0
    yields: Callable[[float], float] = rigid
    highest: float = math.inf
    sunk: float = -math.inf
    centre: Vector = field(default_factory=lambda: np.zeros(2))
    turning: float = 1.0

    def value(self, state: State) -> float:
        """Return the present value of the coordinate."""
        return float(getattr(state.posture, self.coordinate))

    def height(self, state: State) -> float:
        """Return how high the holes are, in the coordinate: arms were raised, the sheet yields."""
        raised = state.height if self.coordinate == "z" else 0.0
        return self.value(state) + raised + self.yields(self.support(state))

    def off(self, state: State) -> bool:
        """Tell whether the holes are not on their pins, by force or by height."""
        short = self.height(state) - self.target
        return self.support(state) >= self.missed_n or short > self.short

    def one_is_on(self, state: State) -> bool:
        """Tell whether the holes are so low that one must be on its pin, and the other is not."""
        return self.off(state) and self.height(state) <= self.sunk

    def missed(self, state: State) -> bool:
        """Tell whether to try again; stop the task after the last attempt."""
        if not self.off(state):
            return False
        support, height = self.support(state), self.height(state)
        short = height - self.target
        if state.attempt + 1 < self.attempts:
            state.tried.append(
                Tried(
                    place=state.came(),
                    wanted=state.sent(),
                    height=height,
                    moment=float(state.contact_wrench(state.mean().net, self.centre)[2]),
                )
            )
            return True
        held = "the sheet" if self.name == "middle" else "an end"
        tries = f"{self.attempts} attempt{'s' if self.attempts > 1 else ''}"
        reason = f"above {self.missed_n:.2f} N"
        if support < self.missed_n:
            left = f"{1e3 * short:.3g} mm" if self.coordinate == "z" else f"{short:.3g} rad"
            reason = f"{left} short of its place"
        highest = max((one.height for one in state.tried), default=0.0)
        low = sum(one.height <= highest - self.felt for one in state.tried)
        cannot = f"; {self.cannot}" if low >= 2 else ""
        raise state.stopped(
            f"the {self.name} holes did not find their pins in {tries}: "
            f"{held} is held up with {support:.2f} N, {reason}{cannot}"
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
        support = holes.support(state, quick=True)
        if not state.seeking and support <= holes.touch_n and state.go_on():
            return True
        state.seeking = 0.0
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
        back = PRESS_RATE_PER_S * self.pace.period_s * holes.softness * excess_n
        pressed = {holes.coordinate: min(max(value + back, self.bottom), holes.highest)}
        state.posture = replace(state.posture, **pressed)
        state.pressed, state.still = state.pressed + 1, state.still + 1
        state.seeking = holes.turning
        return True


@dataclass(frozen=True, kw_only=True)
class GoAside(Motion):
    """Go to the next place of the search, by what was felt at those before.

    Where the sheet came down ``felt`` [m] lower than elsewhere a hole is at the flank of its tip,
    and the other one is not because the sheet is turned. So it is turned there, by ``turn`` [rad]
    about ``centre`` (2,), as the moment about the vertical points, then the other way, then
    farther. Else the next of
    ``places`` (x, y) [m]. No place is tried that one before came ``near`` [m], half a turn.
    """

    places: Sequence[tuple[float, float]]
    turn: float
    centre: Vector
    felt: float
    near: float

    def target(self, state: State) -> Posture:
        """Stay as high and as bent as before."""
        x, y, yaw = (self.next(state.tried) + state.memory.start).tolist()
        return replace(state.posture, x=x, y=y, yaw=yaw)

    def next(self, tried: Sequence[Tried]) -> tuple[float, float, float]:
        """Return x, y [m] and yaw [rad] of the next place."""
        deepest = min(tried, key=lambda one: one.height)
        x, y, yaw = deepest.place.tolist()
        way, (cx, cy) = math.copysign(self.turn, deepest.moment), self.centre.tolist()
        turns = [n * way for n in (1, -1, 2, -2, 3, -3)]
        around = [(x + by * cy, y - by * cx, yaw + by) for by in turns]
        lattice = [(px, py, 0.0) for px, py in self.places]
        found = deepest.height <= max(one.height for one in tried) - self.felt
        for place in [*around, *lattice] if found else [*lattice, *around]:
            if not any(self._is_near(place, one) for t in tried for one in (t.place, t.wanted)):
                return place
        return lattice[len(tried) % len(lattice)]

    def _is_near(self, place: tuple[float, float, float], other: Vector) -> bool:
        away = math.hypot(place[0] - other[0], place[1] - other[1])
        return away < self.near and abs(place[2] - other[2]) < 0.5 * self.turn


@dataclass(frozen=True, kw_only=True)
class Turn(Motion):
    """Turn the sheet about ``centre`` (2,) [m] between its middle holes, otherwise each attempt.

    No farther than until its pins push back with ``most`` [N m]: they would be levered.
    """

    turns: Sequence[float]
    centre: Vector
    most: float

    def advance(self, state: State) -> bool:
        """Go on until the motion's time is over, or the pins push back."""
        if state.cycle >= state.quick_cycles:
            way = math.copysign(1.0, state.end.yaw - state.begin.yaw)
            net = state.mean_of("net", quick=True)
            if -way * state.contact_wrench(net, self.centre)[2] > self.most:
                return False
        return super().advance(state)

    def target(self, state: State) -> Posture:
        """Go from the turn of the attempt before to that of this one."""
        more = self.turns[state.attempt] - self.turns[state.attempt - 1]
        return turned(state.posture, more, self.centre)
