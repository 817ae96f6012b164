"""Growth rate and frequency of an oscillation: damped sinusoids fitted to windows of a moment.

Each window is fitted by m(t) = p(t) + A exp(σt) cos(2πft + φ), p a polynomial of second or third
degree, in the sense of least squares: by variable projection, from the best of a grid of (σ, f).
Nothing is filtered, so nothing is smeared to before the onset. What a window tells is judged by the
Cramér-Rao bound of σ, by the residual's whiteness, by a term t² in the exponent, and by what was
there before the window began.

Source: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, variable projection; Y.-X. Yao,
S. M. Pandit, IEEE Trans. Signal Process. 43 (1995) 878, bound of a damped sinusoid; G. M. Ljung,
G. E. P. Box, Biometrika 65 (1978) 297, whiteness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from dualbend.types import Vector

AMPLITUDE_ABOVE_HZ, AMPLITUDE_WINDOW_S = 1.0, 1.0
"""The amplitude is of what is faster than this: a linear piece of the path lasts longer."""

LOWEST_HZ, HIGHEST_HZ = 0.45, 7.0
FASTEST_PER_PERIOD = 4.0
"""Largest |σ|/f: what grows or dies by more than e⁴ in a period is no oscillation."""

ABSOLUTE_PER_S, RELATIVE = 0.2, 0.1
"""A rate is given where its error is within the larger of these."""

PIECES_BELOW_HZ = 1.0
"""What is slower may be of the path's own pieces, and its residual is never taken for noise."""

_WINDOWS_S = tuple(0.336 * 1.26**i for i in range(12))
_FEWEST_SAMPLES, _CUBIC_FROM_S = 12, 1.7
_COARSE_SHARE, _STEPS = 0.5, 5
"""Share of power in a wave of the grid from which a window is fitted, and in how many steps."""

_FEWEST_PERIODS, _LARGEST_EXPONENT = 1.0, 6.0
_LARGEST_RESIDUAL, _SMALLEST_PART = 0.4, 0.1
"""Residual over oscillation in a window, and oscillation over that of the record's largest."""

_STANDARD_ERRORS, _BEND = 4.0, 0.5
"""Error of a rate in standard errors; by how much of what is allowed it may change in a window."""

_LAGS, _WHITE = 12, 1.2
"""Ljung and Box's Q over the number of lags: 1 is the mean of white noise."""

_LOOK_BACK = (0.15, 0.25, 0.35, 0.5, 1.0)
"""How far before a window is looked, in periods."""

_QUIET, _NOTHING, _SAME, _MORE = 0.2, 0.05, 0.3, 1.5


@dataclass(frozen=True, kw_only=True)
class Oscillation:
    """What a moment's oscillation is like; None where it cannot be told, and ``reason`` why.

    ``amplitude_nm``: √2 times the largest root mean square over 1 s of the moment above 1 Hz.
    ``growth_per_s``: σ of the amplitude A exp(σt) from the onset on, for as long as it is
    exponential: of the rise where the oscillation grows, saturated or decaying later; negative
    where it decays from its onset; of the first oscillation of at least a tenth of the largest.
    ``frequency_hz``: of the same stretch.
    """

    amplitude_nm: float | None
    frequency_hz: float | None = None
    growth_per_s: float | None = None
    reason: str = ""


def oscillation_of(moment: Vector, period_s: float) -> Oscillation:
    """Return amplitude, frequency and growth rate of a moment (rows,) [N m], one every period.

    Meaningful for 0.45-7 Hz, where a piece of the path lasts longer than 1 s.
    """
    if moment.size * period_s < AMPLITUDE_WINDOW_S:
        return Oscillation(amplitude_nm=None, reason=f"shorter than {AMPLITUDE_WINDOW_S:g} s")
    amplitude = _amplitude(moment, period_s)
    fits = _fitted(moment, period_s)
    told, reason = _telling(fits, period_s)
    for i in _by_start(fits, told, period_s):
        if _begins(moment, fits.only(i), period_s):
            return Oscillation(
                amplitude_nm=amplitude,
                frequency_hz=float(fits.frequency[i]),
                growth_per_s=float(fits.rate[i]),
            )
    return Oscillation(
        amplitude_nm=amplitude,
        reason=reason or "no exponential part reaches back to the onset",
    )


