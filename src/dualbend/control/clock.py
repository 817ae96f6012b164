"""The command clock of the PUMA's ALTER, and how physics steps divide a command period.

Every discrete element of this package runs once per command period T, its argument ``period_s``
[s]; a scenario's run passes in `COMMAND_PERIOD_S`. Its argument ``shape`` is the leading shape of
what it takes, holds and returns: () for a single one. It tells its own transfer function as
``(numerator, denominator)`` in rising powers of z⁻¹, monic denominator:
H(z) = (n₀ + n₁ z⁻¹ + …) / (1 + d₁ z⁻¹ + …).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dualbend.types import Vector

COMMAND_PERIOD_S = 0.028
"""Period of the Cartesian set-points that the joint servos accept [s] (the paper, section V)."""

NYQUIST_HZ = 0.5 / COMMAND_PERIOD_S
"""Half the command rate [Hz], 17.857."""

ComplexVector = NDArray[np.complex128]
TransferFunction = tuple[Vector, Vector]


def rational(transfer: TransferFunction, z_inverse: complex | ComplexVector) -> ComplexVector:
    """Return H where z⁻¹ is given."""
    numerator, denominator = transfer
    return np.asarray(
        np.polyval(numerator[::-1], z_inverse) / np.polyval(denominator[::-1], z_inverse)
    )


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
