"""Amplitude, frequency and growth rate of an oscillation, and where they cannot be told.

The rate is that of the first windows (:mod:`dualbend.evaluation.sinusoids`) whose bound, bend and
residual allow it. Where the amplitude hardly grows in a window, a likelihood ratio must say that
the oscillation set in at once and not after a fast rise: a plateau is no steady oscillation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.evaluation.sinusoids import (
    HIGHEST_HZ,
    LARGEST_EXPONENT,
    PIECES_BELOW_HZ,
    Fits,
    degree,
    fitted,
)
from dualbend.types import Vector

AMPLITUDE_ABOVE_HZ, AMPLITUDE_WINDOW_S = 1.0, 1.0
"""The amplitude is of what is faster than this: a linear piece of the path lasts longer."""

LOWEST_HZ = 0.45
FASTEST_PER_PERIOD = 4.0
"""Largest |σ|/f: what grows or dies by more than e⁴ in a period is no oscillation."""

ABSOLUTE_PER_S, RELATIVE = 0.2, 0.1
"""A rate is given where its error is within the larger of these."""

_FEWEST_PERIODS = 1.0
_LARGEST_RESIDUAL, _SMALLEST_PART = 0.25, 0.1
"""Residual over oscillation in a window, and oscillation over that of the record's largest."""

_BEND = 0.5
"""By how much of what its error may be a rate may change in a window."""

_RISEN = 1.0
"""A window in which the amplitude grows by e to this is its own evidence of growth."""

_RISES = (
    *((10.0, 0.25), (10.0, 0.08), (10.0, 0.0), (6.0, 0.25), (6.0, 0.0), (4.0, 0.0)),
    *((3.0, 0.25), (2.5, 0.0), (1.5, 0.25), (1.5, 0.0), (0.8, 0.0)),
)
"""Rises before a window that it is compared with: rate [1/s], and the part that it rises from."""

_STEP_RATES = 3.0, 10.0
"""Of the real modes by which the mean may step at an onset [1/s]."""

_LIKELIER, _VETO = 50.0, 40.0
"""2 ln Λ that speaks for an onset at once, and the one that speaks for a rise."""

_OFF, _TIGHT = 0.06, 0.03
"""Residual over oscillation where an onset is found, and where the law holds back to the start."""

_TRIED = 6
"""Windows whose onset is looked for."""

_FEWEST_BEFORE = 5
"""Rows before an onset that tell it from a rise."""

_PERIODS_ALIKE, _HARMONICS, _FREQUENCY_ERROR, _ALIKE = 2.0, 0.5, 0.05, 0.1
"""For a frequency: periods in a window, residual over oscillation, error, and how far they differ.

A square wave leaves 0.48. The error as if white, for that windows agree is evidence of its own.
"""


@dataclass(frozen=True, kw_only=True)
class Oscillation:
    """What a moment's oscillation is like; None where it cannot be told, and ``reason`` why.

    ``amplitude_nm``: √2 times the largest root mean square over 1 s of the moment above 1 Hz.
    ``growth_per_s``: σ of the amplitude A exp(σt) from the onset on, for as long as it is
    exponential: of the rise where the oscillation grows, saturated or decaying later; negative
    where it decays from its onset; of the first oscillation of at least a tenth of the largest.
    ``frequency_hz``: of the same stretch; where no rate is told, that of the largest oscillation.
    """

    amplitude_nm: float | None
    frequency_hz: float | None = None
    growth_per_s: float | None = None
    reason: str = ""


def oscillation_of(
    moment: Vector, period_s: float, held: NDArray[np.bool_] | None = None
) -> Oscillation:
    """Return amplitude, frequency and growth rate of a moment (rows,) [N m], one every period.

    ``held``: rows (rows,) at which sensor or deviation is at its bounds. Meaningful for 0.45-7 Hz,
    where a piece of the path lasts longer than 1 s.
    """
    if moment.size * period_s < AMPLITUDE_WINDOW_S:
        return Oscillation(amplitude_nm=None, reason=f"shorter than {AMPLITUDE_WINDOW_S:g} s")
    amplitude = _amplitude(moment, period_s)
    moment, period_s = _means(moment, period_s)
    fits = fitted(moment, period_s)
    oscillates = _oscillating(fits, period_s)
    told, reason = _telling(fits, oscillates, period_s)
    for i in _by_start(fits, told, period_s)[:_TRIED]:
        sets_in = _sets_in(moment, fits.only(i), period_s)
        if sets_in:
            return Oscillation(
                amplitude_nm=amplitude,
                frequency_hz=float(fits.frequency[i]),
                growth_per_s=float(fits.rate[i]),
            )
        if sets_in is None:
            break
    frequency = _frequency(fits, period_s)
    if frequency is not None and held is not None and held.any():
        reason = (
            f"sensor or deviation is at its bounds in {held.sum()} of {held.size} cycles:"
            " they hold the amplitude"
        )
    return Oscillation(
        amplitude_nm=amplitude,
        frequency_hz=frequency,
        reason=reason or "no exponential part reaches back to the onset",
    )


