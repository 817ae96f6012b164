"""What the assembly's program is made of: motions that end by time, by force or by rest."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, fields, replace

import numpy as np

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.run.outcome import TaskStopped
from dualbend.scenario.assembly import AssemblyConfig
from dualbend.types import Vector

PHASES = (
    "approach",
    "grasp",
    "lift",
    "carry",
    "bend",
    "lower",
    "seat middle",
    "unfold",
    "lower outer",
    "seat outer",
    "release",
    "withdraw",
)

MEAN_CYCLES = 18
"""Half a second: over it the sensors' noise has a mean of some 0.02 N."""

_PRESS_RATE_PER_S = 2.0
"""Rate at which the press on a sheet that is held up is corrected; the loop bears four times it."""

_PEAK_OVER_MEAN_SPEED = 1.875
"""Of the polynomial of fifth degree that every motion follows."""


@dataclass(frozen=True, kw_only=True)
class Posture:
    """What the arms are told: where the sheet's middle is, its bend, and how the grippers stand.

    ``x, y, z`` [m] and ``yaw`` [rad] of the middle of the sheet's mid-plane, ``alpha`` its end
    slope, ``retreat`` [m] of each gripper outward from the sheet's end, ``opening`` [m] of a jaw.
    """

    x: float = 0.0
    y: float
    z: float
    yaw: float = 0.0
    alpha: float = 0.0
    retreat: float = 0.0
    opening: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Goal:
    """One cycle's nominal posture; how far the sheet complies, and what happens besides.

    ``bend``: bending angle over that at which the sheet is laid, None where it must not comply.
    ``seeking``: the sheet lies on the tips of pins, where it feels their flanks, not their sides.
    """

    phase: int
    posture: Posture
    bend: float | None = None
    seeking: bool = False
    attempt: int = 0


@dataclass(frozen=True, kw_only=True)
class Sensed:
    """What the robots know of the cycle: nothing that no sensor of theirs tells.

    ``net`` (4,): net force x, y, z [N] and moment about the vertical [N m] of the sheet on the
    arms. ``vertical`` (2,): of it the force z at each arm. ``gap`` (2,): between the pads [m].
    ``error_m``: of the grips from where they were sent, by the joints' encoders.
    """

    net: Vector
    vertical: Vector
    gap: Vector
    error_m: float


Steps = Generator[Goal, Sensed, None]


@dataclass(frozen=True, kw_only=True)
class Press:
    """A force that tells of a pin's tip: where it stops a motion, and what the motion does to it.

    ``touch_n`` [N]; ``softness``: motion per force [m/N] or [rad/N]; ``support`` tells the force.
    """

    touch_n: float
    softness: float
    support: Callable[[], float]