def _amplitude(moment: Vector, period_s: float) -> float:
    sections = signal.butter(2, AMPLITUDE_ABOVE_HZ, "highpass", fs=1.0 / period_s, output="sos")
    fast = np.asarray(signal.sosfiltfilt(sections, moment))
    window = np.ones(round(AMPLITUDE_WINDOW_S / period_s))
    power = np.convolve(fast**2, window / window.size, mode="valid")
    return math.sqrt(2.0 * float(power.max()))


class _Fits(NamedTuple):
    """A fitted window an entry: first row, number of rows, σ [1/s], f [Hz], the error of σ [1/s].

    ``bend``: change of σ between middle and end [1/s]; ``rest``, ``size``: root mean square of the
    residual and of the oscillation [N m].
    """

    start: NDArray[np.int_]
    rows: NDArray[np.int_]
    rate: Vector
    frequency: Vector
    error: Vector
    bend: Vector
    rest: Vector
    size: Vector

    def only(self, i: int) -> _Fits:
        return _Fits(*(values[i] for values in self))


class _Plane(NamedTuple):
    """Two regressors of each window (windows, n), and least squares in them."""

    a: Vector
    b: Vector

    @property
    def gram(self) -> tuple[Vector, Vector, Vector, Vector]:
        """⟨a,a⟩, ⟨a,b⟩, ⟨b,b⟩ and the determinant, infinite where there is none (windows,)."""
        aa, ab, bb = _dot(self.a, self.a), _dot(self.a, self.b), _dot(self.b, self.b)
        determinant = aa * bb - ab**2
        return aa, ab, bb, np.where(determinant > 0.0, determinant, np.inf)

    def fit(self, y: Vector) -> tuple[Vector, Vector]:
        aa, ab, bb, determinant = self.gram
        u, v = _dot(self.a, y), _dot(self.b, y)
        return (bb * u - ab * v) / determinant, (aa * v - ab * u) / determinant

    def off(self, y: Vector) -> Vector:
        """Return what of y is not in the plane (windows, n)."""
        p, q = self.fit(y)
        return y - p[:, None] * self.a - q[:, None] * self.b


def _dot(a: Vector, b: Vector) -> Vector:
    return np.asarray(np.einsum("wn,wn->w", a, b))


class _Bank(NamedTuple):
    """Of windows of one length: times [s], trend, a grid of poles, and the planes they span."""

    times: Vector
    trend: Vector
    rate: Vector
    omega: Vector
    planes: Vector

    def detrended(self, y: Vector) -> Vector:
        return np.asarray(y - (y @ self.trend) @ self.trend.T)


@lru_cache
def _bank(count: int, period_s: float) -> _Bank:
    duration = count * period_s
    times = np.linspace(-0.5, 0.5, count) * (count - 1) * period_s
    trend = np.linalg.qr(np.vander(times / duration, _degree(duration) + 1))[0]
    frequencies = np.arange(1.0 / duration, HIGHEST_HZ + 1.0, 0.4 / duration)
    rates = np.arange(-12.0, 12.01, max(1.0 / duration, 0.75))
    rates = rates[np.abs(rates) * duration < _LARGEST_EXPONENT + 1.0]
    f, rate = (grid.ravel() for grid in np.meshgrid(frequencies, rates, indexing="ij"))
    waves = np.exp((rate[:, None] + 2j * np.pi * f[:, None]) * times)
    pairs = np.stack([waves.real, waves.imag], axis=-1)
    planes = np.linalg.qr(pairs - trend @ (trend.T @ pairs))[0]
    return _Bank(times, trend, rate, 2.0 * np.pi * f, planes)


def _degree(duration_s: float) -> int:
    return 2 if duration_s < _CUBIC_FROM_S else 3


