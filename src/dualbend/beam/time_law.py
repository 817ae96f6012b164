"""Time laws of the end slope: α(t) between two values at a given speed."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dualbend.beam._check import Real, finite, like, positive


class TimeLaw(Protocol):
    """A time law α(t); before the start and after the end α is constant."""

    @property
    def duration_s(self) -> float:
        """Time from the start to the end [s]."""

    def at(self, t: Real) -> Real:
        """Return α [rad] at the time t [s] since the start."""


@dataclass(frozen=True)
class _Motion:
    """From one end slope to another, folding or unfolding; the speed is a magnitude."""

    start_rad: float
    end_rad: float
    speed_rad_per_s: float

    def __post_init__(self) -> None:
        finite("start_rad", self.start_rad)
        finite("end_rad", self.end_rad)
        positive("speed_rad_per_s", self.speed_rad_per_s)

    @property
    def _way_rad(self) -> float:
        return abs(self.end_rad - self.start_rad)


class ConstantSpeed(_Motion):
    """Constant speed, α(t) = α₀ ± ω t, with a jump of the speed at start and end."""

    @property
    def duration_s(self) -> float:
        """|α₁ − α₀| / ω [s]."""
        return self._way_rad / self.speed_rad_per_s

    def at(self, t: Real) -> Real:
        """Return α [rad]; exactly the end values before the start and from the end on."""
        times = np.asarray(t, dtype=np.float64)
        way = np.copysign(self.speed_rad_per_s, self.end_rad - self.start_rad)
        moving = self.start_rad + way * np.maximum(times, 0.0)
        return like(t, np.where(times >= self.duration_s, self.end_rad, moving))


@dataclass(frozen=True)
class TrapezoidalSpeed(_Motion):
    """Trapezoidal speed: constant acceleration, constant speed, constant deceleration.

    If the distance is shorter than ω²/a the speed is not reached: the profile is a triangle.
    """

    acceleration_rad_per_s2: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("acceleration_rad_per_s2", self.acceleration_rad_per_s2)

    @property
    def top_speed_rad_per_s(self) -> float:
        """The speed that is reached, min(ω, √(a |α₁ − α₀|)) [rad/s]."""
        return min(self.speed_rad_per_s, math.sqrt(self.acceleration_rad_per_s2 * self._way_rad))

    @property
    def duration_s(self) -> float:
        """|α₁ − α₀| / ω + ω / a with the speed ω that is reached [s]."""
        top = self.top_speed_rad_per_s
        if top == 0.0:
            return 0.0
        return self._way_rad / top + top / self.acceleration_rad_per_s2

    def at(self, t: Real) -> Real:
        """Return α [rad]; exactly the end values before the start and from the end on."""
        since = np.clip(np.asarray(t, dtype=np.float64), 0.0, self.duration_s)
        left = self.duration_s - since
        a, top = self.acceleration_rad_per_s2, self.top_speed_rad_per_s
        ramp = top / a
        sign = np.sign(self.end_rad - self.start_rad)
        first = self.start_rad + sign * np.where(
            since < ramp, 0.5 * a * since**2, top * (since - 0.5 * ramp)
        )
        # The last ramp is counted from the end, so that the end is met exactly.
        last = self.end_rad - sign * 0.5 * a * left**2
        return like(t, np.where(left < ramp, last, first))