class Motions:
    """The program's motions, and what it has sensed of late.

    Parameters
    ----------
    config
        Speeds, time-outs, compliance.
    start
        Posture in which the arms begin.
    bend_rad
        Bending angle at which the sheet is laid.
    """

    def __init__(self, config: AssemblyConfig, start: Posture, bend_rad: float) -> None:
        self.config, self.bend_rad = config, bend_rad
        self.phase = self.attempts = 0
        self._posture = start
        self._seen: deque[Sensed] = deque(maxlen=MEAN_CYCLES)
        self._baseline: Sensed | None = None

    def _guarded(
        self,
        name: str,
        target: float,
        press: Press,
        *,
        speed: float | None = None,
        angle_speed: float | None = None,
        **others: float,
    ) -> Steps:
        """Go down until something holds the sheet up; give it time to find its pins, and go on.

        Meanwhile it is pressed lightly: the flank of a tip multiplies what presses on it. Gives
        up where the time for that is over, with the target not reached. Arms that do not comply
        just go.
        """
        waited = 0
        if self.config.compliance is None:
            yield from self._move(
                speed=speed,
                angle_speed=angle_speed,
                bend=None,
                until=None,
                **{name: target},
                **others,
            )
            return
        while getattr(self._posture, name) > target:
            yield from self._move(
                speed=speed,
                angle_speed=angle_speed,
                bend=1.0,
                until=lambda: press.support() > press.touch_n,
                **{name: target},
                **others,
            )
            while getattr(self._posture, name) > target and press.support() > 0.3 * press.touch_n:
                if waited * COMMAND_PERIOD_S > self.config.timeout_s:
                    return
                waited += 1
                over = press.support() - 0.8 * press.touch_n
                back = _PRESS_RATE_PER_S * COMMAND_PERIOD_S * press.softness * over
                there = getattr(self._posture, name) + back
                self._posture = replace(self._posture, **{name: max(there, target)})
                yield from self._step(self._bend_share(1.0), seeking=True)

    def _enter(self, phase: str, attempt: int = 0) -> None:
        self.phase, self.attempts = PHASES.index(phase), attempt

    def _stopped(self, reason: str) -> TaskStopped:
        return TaskStopped(f"{PHASES[self.phase]}: {reason}")

    def _step(self, bend: float | None, seeking: bool = False) -> Steps:
        sensed = yield Goal(
            phase=self.phase,
            posture=self._posture,
            bend=bend,
            seeking=seeking,
            attempt=self.attempts,
        )
        self._seen.append(sensed)

    def _move(
        self,
        *,
        speed: float | None = None,
        angle_speed: float | None = None,
        bend: float | None = None,
        until: Callable[[], bool] | None = None,
        **target: float,
    ) -> Steps:
        """Move along a polynomial of fifth degree, as long as its slowest part takes."""
        speeds, begin = self.config.speeds, self._posture
        end = replace(begin, **target)
        linear = speed or speeds.travel_m_per_s
        angular = angle_speed or speeds.unfold_rad_per_s
        way = math.dist((begin.x, begin.y, begin.z), (end.x, end.y, end.z))
        duration = _PEAK_OVER_MEAN_SPEED * max(
            max(way, abs(end.retreat - begin.retreat)) / linear,
            max(abs(end.alpha - begin.alpha), abs(end.yaw - begin.yaw)) / angular,
            abs(end.opening - begin.opening) / speeds.jaw_m_per_s,
        )
        cycles = max(1, math.ceil(duration / COMMAND_PERIOD_S))
        for n in range(1, cycles + 1):
            u = n / cycles
            share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
            self._posture = Posture(
                **{
                    f.name: _between(getattr(begin, f.name), getattr(end, f.name), share)
                    for f in fields(Posture)
                }
            )
            now = None if bend is None else self._bend_share(bend)
            yield from self._step(now)
            if until is not None and until():
                return
        self._posture = end

    def _bend_share(self, bend: float) -> float:
        return min(bend, self._posture.alpha / self.bend_rad)

    def _settle(self, bend: float | None = None) -> Steps:
        """Stay until the grips are where they were sent and the noise has been averaged out."""
        for _ in range(MEAN_CYCLES):
            yield from self._step(bend)
        yield from self._wait(
            lambda: self._seen[-1].error_m < 1e-3, "the grips are not where they were sent", bend
        )

    def _wait(self, done: Callable[[], bool], what: str, bend: float | None = None) -> Steps:
        cycles = math.ceil(self.config.timeout_s / COMMAND_PERIOD_S)
        for n in range(cycles):
            yield from self._step(bend)
            if n + 1 >= min(MEAN_CYCLES, cycles) and done():
                return
        raise self._stopped(f"{what} after {self.config.timeout_s:g} s")

    def _mean(self, cycles: int = MEAN_CYCLES) -> Sensed:
        last = list(self._seen)[-cycles:]
        return Sensed(
            net=np.mean([s.net for s in last], axis=0),
            vertical=np.mean([s.vertical for s in last], axis=0),
            gap=np.mean([s.gap for s in last], axis=0),
            error_m=max(s.error_m for s in last),
        )

    def _support(self, cycles: int = 5) -> float:
        """Return the force that holds the sheet up beside the arms [N]."""
        assert self._baseline is not None
        return float(self._mean(cycles).net[2] - self._baseline.net[2])

    def _end_support(self, cycles: int = 5) -> float:
        """Return the larger of the two arms' share of it [N]."""
        assert self._baseline is not None
        return float((self._mean(cycles).vertical - self._baseline.vertical).max())

    def contact_wrench(self, net: Vector) -> Vector:
        """Return force x, y and moment z that the sheet's contacts make, (3,) [N, N m]."""
        free = np.zeros(4) if self._baseline is None else self._baseline.net
        return np.asarray((net - free)[[0, 1, 3]])


def _between(begin: float, end: float, share: float) -> float:
    """Interpolate; rounding must not leave the range, nor change what stays."""
    return begin if begin == end else (1.0 - share) * begin + share * end
