"""The numbers that one execution of the assembly's program changes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dualbend.run.outcome import TaskStopped
from dualbend.task.assembly.program.memory import Memory
from dualbend.task.assembly.program.motions import PHASES, Posture, Sensed, interpolate
from dualbend.types import Vector

_MEAN_S, _QUICK_S = 0.504, 0.14
"""Half a second, over which the sensors' noise has a mean of some 0.02 N; and the time over which a
force is averaged that ends a motion."""


_MIDDLE, _ALIKE = np.zeros(2), np.ones(2)


def mean_cycles(period_s: float) -> int:
    """Return the cycles of ``period_s`` [s] over which what is sensed is averaged."""
    return max(round(_MEAN_S / period_s), 1)


class Pushed(NamedTuple):
    """How a sheet was held that was moved to a pin.

    ``place``: x, y [m] and yaw [rad] (3,) by the encoders; ``wrench``: force x, y and moment z (3,)
    of its contacts.
    """

    place: Vector
    wrench: Vector


class Tried(NamedTuple):
    """Where holes were let down in vain.

    ``place``, ``wanted``: x, y [m] and yaw [rad] (3,) where they came to and where they were sent,
    as far as the robots know, from where they were lowered first. ``height`` [m] of the middle;
    ``moment`` [N m] about the vertical.
    """

    place: Vector
    wanted: Vector
    height: float
    moment: float


@dataclass(kw_only=True)
class State:
    """Where an execution stands in the table, and what it has sensed; copyable in every cycle.

    ``row``: phase, counted through all sheets; ``step`` of it; ``attempt``. ``cycle``: cycles spent
    in the step, of at most ``cycles``. ``begin``, ``end``: of the present motion. ``pressed``:
    cycles in which a held up sheet was pressed on, ``still`` of them since it was at ``lowest``;
    ``seeking``: it is now, with this share of the least speed in turning. ``seen``: the last
    measurements; ``empty``, ``free``: their means with empty jaws, and with the bent sheet in the
    air; ``seated``: on the middle pins, the outer holes above theirs. ``height`` [m]: by how
    much the arms are raised, since by the press on the middle they stand too low; ``slack``
    [m]: by how much farther out each is, since the flat sheet was pushed; ``levels`` (2,) [m]:
    by how much each is higher, since its end was held up. ``touch_from``: place from which the
    sheet is moved towards a pin; ``pushed``: by pins, the last two times. ``tried``: places at
    which the present pair of holes did not find its pins. ``memory`` of the sheets before.
    """

    posture: Posture
    period_s: float
    row: int = 0
    step: int = 0
    attempt: int = 0
    cycle: int = 0
    cycles: int = 0
    begin: Posture
    end: Posture
    pressed: int = 0
    tried: list[Tried] = field(default_factory=list)
    still: int = 0
    lowest: float = 0.0
    seeking: float = 0.0
    seen: deque[Sensed] = field(init=False)
    empty: Sensed | None = None
    free: Sensed | None = None
    seated: Sensed | None = None
    height: float = 0.0
    slack: float = 0.0
    levels: tuple[float, float] = (0.0, 0.0)
    touch_from: Vector | None = None
    pushed: deque[Pushed] = field(default_factory=lambda: deque(maxlen=2))
    memory: Memory = field(default_factory=Memory)

    def __post_init__(self) -> None:
        """Keep as many measurements as are averaged."""
        self.seen = deque(maxlen=mean_cycles(self.period_s))

    @property
    def mean_cycles(self) -> int:
        """Cycles over which what is sensed is averaged."""
        return mean_cycles(self.period_s)

    @property
    def quick_cycles(self) -> int:
        """Cycles over which a force is averaged that ends a motion."""
        return max(round(_QUICK_S / self.period_s), 1)

    @property
    def phase(self) -> int:
        """Index into `PHASES`: each sheet goes through all of them."""
        return self.row % len(PHASES)

    @property
    def laid(self) -> int:
        """Number of sheets that have been laid."""
        return self.row // len(PHASES)

    def stopped(self, reason: str) -> TaskStopped:
        """Return the exception that ends the task in this phase."""
        return TaskStopped(f"{PHASES[self.phase]}: {reason}")

    def go_on(self) -> bool:
        """Take the next cycle of the present motion; False where it has arrived."""
        if self.cycle == self.cycles:
            return False
        self.cycle += 1
        self.posture = interpolate(self.begin, self.end, self.cycle / self.cycles)
        return True

    def sent(self) -> Vector:
        """Return where the sheet is sent, from where it was lowered first (3,)."""
        posture = self.posture
        return np.array([posture.x, posture.y, posture.yaw]) - self.memory.start

    # -- what has been sensed -----------------------------------------------------------------

    def came(self) -> Vector:
        """Return where the sheet came to, from where it was in the air (3,)."""
        assert self.free is not None
        return self.mean_of("place") - self.free.place

    def mean(self, *, quick: bool = False) -> Sensed:
        """Return the mean of the last measurements, and the largest error of the grips."""
        return Sensed(
            net=self.mean_of("net", quick=quick),
            vertical=self.mean_of("vertical", quick=quick),
            moment=self.mean_of("moment", quick=quick),
            tension=float(self.mean_of("tension", quick=quick)),
            gap=self.mean_of("gap", quick=quick),
            error_m=max(sensed.error_m for sensed in self._last(quick=quick)),
            place=self.mean_of("place", quick=quick),
            behind=self.mean_of("behind", quick=quick),
        )

    def mean_of(self, name: str, *, quick: bool = False) -> Vector:
        """Return the mean of the last measurements of one quantity of `Sensed`."""
        of_all = [getattr(sensed, name) for sensed in self._last(quick=quick)]
        return np.asarray(np.mean(of_all, axis=0))

    def _last(self, *, quick: bool) -> list[Sensed]:
        last = list(self.seen)
        return last[-self.quick_cycles :] if quick else last

    def support(self, *, quick: bool = False) -> float:
        """Return the force that holds the sheet up besides the arms [N]."""
        assert self.free is not None
        return float(self.mean_of("net", quick=quick)[2] - self.free.net[2])

    def end_support(self, *, quick: bool = False, shares: Vector = _ALIKE) -> float:
        """Return what holds an arm up besides the middle pins, the larger one of both [N].

        ``shares`` (2,) of each end's force that count: one that is stiffer is held up with more.
        """
        return float((shares * self.ends_held_up(quick=quick)).max())

    def ends_held_up(self, *, quick: bool = False) -> Vector:
        """Return what holds each arm up besides the middle pins (2,) [N]."""
        assert self.seated is not None
        return self.mean_of("vertical", quick=quick) - self.seated.vertical

    def grip_error(self) -> float:
        """Return the distance of the grips from where they were sent [m]."""
        return self.seen[-1].error_m

    def jaw_travel(self) -> float:
        """Return how much a gap between pads has changed of late [m]."""
        return float(np.ptp([s.gap for s in self.seen], axis=0).max())

    def jaw_gap(self) -> float:
        """Return the smaller one of the gaps between the pads [m]."""
        return float(self.seen[-1].gap.min())

    def contact_wrench(self, net: Vector, about_m: Vector = _MIDDLE) -> Vector:
        """Return force x, y and moment z that the sheet's contacts make, (3,) [N, N m].

        The moment is about a point of the sheet, x, y from its middle.
        """
        free = np.zeros(4) if self.free is None else self.free.net
        x, y, moment = (net - free)[[0, 1, 3]]
        return np.array([x, y, moment - (about_m[0] * y - about_m[1] * x)])
