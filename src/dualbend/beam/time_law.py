"""Time laws of the end slope: α(t) between two values at a given speed."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dualbend.beam._check import FloatArray, Real, finite, like, positive


class TimeLaw(Protocol):
    """A time law α(t); before the start and after the end α is constant."""

    @property
    def duration_s(self) -> float:
        """Time from the start to the end [s]."""

    def at(self, t: Real) -> Real:
        """Return α [rad] at the time t [s] since the start."""

    def rate(self, t: Real) -> Real:
        """Return dα/dt [rad/s] at the time t [s] since the start."""


@dataclass(frozen=True)
class ConstantSpeed:
    """Constant speed, α(t) = α₀ ± ω t, with a jump of the speed at start and end.

    end_rad may be below start_rad (unfolding); the speed is a magnitude, above 0.
    """

    start_rad: float
    end_rad: float
    speed_rad_per_s: float

    def __post_init__(self) -> None:
        finite("start_rad", self.start_rad)
        finite("end_rad", self.end_rad)
        positive("speed_rad_per_s", self.speed_rad_per_s)

    @property
    def duration_s(self) -> float:
        """|α₁ − α₀| / ω [s]."""
        return abs(self.end_rad - self.start_rad) / self.speed_rad_per_s

    def at(self, t: Real) -> Real:
        """Return α [rad]; exactly the end values before the start and from the end on."""
        times = np.asarray(t, dtype=np.float64)
        way = np.copysign(self.speed_rad_per_s, self.end_rad - self.start_rad)
        moving = self.start_rad + way * np.maximum(times, 0.0)
        return like(t, np.where(times >= self.duration_s, self.end_rad, moving))

    def rate(self, t: Real) -> Real:
        """Return ± ω while moving, else 0 [rad/s]."""
        times = np.asarray(t, dtype=np.float64)
        way = np.copysign(self.speed_rad_per_s, self.end_rad - self.start_rad)
        return like(t, np.where((times >= 0.0) & (times < self.duration_s), way, 0.0))


@dataclass(frozen=True)
class TrapezoidalSpeed:
    """Trapezoidal speed: constant acceleration, constant speed, constant deceleration.

    If the distance is shorter than ω²/a the speed is not reached: the profile is a triangle.
    end_rad may be below start_rad; speed and acceleration are magnitudes, above 0.
    """

    start_rad: float
    end_rad: float
    speed_rad_per_s: float
    acceleration_rad_per_s2: float

    def __post_init__(self) -> None:
        finite("start_rad", self.start_rad)
        finite("end_rad", self.end_rad)
        positive("speed_rad_per_s", self.speed_rad_per_s)
        positive("acceleration_rad_per_s2", self.acceleration_rad_per_s2)

    @property
    def top_speed_rad_per_s(self) -> float:
        """The speed that is reached, min(ω, √(a |α₁ − α₀|)) [rad/s]."""
        way = abs(self.end_rad - self.start_rad)
        return min(self.speed_rad_per_s, float(np.sqrt(self.acceleration_rad_per_s2 * way)))

    @property
    def duration_s(self) -> float:
        """|α₁ − α₀| / ω + ω / a with the speed ω that is reached [s]."""
        top = self.top_speed_rad_per_s
        if top == 0.0:
            return 0.0
        way = abs(self.end_rad - self.start_rad)
        return way / top + top / self.acceleration_rad_per_s2

    def _inside(self, t: float | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the time since the start and the time left, both clamped to the motion."""
        times = np.clip(np.asarray(t, dtype=np.float64), 0.0, self.duration_s)
        return times, self.duration_s - times

    def at(self, t: Real) -> Real:
        """Return α [rad]; exactly the end values before the start and from the end on."""
        since, left = self._inside(t)
        a, top = self.acceleration_rad_per_s2, self.top_speed_rad_per_s
        ramp = top / a
        sign = np.sign(self.end_rad - self.start_rad)
        first = self.start_rad + sign * np.where(
            since < ramp, 0.5 * a * since**2, top * (since - 0.5 * ramp)
        )
        # The last ramp is counted from the end, so that the end is met exactly.
        last = self.end_rad - sign * 0.5 * a * left**2
        return like(t, np.where(left < ramp, last, first))

    def rate(self, t: Real) -> Real:
        """Return dα/dt [rad/s], continuous."""
        since, left = self._inside(t)
        a, top = self.acceleration_rad_per_s2, self.top_speed_rad_per_s
        sign = np.sign(self.end_rad - self.start_rad)
        return like(t, np.asarray(sign * np.minimum(top, a * np.minimum(since, left))))
