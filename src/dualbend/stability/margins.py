"""Gain, phase and delay margin of a loop from the loci of the eigenvalues of L(jω).

For one axis the locus is L itself. For two, det(I + k e^(−jφ) L) = 0 where an eigenvalue of L is
−1/(k e^(−jφ)): the margins are those of a change that both axes undergo together.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualbend.control.clock import ComplexVector
from dualbend.stability.sampled import SampledLoop
from dualbend.types import Vector

_FREQUENCIES = 1500


@functools.cache
def frequency_grid(period_s: float) -> tuple[Vector, ComplexVector]:
    """Return where a sampled loop is evaluated up to Nyquist (n,) [Hz], and z⁻¹ there.

    Crossings are interpolated to 1e-5 of the margin.
    """
    frequencies = np.concatenate([[0.0], np.geomspace(0.02, 0.5 / period_s, _FREQUENCIES)])
    return frequencies, np.exp(-2j * math.pi * frequencies * period_s)


@dataclass(frozen=True, kw_only=True)
class Margins:
    """How far the loop is from its boundary; infinite where nothing of the kind would reach it.

    ``gain``: the factor on the loop's gain at which it becomes unstable, above 1 where it is
    stable. ``phase_rad`` [rad] and ``delay_s`` [s]: lag and delay that it bears more; of an
    unstable loop what would have to go, negative, NaN where that would not help.
    ``crossover_hz``: where the locus of the gain margin crosses the negative axis [Hz].
    """

    gain: float
    phase_rad: float
    delay_s: float
    crossover_hz: float

    @property
    def gain_db(self) -> float:
        """Gain margin [dB]."""
        return 20.0 * math.log10(self.gain)


def loop_margins(loop: SampledLoop, *, stable: bool) -> Margins:
    """Return the margins of a sampled loop whose verdict is known from its eigenvalues."""
    frequencies, z_inverse = frequency_grid(loop.period_s)
    return margins(frequencies, eigenloci(loop.open_loop(z_inverse)), stable=stable)


def jitter_cycles(loop: SampledLoop) -> float:
    """Return by how many cycles a stable loop's commands may be late, in any order."""
    _, z_inverse = frequency_grid(loop.period_s)
    return late_cycles(loop.open_loop(z_inverse), z_inverse)


def late_cycles(gains: ComplexVector, z_inverse: ComplexVector) -> float:
    """Return 1/max |(1 − z⁻¹) T|, T = L (I + L)⁻¹, of a loop L (n, m, m), m ≤ 2.

    A delay that wanders between 0 and N cycles changes the deviation by at most N times its change
    over one cycle, so that a loop stays stable while N |(1 − z⁻¹) T| < 1: sufficient, not
    necessary. It holds in any units of the axes; taken are those in which they act on each other
    alike.

    Source: Kao and Lincoln, Automatica 40 (2004) 1429, in discrete time.
    """
    closed = gains @ np.linalg.inv(np.eye(gains.shape[1]) + gains)
    if gains.shape[1] == 2:
        across = np.abs(closed).max(axis=0) + np.finfo(np.float64).tiny
        unit = math.sqrt(across[0, 1] / across[1, 0])
        closed = closed * np.array([[1.0, 1.0 / unit], [unit, 1.0]])
    change = np.abs(1.0 - z_inverse) * np.linalg.norm(closed, ord=2, axis=(1, 2))
    return 1.0 / float(change.max())


def hunting_amplitude(loop: SampledLoop, lag: float) -> float:
    """Return the amplitude of the grip at which one axis goes on oscillating because of friction.

    What is read is that of a grip which is h behind in its direction of motion, x − h sign(ẋ). Of
    an amplitude A that is 1 − j 4h/(πA), the describing function of a relay, so that the loop hunts
    where −1/L = 1 − j 4h/(πA). 0: nowhere; near the onset it has no bound. The deviation is larger
    by what the robot's response leaves of it.

    Source: Gelb and Vander Velde, Multiple-Input Describing Functions (1968), section 2.3.
    """
    _, z_inverse = frequency_grid(loop.period_s)
    inverse = -1.0 / loop.open_loop(z_inverse[1:])[:, 0, 0]
    missing = -_between(inverse.imag, *_crossings(inverse.real - 1.0)).real
    least = float(missing.min(initial=math.inf, where=missing > 0.0))
    return 4.0 * lag / (math.pi * least)


