"""The low-pass filter of the force/torque readings, at the command period.

At the PUMA's 35.7 Hz a cut-off of 10 Hz is 0.56 of Nyquist, so a short FIR filter hardly has the
corner it is asked for: with the Hamming window 2 taps give −3 dB at 8.93 Hz, 3 taps never get there
(gain 0.903 at 10 Hz, 0.836 at Nyquist), 5 taps give 7.92 Hz. With the boxcar window 3 taps give
6.31 Hz. A symmetric FIR of n taps delays all frequencies by (n − 1)/2 periods: 28 ms for 3 taps; a
Butterworth of order 2, discretised at this rate, delays low frequencies by 16.4 ms.
Read `LowPass.minus_3db_hz` and `LowPass.group_delay_s` rather than the configured numbers.
"""

import math
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dualbend.control.clock import TransferFunction, rational, refuse_beyond_nyquist
from dualbend.control.worlds import Stackable
from dualbend.types import Tagged, Vector, said


class _CutOff(Tagged):
    """A low-pass filter with a design cut-off."""

    cutoff_hz: Annotated[
        float, said("design cut-off, below half the command rate [Hz]", gt=0, le=1e3)
    ] = 10.0


class FirConfig(_CutOff, tag="fir"):
    """A windowed sinc of linear phase filters the wrench before the compliance."""

    taps: Annotated[int, said("length of the FIR [samples]", ge=1, le=64)] = 3
    window: Annotated[Literal["hamming", "boxcar"], said("window of the FIR design")] = "hamming"


class IirConfig(_CutOff, tag="iir"):
    """A Butterworth filter smooths the wrench before the compliance."""

    order: Annotated[int, said("order of the Butterworth IIR", ge=1, le=8)] = 2


class NoFilterConfig(Tagged, tag="none"):
    """The wrench goes to the compliance as it is read."""


LowPassConfig: TypeAlias = FirConfig | IirConfig | NoFilterConfig
"""Which low-pass filter the wrench goes through before the compliance."""


def refuse_filter(config: LowPassConfig, period_s: float) -> None:
    """Raise InputError where the cut-off is not below half the command rate."""
    if not isinstance(config, NoFilterConfig):
        refuse_beyond_nyquist("filter.cutoff_hz", config.cutoff_hz, period_s)


def _design(config: LowPassConfig, period_s: float) -> TransferFunction:
    if isinstance(config, NoFilterConfig):
        return np.ones(1), np.ones(1)
    if isinstance(config, FirConfig):
        return _windowed_sinc(config, period_s), np.ones(1)
    from scipy import signal  # noqa: PLC0415 - 1 s to import; a FIR needs none of it

    numerator, denominator = signal.butter(config.order, config.cutoff_hz, fs=1.0 / period_s)
    return np.asarray(numerator, dtype=np.float64), np.asarray(denominator, dtype=np.float64)


def _windowed_sinc(config: FirConfig, period_s: float) -> Vector:
    """Return the taps of `scipy.signal.firwin` (tested), of unit gain at standstill."""
    middle = np.arange(config.taps) - (config.taps - 1) / 2.0
    taps = np.sinc(2.0 * config.cutoff_hz * period_s * middle)
    if config.window == "hamming":
        taps *= np.hamming(config.taps)
    return np.asarray(taps / taps.sum())


def _transposed_form(numerator: Vector, denominator: Vector) -> tuple[Vector, Vector]:
    """Stack direct form II transposed as [y; z⁺] = M [x; z], with the z that holds x = y = 1."""
    length = max(numerator.size, denominator.size)
    b = np.pad(numerator, (0, length - numerator.size))
    a = np.pad(denominator, (0, length - denominator.size))
    step = np.eye(length, k=1)
    step[:, 0] = b - a * b[0]
    step[0, 0] = b[0]
    if length > 1:
        step[1:, 1] -= a[1:]
    return step, np.cumsum((b - a)[:0:-1])[::-1]


class LowPass(Stackable):
    """Streaming low-pass filter of unit DC gain, H(z) = Σ bᵢ z⁻ⁱ / Σ aᵢ z⁻ⁱ, one per channel.

    The FIR is a windowed sinc (`scipy.signal.firwin`, linear phase), the IIR a Butterworth
    (`scipy.signal.butter`); in the loop both are one product with a small matrix.

    Samples are (*shape, channels), 6 channels for a wrench.
    """

    def __init__(
        self,
        config: LowPassConfig,
        channels: int = 6,
        *,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        refuse_filter(config, period_s)
        self.period_s = period_s
        self._numerator, self._denominator = _design(config, period_s)
        step, steady = _transposed_form(self._numerator, self._denominator)
        any_of = (1,) * len(shape)
        self._step, self._steady = (
            step.reshape(*any_of, *step.shape),
            steady.reshape(*any_of, -1, 1),
        )
        self._signal = np.zeros((*shape, len(step), channels))

    def reset(self, value: ArrayLike) -> None:
        """Set the memory to the steady state of a constant input, so that no transient starts."""
        self._signal[..., 0, :] = value
        self._signal[..., 1:, :] = self._steady * self._signal[..., :1, :]

    def update(self, value: Vector) -> Vector:
        """Take one sample (..., channels) and return the filtered one, in the same unit."""
        self._signal[..., 0, :] = value
        self._signal = self._step @ self._signal
        filtered: Vector = self._signal[..., 0, :].copy()
        return filtered

    def transfer_function(self) -> TransferFunction:
        """Tell (numerator, denominator) in powers of z⁻¹."""
        return self._numerator.copy(), self._denominator.copy()

    def gain(self, frequency_hz: float) -> float:
        """Return |H| at a frequency [Hz]."""
        z_inverse = np.exp(-2j * math.pi * frequency_hz * self.period_s)
        return float(abs(rational((self._numerator, self._denominator), z_inverse)))

    def group_delay_s(self, frequency_hz: float) -> float:
        """Return the group delay −dφ/dω [s] at a frequency [Hz]."""
        z = np.exp(-2j * math.pi * frequency_hz * self.period_s)

        def samples(polynomial: Vector) -> float:
            # −d arg P/dω of P = Σ p_n z⁻ⁿ is Re(Σ n p_n z⁻ⁿ / P).
            rising = polynomial * z ** np.arange(polynomial.size)
            return float((rising @ np.arange(polynomial.size) / rising.sum()).real)

        return (samples(self._numerator) - samples(self._denominator)) * self.period_s

    @property
    def minus_3db_hz(self) -> float | None:
        """The lowest frequency of gain 1/√2 [Hz]; None when no frequency has it."""
        from scipy import optimize  # noqa: PLC0415 - slow to import, and only asked for in reports

        def excess(frequency_hz: float) -> float:
            return self.gain(frequency_hz) - math.sqrt(0.5)

        grid = np.linspace(0.0, 0.5 / self.period_s, 513)
        for low, high in pairwise(grid.tolist()):
            if excess(high) <= 0.0:
                return float(optimize.brentq(excess, low, high, xtol=1e-10))
        return None