def _means(moment: Vector, period_s: float) -> tuple[Vector, float]:
    """Return means over groups of rows, as far apart as commands of the PUMA, and their period.

    A mean leaves rate and frequency of an exponential as they are, and all that is looked for is
    below 7 Hz. The windows' fits cost the square of the rate.
    """
    rows = max(math.floor(COMMAND_PERIOD_S / period_s + 1e-9), 1)
    groups = moment[: moment.size // rows * rows].reshape(-1, rows)
    return groups.mean(axis=1), rows * period_s


def _amplitude(moment: Vector, period_s: float) -> float:
    sections = signal.butter(2, AMPLITUDE_ABOVE_HZ, "highpass", fs=1.0 / period_s, output="sos")
    fast = np.asarray(signal.sosfiltfilt(sections, moment))
    window = np.ones(round(AMPLITUDE_WINDOW_S / period_s))
    power = np.convolve(fast**2, window / window.size, mode="valid")
    return math.sqrt(2.0 * float(power.max()))


def _oscillating(fits: Fits, period_s: float) -> NDArray[np.bool_]:
    """Return which windows hold an oscillation, of at least a tenth of the largest."""
    duration, speed = fits.rows * period_s, np.abs(fits.rate)
    found = (
        (speed <= FASTEST_PER_PERIOD * fits.frequency)
        & (fits.frequency >= LOWEST_HZ)
        & (fits.frequency <= HIGHEST_HZ)
        & (fits.frequency * duration >= _FEWEST_PERIODS)
        & (speed * duration <= LARGEST_EXPONENT)
        & (fits.rest < _LARGEST_RESIDUAL * fits.size)
    )
    return np.asarray(found & (fits.size >= _SMALLEST_PART * fits.size.max(where=found, initial=0)))


def _telling(
    fits: Fits, oscillates: NDArray[np.bool_], period_s: float
) -> tuple[NDArray[np.bool_], str]:
    """Return which windows tell a rate, and where none does, why."""
    told, allowed = oscillates, _allowed(fits)
    if not told.any():
        return told, "nothing oscillates well above what else the moment does"
    for condition, reason in (
        (fits.error <= allowed, "too short or too noisy to tell a rate"),
        (fits.bend <= _BEND * allowed, "its amplitude is nowhere exponential for long enough"),
    ):
        told = told & condition
        if not told.any():
            return told, reason
    return told, ""


def _allowed(fits: Fits) -> Vector:
    return np.maximum(ABSOLUTE_PER_S, RELATIVE * np.abs(fits.rate))


def _frequency(fits: Fits, period_s: float) -> float | None:
    """Return the frequency on which the windows of the largest oscillation agree, if they do.

    Also where it is no sinusoid: at its bounds it has harmonics, which stay in the residual.
    """
    sure = (fits.frequency >= PIECES_BELOW_HZ) & (fits.frequency <= HIGHEST_HZ)
    sure &= fits.frequency * fits.rows * period_s >= _PERIODS_ALIKE
    sure &= (np.abs(fits.rate) <= fits.frequency) & (fits.rest <= _HARMONICS * fits.size)
    sure &= fits.error <= _FREQUENCY_ERROR * np.sqrt(fits.rows) * 2.0 * np.pi * fits.frequency
    sure &= fits.size >= 0.5 * fits.size.max(where=sure, initial=0.0)
    if not sure.any():
        return None
    low, middle, high = np.quantile(fits.frequency[sure], (0.1, 0.5, 0.9))
    over_a_period = np.unique(fits.start[sure]).size * period_s * middle >= 1.0
    return float(middle) if over_a_period and high - low <= _ALIKE * middle else None


def _by_start(fits: Fits, told: NDArray[np.bool_], period_s: float) -> list[int]:
    """Return the best window of each start up to a period after the first, risen ones first."""
    allowed = _allowed(fits)
    cycle = 1.0 / (fits.frequency * period_s)
    risen = fits.rate * fits.rows * period_s > _RISEN
    for first in np.unique(fits.start[told]):
        near = np.flatnonzero(told & (fits.start >= first) & (fits.start <= first + cycle))
        apart = np.median(np.abs(fits.rate[near][:, None] - fits.rate[near]), axis=1)
        near = near[apart <= _BEND * allowed[near]]
        ordered = near[np.lexsort(((fits.error / allowed)[near], ~risen[near]))]
        starts, index = np.unique(fits.start[ordered], return_index=True)
        # A rate that windows of a single start tell is an accident.
        if starts.size > 1:
            return [int(i) for i in ordered[np.sort(index)]]
    return []


def _sets_in(moment: Vector, fit: Fits, period_s: float) -> bool | None:
    """Tell whether what a window says began at once, at an onset; None if after a fast rise.

    Back from the window, pieces of the moment are compared with the law from an onset on, with the
    law throughout, and with an amplitude that first rises.
    """
    if fit.rate * fit.rows * period_s > _RISEN:
        return True
    largest, tight = (max(1.5 * float(fit.rest), part * float(fit.size)) for part in (_OFF, _TIGHT))
    holds = True
    for first, stop, onsets in _pieces(fit, period_s):
        times: Vector = np.arange(stop - first, dtype=np.float64) * period_s
        before = times - times[onsets - first][:, None]
        laws = _Laws(moment[first:stop], times, before, fit)
        ever = float(laws.left(np.ones_like(before)).min())
        own = laws.left(np.where(before >= 0.0, 1.0, 0.0))
        from_start = first == 0 and onsets[own.argmin()] < _FEWEST_BEFORE
        if first == 0 and holds and min(own.min() if from_start else ever, ever) <= tight**2:
            return True
        holds = holds and ever <= tight**2
        rising = min(float(laws.left(_rise(before, *rise)).min()) for rise in _RISES)
        found = _at_once(own, ever, rising, laws.freedom, largest)
        if found is not False:
            return found
    return int(fit.start) < _FEWEST_BEFORE


def _pieces(fit: Fits, period_s: float) -> Iterator[tuple[int, int, NDArray[np.int_]]]:
    """Yield first row, row after the last, and the rows of onsets, back in quarters of a period.

    A piece begins a period before its middle and ends two after it; the onsets are from three
    quarters before to an eighth after it. A half period counts as at least 8 rows.
    """
    half = max(8, round(0.5 / (float(fit.frequency) * period_s)))
    rows = min(int(fit.rows), 4 * half)
    for middle in range(int(fit.start), max(int(fit.start) - rows, 2), -(half // 2)):
        first = max(middle - 2 * half, 0)
        onsets = np.arange(max(middle - 3 * half // 2, first + 1), middle + half // 4)
        yield first, middle + rows, onsets


def _at_once(own: Vector, ever: float, rising: float, freedom: int, largest: float) -> bool | None:
    """Tell whether an onset is likelier than all else, None if a rise is: 2 ln Λ = n ln(S₁/S₀).

    Mean squares S left by the law from each onset on, ever, and after a rise; n degrees of
    freedom; ``largest`` residual [N m] of what explains a piece. The outermost onsets do not count.
    """
    best = int(own.argmin())
    likelier = freedom * math.log(rising / min(float(own[best]), ever))
    if likelier < -_VETO and rising <= largest**2:
        return None
    inside = 1 < best < own.size - 1
    return inside and likelier > _LIKELIER and bool(own[best] < min(ever, largest**2))


def _rise(before: Vector, rate: float, smallest: float) -> Vector:
    size = np.exp(np.minimum(rate * before, 0.0))
    return np.where(size >= smallest, size, 0.0)


class _Laws:
    """Least squares of a piece of moment (n,) in trend, a step at each onset, and a wave."""

    def __init__(self, piece: Vector, times: Vector, before: Vector, fit: Fits) -> None:
        trend = np.vander(times, degree(times[-1]) + 1)
        since = np.maximum(before, 0.0)
        steps = [np.exp(-rate * since) for rate in _STEP_RATES]
        self._known = [*(np.broadcast_to(column, since.shape) for column in trend.T), *steps]
        self._wave = np.exp(complex(fit.rate, 2.0 * math.pi * fit.frequency) * times)
        self._piece = piece - piece.mean()
        self.freedom = piece.size - len(self._known) - 4

    def left(self, envelope: Vector) -> Vector:
        """Return the mean square that an amplitude (onsets, n) leaves, of each onset [N² m²]."""
        pair = [envelope * self._wave.real, envelope * self._wave.imag]
        columns = np.stack([*self._known, *pair], axis=-1)
        q = np.linalg.qr(columns / np.linalg.norm(columns, axis=1, keepdims=True))[0]
        explained = (np.einsum("onp,n->op", q, self._piece) ** 2).sum(axis=1) / self._piece.size
        total = float((self._piece**2).mean())
        return np.asarray(np.maximum(total - explained, 1e-12 * total))
