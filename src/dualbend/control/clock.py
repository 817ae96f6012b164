"""The command clock, and how physics steps divide a command period.

Every discrete element of this package runs once per command period T, its argument ``period_s``
[s]; a scenario says it, ``robot.command_period_s``. Its argument ``shape`` is the leading shape of
what it takes, holds and returns: () for a single one. It tells its own transfer function as
``(numerator, denominator)`` in rising powers of z⁻¹, monic denominator:
H(z) = (n₀ + n₁ z⁻¹ + …) / (1 + d₁ z⁻¹ + …).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.types import Vector

COMMAND_PERIOD_S = 0.028
"""The default: that of the PUMA's ALTER [s] (the paper, section V)."""

LONGEST_STEP_S = COMMAND_PERIOD_S / 16
"""Physics step where a scenario gives none and the period is a multiple of it [s]."""

ComplexVector = NDArray[np.complex128]
TransferFunction = tuple[Vector, Vector]


def rational(transfer: TransferFunction, z_inverse: complex | ComplexVector) -> ComplexVector:
    """Return H where z⁻¹ is given."""
    numerator, denominator = transfer
    return np.asarray(
        np.polyval(numerator[::-1], z_inverse) / np.polyval(denominator[::-1], z_inverse)
    )


def refuse_beyond_nyquist(key: str, frequency_hz: float, period_s: float) -> None:
    """Raise InputError where a frequency is not below half the command rate 1/T [Hz]."""
    if not frequency_hz < 0.5 / period_s:
        raise InputError(
            f"{key} = {frequency_hz!r}: must be below {0.5 / period_s:.3f} Hz, half the command "
            f"rate of {1.0 / period_s:.3f} Hz"
        )


def default_step_s(period_s: float) -> float:
    """Return the longest physics step up to 1.75 ms that divides the command period [s]."""
    return period_s / math.ceil(period_s / LONGEST_STEP_S - 1e-9)


def steps_per_cycle(step_s: float, period_s: float) -> int:
    """Count the physics steps ``step_s`` [s] in one command period, a whole number.

    Raises
    ------
    ValueError
        The step does not divide the period (relative tolerance 1e-9); the message gives the nearest
        steps that do.
    """
    if not 0.0 < step_s < math.inf:
        raise ValueError(f"step_s = {step_s!r}: must be a positive, finite time in seconds")
    ratio = period_s / step_s
    count = round(ratio)
    if abs(ratio - count) <= 1e-9 * count:
        return count
    shorter = math.floor(ratio) + 1
    counts = [shorter] if shorter == 1 else [shorter, shorter - 1]
    valid = " or ".join(f"{period_s / n:.9g} s ({n} steps)" for n in counts)
    raise ValueError(
        f"step_s = {step_s!r}: does not divide the command period of {period_s} s; "
        f"the nearest that does is {valid}"
    )
