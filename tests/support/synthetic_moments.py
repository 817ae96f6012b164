"""Synthetic bending moments whose oscillation is known, drawn from one fixed distribution.

A moment is the arches of a piece-wise linear path, the oscillation, and the noise of a sensor. What
is drawn and from which range was written down before any method was judged by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.types import Vector

KINDS = (
    "none",
    "steady",
    "decays",
    "grows to the end",
    "grows, stays",
    "grows, decays",
    "rung by knots",
    "driven by noise",
)
SENSOR_NOISE_NM = 6.7e-3
"""Of one reading at the grip, with the default sensor."""


@dataclass(frozen=True, kw_only=True)
class Synthetic:
    """A moment (rows,) [N m] and what it is made of.

    ``rate_per_s``: of the amplitude from the onset on, while it is exponential; None where there is
    no oscillation. ``peak_nm``: largest amplitude of the oscillation; ``noise_nm``: rms.
    ``periods``: how many the amplitude is exponential and above three times the noise.
    """

    kind: str
    moment: Vector
    rate_per_s: float | None
    frequency_hz: float
    peak_nm: float
    noise_nm: float
    piece_s: float
    periods: float

    @property
    def clear(self) -> bool:
        """A rate that a method should tell: 1.5 periods, slower than e⁴ in one, off the noise."""
        rate = abs(self.rate_per_s or 0.0)
        high, slow = self.peak_nm >= 10.0 * self.noise_nm, rate <= 4.0 * self.frequency_hz
        return high and slow and self.periods >= 1.5


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def arches(rng: np.random.Generator, t: Vector, piece_s: float) -> Vector:
    """Return the moment of a path of equal linear pieces, after the lag of an arm (rows,).

    Parabolas whose height falls as one over the piece's number, as in the runs of fig6.
    """
    piece, part = np.divmod(t, piece_s)
    height = log_uniform(rng, 2e-3, 0.05) / (1.0 + piece)
    moment = rng.uniform(-0.01, 0.01) + 4.0 * height * (part / piece_s) * (1.0 - part / piece_s)
    lag = 2.0 * math.pi * rng.uniform(1.5, 5.0)
    return np.asarray(signal.lsim(([lag**2], [1.0, 2.0 * lag, lag**2]), moment, t)[1])


def envelope(
    rng: np.random.Generator, kind: str, since: Vector, rate: float, peak: float
) -> tuple[Vector, float, float]:
    """Return the amplitude over the time since the onset (rows,), and two heights of it.

    That at which the moment is cut off, and that at the onset where it rises from there.
    """
    small = peak * log_uniform(rng, 0.01, 0.3)
    growing = small * np.exp(np.minimum(rate * since, 50.0))
    if kind == "grows, stays":
        form = rng.integers(3)
        if form == 0:  # the amplitude stops
            return np.minimum(growing, peak), math.inf, small
        if form == 1:  # the moment is cut off
            return np.minimum(growing, 10.0 * peak), peak, small
        # Stuart-Landau: dA/dt = rate A (1 - (A/peak)²)
        part = (growing / small) ** 2
        return small * np.sqrt(part / (1.0 + (small / peak) ** 2 * (part - 1.0))), math.inf, small
    if kind == "grows, decays":
        top = math.log(peak / small) / rate
        fall = rng.uniform(0.5, 10.0)
        fallen = peak * np.exp(-fall * (since - top))
        return np.where(since < top, growing, fallen), math.inf, small
    return peak * np.exp(rate * (since - (since[-1] if rate > 0.0 else 0.0))), math.inf, 0.0


def _rate(rng: np.random.Generator, kind: str) -> float:
    ranges = {
        "steady": (-0.3, 0.3),
        "decays": (-10.0, -0.3),
        "rung by knots": (-10.0, -1.0),
        "driven by noise": (-3.0, -0.3),
    }
    return float(rng.uniform(*ranges.get(kind, (0.3, 10.0))))


def draw(rng: np.random.Generator, kind: str | None = None) -> Synthetic:
    """Draw a moment; of a drawn kind where none is given.

    4-12 s; pieces of 1.2-2.5 s; 0.5-6 Hz; peak 5 mN m-0.5 N m; onset in the first 0.6 of the
    record; noise none, from a hundredth of the sensor's up, or the sensor's, equally likely. With
    every third onset the mean steps by up to the peak, with a real mode of 2-10 1/s.
    """
    kind = kind or KINDS[rng.integers(len(KINDS))]
    t = np.arange(0.0, rng.uniform(4.0, 12.0), COMMAND_PERIOD_S)
    piece_s = float(rng.uniform(1.2, 2.5))
    frequency, peak = log_uniform(rng, 0.5, 6.0), log_uniform(rng, 5e-3, 0.5)
    onset, phase = rng.uniform(0.0, 0.6 * t[-1]), rng.uniform(0.0, 2.0 * math.pi)
    noise = [1e-6, log_uniform(rng, 0.01 * SENSOR_NOISE_NM, SENSOR_NOISE_NM), SENSOR_NOISE_NM]
    noise_nm = float(noise[rng.integers(3)])
    rate = _rate(rng, kind)
    moment = arches(rng, t, piece_s) + rng.normal(0.0, noise_nm, t.size)
    step = rng.uniform(-peak, peak) if rng.random() < 1 / 3 else 0.0
    real_rate = rng.uniform(2.0, 10.0)
    floor, lasting = 3.0 * noise_nm, 0.0

    def wave(since: Vector) -> Vector:
        return np.cos(2.0 * math.pi * frequency * since + phase)

    if kind == "rung by knots":
        lasting = piece_s
        for knot in np.arange(0.0, t[-1], piece_s)[1:]:
            since = t - knot
            height = peak * rng.uniform(0.2, 1.0)
            ringing = height * np.exp(rate * np.maximum(since, 0.0)) * wave(since)
            moment += np.where(since >= 0.0, ringing, 0.0)
    elif kind == "driven by noise":
        pole = np.exp((rate + 2j * math.pi * frequency) * COMMAND_PERIOD_S)
        shaken = np.asarray(signal.lfilter([1.0], [1.0, -pole], rng.normal(size=t.size))).real
        moment += peak * shaken / np.abs(shaken).max()
    elif kind != "none":
        after = t >= onset
        since = t[after] - onset
        size, cut, small = envelope(rng, kind, since, rate, peak)
        floor, lasting = max(floor, small), float(since[-1])
        moment[after] += np.clip(size * wave(since), -cut, cut)
        moment[after] += step * (1.0 - np.exp(-real_rate * since))
    return Synthetic(
        kind=kind,
        moment=moment,
        rate_per_s=None if kind == "none" else rate,
        frequency_hz=frequency,
        peak_nm=peak,
        noise_nm=noise_nm,
        piece_s=piece_s,
        periods=frequency * min(lasting, max(0.0, math.log(peak / floor)) / abs(rate)),
    )


def right(found: float | None, case: Synthetic) -> bool | None:
    """Say whether a rate is within 10 % or 0.2 1/s, and of the right sign; None: nothing was said.

    The sign is wrong where it is not the true one's and either rate is beyond 0.3 1/s.
    """
    if found is None:
        return None
    if case.rate_per_s is None:
        return False
    return abs(found - case.rate_per_s) <= max(0.2, 0.1 * abs(case.rate_per_s))