def eigenloci(gains: ComplexVector) -> ComplexVector:
    """Return the eigenvalues (n, m) of L (n, m, m), m ≤ 2, each column continuous."""
    if gains.shape[1] == 1:
        return gains[:, :, 0]
    half = (gains[:, 0, 0] + gains[:, 1, 1]) / 2
    root = np.sqrt(half**2 - (gains[:, 0, 0] * gains[:, 1, 1] - gains[:, 0, 1] * gains[:, 1, 0]))
    # The square root jumps where it crosses its cut; one that turns by more than π/2 has jumped.
    jumps = np.real(root[1:] * np.conj(root[:-1])) < 0.0
    root = root * np.where(np.concatenate([[0], np.cumsum(jumps)]) % 2, -1.0, 1.0)
    return np.stack([half + root, half - root], axis=-1)


def margins(frequency_hz: Vector, loci: ComplexVector, *, stable: bool) -> Margins:
    """Return the margins from the loci (n, m) of a loop without unstable parts of its own."""
    gain, crossover = _gain(frequency_hz, loci)
    phase, delay = _phase(frequency_hz, loci, stable=stable)
    return Margins(gain=gain, phase_rad=phase, delay_s=delay, crossover_hz=crossover)


def _crossings(values: Vector) -> tuple[NDArray[np.intp], Vector]:
    """Return after which samples a column changes sign, and which part of the way further on."""
    before = np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))
    return before, values[before] / (values[before] - values[before + 1])


def _between(
    values: Vector | ComplexVector, before: NDArray[np.intp], part: Vector
) -> ComplexVector:
    mixed = values[before] * (1.0 - part) + values[before + 1] * part
    return np.asarray(mixed, dtype=np.complex128)


def _gain(frequency_hz: Vector, loci: ComplexVector) -> tuple[float, float]:
    found = [(0.0, math.nan)]
    for locus in loci.T:
        before, part = _crossings(locus.imag)
        crossed, at = (_between(v, before, part).real for v in (-locus, frequency_hz))
        found += zip(crossed.tolist(), at.tolist(), strict=True)
        # At standstill and at the Nyquist frequency a sampled locus is real anyway.
        found += [
            (-float(locus[i].real), float(frequency_hz[i]))
            for i in (0, -1)
            if abs(locus[i].imag) <= 1e-9 * abs(locus[i])
        ]
    reach, crossover = max(found)
    return (1.0 / reach, crossover) if reach > 0.0 else (math.inf, math.nan)


def _phase(frequency_hz: Vector, loci: ComplexVector, *, stable: bool) -> tuple[float, float]:
    """Return the phase [rad] and delay [s] that are left, or, negative, that are too much."""
    found: list[tuple[float, float]] = []
    for locus in loci.T:
        before, part = _crossings(np.abs(locus) - 1.0)
        # Followed from standstill on, so that a lag of more than half a turn stays one.
        phase = np.unwrap(np.angle(locus))
        left = _between(phase, before, part).real + math.pi
        if stable:
            # A delay only turns the locus clockwise: the other way to −1 is a long way round.
            left = left % (2.0 * math.pi)
        rate = 2.0 * math.pi * _between(frequency_hz, before, part).real
        found += zip(left.tolist(), (left / rate).tolist(), strict=True)
    if stable:
        phases = [min(left, 2.0 * math.pi - left) for left, _ in found]
        return min(phases, default=math.inf), min((d for _, d in found), default=math.inf)
    # Where nothing lags too much the loop does not oscillate but drifts away.
    late = [item for item in found if item[0] < 0.0]
    return min(late, key=lambda item: item[1]) if late else (math.nan, math.nan)
