"""Steps that feel whether a sheet is on its pins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dualbend.planning.geometry import Circle, circles, smallest_circle
from dualbend.scene.bed.config import Group, HolesConfig
from dualbend.task.assembly.config import AssemblyConfig
from dualbend.task.assembly.program.motions import turned
from dualbend.task.assembly.program.search import HolePair
from dualbend.task.assembly.program.state import Pushed, State
from dualbend.task.assembly.program.steps import Step
from dualbend.types import Vector

_M_PER_S, _SEEN_LATE_S, _STUCK_M = 3e-4, 0.3, 2e-3
"""How fast a sheet is moved to a pin, how late its force is noticed, how far arms may stick."""

_ALONG = Circle(np.zeros(2), 1.0)
"""For motions along and across, in which the force itself is meant."""

_ONE_PIN, _AT_AN_END = 0.5, 0.3
"""Share of the force across that one pin makes in turning, from where on it is one, not two.

At each end by itself, too: arms that stick may jump across between both.
"""

_TRAVELS = 1.2
"""Clearances that a hole travels at least in a turn if its pin lacks; found: 1.4 to 1.6, else 1.06.

Where arms that stick jump across as they turn, two pins push like one, but hold their holes.
"""

_PUSHED = 0.7
"""Share of what a pin bears with which a sheet may push it."""

_NO_PLAY = 0.5
"""Share of a play below which a turned sheet has none; arms that overshoot make some of it."""


@dataclass(frozen=True, kw_only=True)
class Feel(Step):
    """Send the sheet one way, until the encoders or the sensors tell that it is far enough.

    ``axis``: x, y or yaw, that about ``centre`` (2,) [m]; ``step``: of a cycle, one way or the
    other, [m] or [rad]. Arms that stick need not go where they are sent: ``most`` of motion, as
    the encoders tell it; sent further than that and ``slack``, an arm that has not moved is stuck.
    """

    axis: int
    centre: Vector
    step: float
    most: float
    slack: float

    @property
    def way(self) -> float:
        """The sign of the motion."""
        return math.copysign(1.0, self.step)

    def send(self, state: State) -> float | None:
        """Send the sheet a step further; where it has come or was sent too far, by how much."""
        place = state.seen[-1].place
        if state.cycle == 0:
            state.touch_from = place
        assert state.touch_from is not None
        moved = self.way * float(place[self.axis] - state.touch_from[self.axis])
        if moved > self.most or state.cycle * abs(self.step) > self.most + self.slack:
            return moved
        if self.axis == 2:
            state.posture = turned(state.posture, self.step, self.centre)
        else:
            name = "xy"[self.axis]
            here = getattr(state.posture, name) + self.step
            state.posture = replace(state.posture, **{name: here})
        state.cycle += 1
        return None

    @staticmethod
    def stay(state: State) -> None:
        """Send the sheet where it is: arms that stick would come after, and press on its pins."""
        posture, (x, y, yaw) = state.posture, state.seen[-1].behind.tolist()
        x, y, yaw = posture.x - x, posture.y - y, posture.yaw - yaw
        state.posture = replace(posture, x=x, y=y, yaw=yaw)


@dataclass(frozen=True, kw_only=True)
class TouchPins(Feel):
    """Move the sheet one way until its pins hold it; stop the task where they do not.

    They do where it is pushed back with ``force`` [N] or [N m]. ``must``: else it only ends there.
    """

    force: float
    must: bool = True

    def advance(self, state: State) -> bool:
        """Go on until the force is felt."""
        seen = state.seen[-1]
        wrench = state.contact_wrench(seen.net, self.centre)
        felt = -self.way * float(wrench[self.axis])
        if felt < self.force:
            moved = self.send(state)
            if moved is None:
                return True
            if self.must:
                raise state.stopped(self._said(moved, felt))
        state.pushed.append(Pushed(seen.place, wrench))
        self.stay(state)
        return False

    def _said(self, moved: float, felt: float) -> str:
        how = ("along it", "across it", "by turning it")[self.axis]
        way, push = ("mrad", "N m") if self.axis == 2 else ("mm", "N")
        return (
            f"not all holes are on their pins: moving the sheet {how} by {1e3 * moved:.2f} {way} "
            f"is held with {felt:.2f} {push}; pins would hold it with {self.force:.2f} {push} "
            f"within {1e3 * self.most:.2f} {way}"
        )


@dataclass(frozen=True, kw_only=True)
class Centre(Feel):
    """Go back to the middle between the last two contacts, as the encoders tell it.

    Arms that stick do not come there by being sent, and the next motion would begin at one end of
    the play.
    """

    def advance(self, state: State) -> bool:
        """Go on until it is there; what sticks all the way is left where it is."""
        ends, at = [place[self.axis] for place, _ in state.pushed], state.seen[-1].place[self.axis]
        if self.way * (float(np.mean(ends)) - float(at)) > 0.0 and self.send(state) is None:
            return True
        self.stay(state)
        return False


def _shares(pushed: Iterable[Pushed], places: Vector) -> tuple[list[float], list[float]]:
    """Return what the turned sheet of a pair of pins tells, whose ``places`` (2, 2) are given [m].

    The forces across the line between them at both ends of the turn [N], and their shares of what
    one pin alone makes with the moment there: of what changes between the ends, and at either.
    """
    (x, y), arm = (places[1] - places[0]).tolist(), smallest_circle(places)[1]
    x, y = x / (2.0 * arm), y / (2.0 * arm)
    # Force across the line between them, and moment: the second pin's have the same sign.
    one, other = (np.array([x * w[1] - y * w[0], w[2]]) for _, w in pushed)
    shares = [arm * float(f / m) for f, m in (other - one, one, other)]
    return [float(one[0]), float(other[0])], shares


@dataclass(frozen=True, kw_only=True)
class CheckPair(Step):
    """Stop the task where the sheet was turned one way and the other against one pin of a pair.

    Two pins hold the turning sheet with a couple of forces, ±F, across the line between them; one
    of them alone with F, so that the force across it is M/s, s half their distance, and changes its
    sign with the moment M about the middle between them. What two pins that stand off the middle of
    their play add to it does not. The hole that lacks its pin travels by ``least`` [m] or more.
    ``places`` (2, 2) of both in the sheet [m], ``names``.
    """

    names: tuple[str, str]
    places: Vector
    least: float

    def advance(self, state: State) -> bool:
        """Compare both ends of the turn."""
        (one, other), (both, *ends) = _shares(state.pushed, self.places)
        side = math.copysign(1.0, both)
        if abs(both) < _ONE_PIN or min(side * end for end in ends) < _AT_AN_END:
            return False
        lacks = 0 if side > 0.0 else 1
        x, y, turn = np.subtract(*(place for place, _ in state.pushed)).tolist()
        along, across = self.places[lacks].tolist()
        if math.hypot(x - turn * across, y + turn * along) < self.least:
            return False
        missing = self.names[lacks].replace("_", " ")
        raise state.stopped(
            f"the {missing} pin is not felt: turned one way and the other, the sheet "
            f"is pushed across with {one:.2f} and {other:.2f} N, by one pin; two would turn "
            "it without"
        )


@dataclass(frozen=True, kw_only=True)
class CheckPlay(Step):
    """Stop the task where a sheet that is held up was turned and both of its pins held it.

    So they do where one hole lies around the tip of its pin and cannot go down: pressed hard it has
    no ``play`` [rad], lightly it climbs the tip's flank, but bears its share of the turn, as
    :class:`CheckPair` has it of a pair at ``places``. A hole beside its pin bears none, and leaves
    the other one's play.
    """

    play: float
    force: float
    places: Vector

    def advance(self, state: State) -> bool:
        """Compare where the sheet was held, and by what."""
        one, other = state.pushed
        turned = float(one.place[2] - other.place[2])
        held = min(-one.wrench[2], other.wrench[2])
        both = _shares(state.pushed, self.places)[1][0] if len(self.places) == 2 else 1.0
        if held < self.force or (turned > _NO_PLAY * self.play and abs(both) > _ONE_PIN):
            return False
        raise state.stopped(
            "a middle hole is around the tip of its pin and does not go down: the turned sheet is "
            f"held after {1e3 * turned:.2f} mrad, where a hole and its pin as drawn leave "
            f"{1e3 * self.play:.2f}, with {abs(both):.2f} of the force across that one pin makes; "
            "the hole is too small, or the pin too thick"
        )


@dataclass(frozen=True, kw_only=True)
class PinGuard:
    """What stops the task where the sheet pushes the middle pins hard, before they are damaged.

    Both share a force across, one of them may bear all of one along, and a moment M presses them by
    M/2s, s their arm; what presses one against the other is not felt. ``most`` [N].
    ``outer_m``: arm of the outer pins, where it is asked while their holes lie on tips; one of them
    may be around its pin, which makes that moment with the force across.
    """

    arm_m: float
    most: float
    outer_m: float = 0.0

    @classmethod
    def of(cls, config: AssemblyConfig, least_n: float, least_nm: float) -> PinGuard | None:
        """Return an assembly's; None of arms that do not comply: they just go.

        ``least_n``, ``least_nm``: what sensors do not tell apart by their means; a single reading
        is no push below three times that.
        """
        if config.compliance is None:
            return None
        guard = cls(arm_m=circles(config.layout.holes)[0].radius_m, most=0.0)
        most = _PUSHED * config.limits.pin_force_n
        return replace(guard, most=max(most, 3.0 * guard.push(least_n, least_n, least_nm)))

    def push(self, along: float, across: float, moment: float) -> float:
        """Return with what a pin is pushed [N]."""
        moment = max(abs(moment) - self.outer_m * abs(across), 0.0)
        turning = moment / (2.0 * self.arm_m) if self.arm_m else 0.0
        return math.hypot(along, 0.5 * abs(across) + turning)

    def check(self, state: State) -> None:
        """Look at the last reading; where nothing was measured in the air, there is none."""
        if state.free is None or (self.outer_m and not state.seeking):
            return
        along, across, moment = state.contact_wrench(state.seen[-1].net).tolist()
        if (push := self.push(along, across, moment)) > self.most:
            raise state.stopped(
                f"the sheet pushes a middle pin with {push:.1f} N, above {self.most:g} N: by "
                f"{along:.1f} N along, {across:.1f} N across and {moment:.2f} N m"
            )


@dataclass(frozen=True, kw_only=True)
class WhereOneIsOn(Step):
    """A step that is made only where one hole of a pair is on its pin and the other is not."""

    holes: HolePair
    step: Step

    def advance(self, state: State) -> bool:
        """Ask once, where it begins."""
        if state.cycle == 0 and not self.holes.one_is_on(state):
            return False
        return self.step.advance(state)


@dataclass(frozen=True, kw_only=True)
class Feeling:
    """Steps that move the sheet from pin to pin, with ``force_n`` at most.

    ``rubber`` (3,): stiffness of both grips along x, y [N/m] and about the vertical [N m/rad];
    ``slower``: by which factor pins are felt for.
    """

    holes: HolesConfig
    force_n: float
    rubber: Vector
    period_s: float
    slower: int = 1

    def jammed(self, pair: HolePair) -> Iterator[Step]:
        """Turn the bent sheet where one of its middle holes is on its pin and the other is not."""
        gently, around = self._gently()
        if not around.radius_m:
            return
        play = self.holes.clearance_m / around.radius_m
        *touches, back = gently._touches(2, play, around, must=False)
        force, places = gently.force_n * around.radius_m, self.holes.places_of("middle")
        check = CheckPlay(play=play, force=force, places=places)
        for step in (*touches, check, back):
            yield WhereOneIsOn(holes=pair, step=step)

    def middle(self) -> Iterator[Step]:
        """Turn the bent sheet on its middle pins alone: the outer ones would hide that one lacks.

        They are near each other: the same motion and moment would press them harder. One hole does
        not hold a turn, and of three or more any two do.
        """
        gently, around = self._gently()
        for check in self._pair("middle", least=0.0):
            play = self.holes.clearance_m / around.radius_m
            *touches, back = gently._touches(2, 2.0 * play, around)
            yield from (*touches, check, back)

    def all(self) -> Iterator[Step]:
        """Move the sheet along, across and turning about the vertical.

        A seated sheet has its clearance c, and what yields to the force at both ends. One that no
        pins hold goes on; one that only the middle pins hold turns c/s, s the largest distance of
        one from the middle of the outer holes, before they do, and is stopped midway between that
        and the play of the outer ones.
        """
        c, around = self.holes.clearance_m, circles(self.holes)[1]
        for axis in (0, 1):
            yield from self._touches(axis, 2.0 * c)
        far, away = around.radius_m, self.holes.places_of("middle") - around.centre_m
        near = float(np.hypot(*away.T).max())
        free = 0.5 * (c / far + c / near) if 0.0 < near < far else 2.0 * c / far
        *touches, back = self._touches(2, free, around)
        yield from (*touches, *self._pair("outer", least=_TRAVELS * c), back)

    def _gently(self) -> tuple[Feeling, Circle]:
        """Return what feels middle pins, and the circle around them."""
        gently = replace(self, force_n=0.5 * self.force_n, slower=2)
        return gently, circles(self.holes)[0]

    def _pair(self, group: Group, *, least: float) -> Iterator[CheckPair]:
        """Yield what tells which one of two pins is missing; ``least`` as `CheckPair` has it."""
        names, places = self.holes.names_of(group), self.holes.places_of(group)
        if len(names) == 2:
            yield CheckPair(names=(names[0], names[1]), places=places, least=least)

    def _touches(
        self, axis: int, free: float, around: Circle = _ALONG, *, must: bool = True
    ) -> Iterator[Feel]:
        """Move the sheet one way, the other, and back; it may move freely by ``free`` [m] or [rad].

        It is turned about the centre of a circle, with the force at its radius.
        """
        centre, arm = around
        force, speed = self.force_n * arm, _M_PER_S / self.slower / arm
        yields = 2.0 * force / float(self.rubber[axis]) + _SEEN_LATE_S * speed
        most, slack, step = free + yields, _STUCK_M / arm, speed * self.period_s
        for each in (step, -step):
            yield TouchPins(
                axis=axis,
                centre=centre,
                step=each,
                most=most,
                slack=slack,
                force=force,
                must=must,
            )
        yield Centre(axis=axis, centre=centre, step=step, most=most, slack=slack)