def _fitted(moment: Vector, period_s: float) -> _Fits:
    """Fit all windows in which a damped sinusoid of the grid is at least half of what moves."""
    counts = sorted({max(_FEWEST_SAMPLES, round(s / period_s)) for s in _WINDOWS_S})
    parts = [_of_length(moment, n, period_s) for n in counts if n <= moment.size]
    return _Fits(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _of_length(moment: Vector, count: int, period_s: float) -> _Fits:
    bank = _bank(count, period_s)
    moved = bank.detrended(np.lib.stride_tricks.sliding_window_view(moment, count))
    stride = max(1, count // 8)
    power = (np.tensordot(moved[::stride], bank.planes, axes=(1, 1)) ** 2).sum(axis=-1)
    coarse = power.argmax(axis=1)
    start = np.arange(len(moved))
    nearest = np.minimum((start + stride // 2) // stride, len(coarse) - 1)
    share = power.max(axis=1) / np.maximum(_dot(moved[::stride], moved[::stride]), 1e-300)
    start = start[share[nearest] > _COARSE_SHARE]
    guess = coarse[nearest[start]]
    return _refined(moved[start], start, bank, (bank.rate[guess], bank.omega[guess]))


def _refined(
    moved: Vector, start: NDArray[np.int_], bank: _Bank, guess: tuple[Vector, Vector]
) -> _Fits:
    """Refine σ and ω by Gauss-Newton steps, and say how far they can be trusted."""
    times, count = bank.times, bank.times.size
    furthest = 1.0 / (count * (times[1] - times[0]))
    best = np.stack([*guess, np.full(start.size, np.inf)])
    rate, omega = guess
    for _ in range(_STEPS):
        _, rest, _, tangent = _linear(moved, bank, rate, omega)
        left = _dot(rest, rest)
        best = np.where(left < best[2], np.stack([rate, omega, left]), best)
        by_rate, by_omega = tangent.fit(rest)
        rate = np.clip(rate + np.clip(by_rate, -furthest, furthest), -20.0, 20.0)
        omega = omega + np.clip(by_omega, -1.5 * furthest, 1.5 * furthest)
    rate, omega, left = best
    wave, rest, plane, tangent = _linear(moved, bank, rate, omega)
    _, _, by_omega2, determinant = tangent.gram
    variance = left / (count - bank.trend.shape[1] - 4)
    spread = np.sqrt(variance * by_omega2 / determinant)
    noisy = _white(rest) & (omega >= 2.0 * np.pi * PIECES_BELOW_HZ)
    observations = np.where(noisy, 1.0, math.sqrt(count))
    square = times**2
    second = _Plane(
        *(tangent.off(plane.off(bank.detrended(square * part))) for part in (wave.real, -wave.imag))
    )
    return _Fits(
        start=start,
        rows=np.full(start.size, count),
        rate=rate,
        frequency=omega / (2.0 * np.pi),
        error=_STANDARD_ERRORS * spread * observations,
        bend=np.abs(second.fit(rest)[0]) * count * (times[1] - times[0]),
        rest=np.sqrt(left / count),
        size=np.sqrt((np.abs(wave) ** 2).mean(axis=1) / 2.0),
    )


def _linear(
    moved: Vector, bank: _Bank, rate: Vector, omega: Vector
) -> tuple[NDArray[np.complex128], Vector, _Plane, _Plane]:
    """Return the best wave of given poles, the residual, and the planes of amplitude and pole."""
    late = np.abs(rate)[:, None] * bank.times[-1]
    unit = np.exp((rate[:, None] + 1j * omega[:, None]) * bank.times - late)
    plane = _Plane(bank.detrended(unit.real), bank.detrended(-unit.imag))
    p, q = plane.fit(moved)
    wave = unit * (p + 1j * q)[:, None]
    rest = moved - p[:, None] * plane.a - q[:, None] * plane.b
    tangent = _Plane(
        *(plane.off(bank.detrended(bank.times * part)) for part in (wave.real, -wave.imag))
    )
    return wave, rest, plane, tangent


def _white(rest: Vector) -> NDArray[np.bool_]:
    """Tell residuals (windows, n) that are as white as a fit leaves them, by Ljung and Box."""
    count = rest.shape[1]
    lags = range(1, min(count // 3, _LAGS) + 1)
    power = np.maximum(_dot(rest, rest), 1e-300)
    rho = np.stack([_dot(rest[:, k:], rest[:, :-k]) / power for k in lags])
    weights = count * (count + 2.0) / (count - np.array(lags))
    return np.asarray(weights @ rho**2 < _WHITE * len(lags))


def _telling(fits: _Fits, period_s: float) -> tuple[NDArray[np.bool_], str]:
    """Return which windows tell a rate, and where none does, why."""
    duration, speed = fits.rows * period_s, np.abs(fits.rate)
    allowed = np.maximum(ABSOLUTE_PER_S, RELATIVE * speed)
    told = (
        (speed <= FASTEST_PER_PERIOD * fits.frequency)
        & (fits.frequency >= LOWEST_HZ)
        & (fits.frequency <= HIGHEST_HZ)
        & (fits.frequency * duration >= _FEWEST_PERIODS)
        & (speed * duration <= _LARGEST_EXPONENT)
        & (fits.rest < _LARGEST_RESIDUAL * fits.size)
    )
    if not told.any():
        return told, "nothing oscillates well above what else the moment does"
    told &= fits.size >= _SMALLEST_PART * fits.size[told].max()
    for condition, reason in (
        (fits.error <= allowed, "too short or too noisy to tell a rate"),
        (fits.bend <= _BEND * allowed, "its amplitude is nowhere exponential for long enough"),
    ):
        told &= condition
        if not told.any():
            return told, reason
    return told, ""


def _by_start(fits: _Fits, told: NDArray[np.bool_], period_s: float) -> list[int]:
    """Return the best window of each start up to a period after the first, the best one first."""
    if not told.any():
        return []
    allowed = np.maximum(ABSOLUTE_PER_S, RELATIVE * np.abs(fits.rate))
    last = fits.start[told].min() + 1.0 / (fits.frequency * period_s)
    near = np.flatnonzero(told & (fits.start <= last))
    ordered = near[np.argsort((fits.error / allowed)[near])]
    starts, first = np.unique(fits.start[ordered], return_index=True)
    # A rate that windows of a single start tell is an accident.
    return [int(i) for i in ordered[np.sort(first)]] if starts.size > 1 else []


def _begins(moment: Vector, fit: _Fits, period_s: float) -> bool:
    """Tell whether what was before a window is what its law says: nothing, or its own beginning.

    The moment from part of a period before the window to its end is fitted with the window's pole,
    but with an amplitude of its own before; c is the ratio of that to the window's. Decay follows
    an onset: c = 0. Growth may also go on from earlier, c = 1, or come out of the noise.
    """
    pole = complex(fit.rate, 2.0 * math.pi * fit.frequency)
    cycle = 1.0 / (float(fit.frequency) * period_s)
    before = [min(max(4, round(part * cycle)), int(fit.start)) for part in _LOOK_BACK]
    ratios = [_before(moment, fit, rows, pole, period_s) for rows in before if rows >= 3]
    risen = fit.rate * fit.rows * period_s
    quiet = all(abs(c) + e < _QUIET and abs(c) - 2.0 * e < _NOTHING for c, e in ratios)
    goes_on = risen > 0.5 and all(abs(c - 1.0) < _SAME + 2.0 * error for c, error in ratios)
    emerges = risen > 1.0 and all(abs(c) - 2.0 * error < _MORE for c, error in ratios[:-1])
    return bool(quiet or goes_on or emerges)


def _before(
    moment: Vector, fit: _Fits, rows: int, pole: complex, period_s: float
) -> tuple[complex, float]:
    duration = int(fit.rows) * period_s
    times = np.arange(-rows, int(fit.rows)) * period_s
    wave = np.exp(pole * times)
    pair = np.column_stack([wave.real, -wave.imag])
    inside = (np.arange(times.size) >= rows)[:, None]
    trend = np.vander(times / duration, _degree(duration) + 1)
    columns = np.hstack([trend, pair * inside, pair * ~inside])
    scale = np.linalg.norm(columns, axis=0)
    q, r = np.linalg.qr(columns / scale)
    inverse = np.linalg.inv(r) / scale[:, None]
    found = inverse @ (q.T @ moment[int(fit.start) - rows : int(fit.start) + int(fit.rows)])
    within, earlier = complex(*found[-4:-2]), complex(*found[-2:])
    error = float(fit.rest) * math.sqrt(float((inverse[-2:] ** 2).sum()) / 2.0)
    return earlier / within, error / abs(within)
