"""Damped sinusoids fitted to windows of a moment, and how far their rates can be trusted.

Each window is fitted by m(t) = p(t) + A exp(σt) cos(2πft + φ), p a polynomial of second or third
degree, in the sense of least squares: by variable projection, from the best of a grid of (σ, f).
Nothing is filtered, so nothing is smeared to before the onset. The error of σ is
its Cramér-Rao bound; a residual that is not white counts as a single observation.

Source: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, variable projection; Y.-X. Yao,
S. M. Pandit, IEEE Trans. Signal Process. 43 (1995) 878, bound of a damped sinusoid; G. M. Ljung,
G. E. P. Box, Biometrika 65 (1978) 297, whiteness.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualbend.types import Vector

HIGHEST_HZ, LARGEST_EXPONENT = 7.0, 6.0
"""Of the oscillations that are looked for; |σ| times the duration of a window."""

PIECES_BELOW_HZ = 1.0
"""What is slower may be of the path's own pieces, and its residual is never taken for noise."""

_WINDOWS_S = tuple(0.336 * 1.26**i for i in range(12))
FEWEST_SAMPLES, _CUBIC_FROM_S = 12, 1.7
_COARSE_SHARE, _STEPS = 0.5, 5
"""Share of power in a wave of the grid from which a window is fitted, and in how many steps."""

_STANDARD_ERRORS = 4.0
"""The error of a rate."""

_LAGS, _WHITE = 12, 1.4
"""Ljung and Box's Q over the number of lags: 1 is the mean of white noise."""


class Fits(NamedTuple):
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

    def only(self, i: int) -> Fits:
        """Return a window."""
        return Fits(*(values[i] for values in self))


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
    trend = np.linalg.qr(np.vander(times, degree(duration) + 1))[0]
    frequencies = np.arange(1.0 / duration, HIGHEST_HZ + 1.0, 0.4 / duration)
    rates = np.arange(-12.0, 12.01, max(1.0 / duration, 0.75))
    rates = rates[np.abs(rates) * duration < LARGEST_EXPONENT + 1.0]
    f, rate = (grid.ravel() for grid in np.meshgrid(frequencies, rates, indexing="ij"))
    waves = np.exp((rate[:, None] + 2j * np.pi * f[:, None]) * times)
    pairs = np.stack([waves.real, waves.imag], axis=-1)
    planes = np.linalg.qr(pairs - trend @ (trend.T @ pairs))[0]
    return _Bank(times, trend, rate, 2.0 * np.pi * f, planes)


def degree(duration_s: float) -> int:
    """Return the degree of the trend of a window."""
    return 2 if duration_s < _CUBIC_FROM_S else 3


def fitted(moment: Vector, period_s: float) -> Fits:
    """Fit all windows in which a damped sinusoid of the grid is at least half of what moves."""
    counts = sorted({max(FEWEST_SAMPLES, round(s / period_s)) for s in _WINDOWS_S})
    parts = [_of_length(moment, n, period_s) for n in counts if n <= moment.size]
    return Fits(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _of_length(moment: Vector, count: int, period_s: float) -> Fits:
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
) -> Fits:
    """Refine σ and ω by Gauss-Newton steps, and say how far they can be trusted."""
    times, count = bank.times, bank.times.size
    duration = count * (times[1] - times[0])
    furthest = np.array([[1.0], [1.5]]) / duration
    pole, best = np.stack(guess), np.stack([*guess, np.full(start.size, np.inf)])
    for _ in range(_STEPS):
        _, rest, _, tangent = _linear(moved, bank, *pole)
        left = _dot(rest, rest)
        best = np.where(left < best[2], np.stack([*pole, left]), best)
        pole = pole + np.clip(tangent.fit(rest), -furthest, furthest)
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
    return Fits(
        start=start,
        rows=np.full(start.size, count),
        rate=rate,
        frequency=omega / (2.0 * np.pi),
        error=_STANDARD_ERRORS * spread * observations,
        bend=np.abs(second.fit(rest)[0]) * duration,
        rest=np.sqrt(left / count),
        size=np.sqrt((np.abs(wave) ** 2).mean(axis=1) / 2.0),
    )


def _linear(
    moved: Vector, bank: _Bank, rate: Vector, omega: Vector
) -> tuple[NDArray[np.complex128], Vector, _Plane, _Plane]:
    """Return the best wave of given poles, the residual, and the planes of amplitude and pole."""
    unit = np.exp((rate[:, None] + 1j * omega[:, None]) * bank.times)
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
