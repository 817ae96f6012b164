"""The command clock of the PUMA's ALTER, and how physics steps divide a command period.

A command period is an argument of whatever needs it; `COMMAND_PERIOD_S` is what a scenario's run
passes in.

Every discrete element of this package runs once per command period and tells its own transfer
function as ``(numerator, denominator)`` in rising powers of z⁻¹, monic denominator:
H(z) = (n₀ + n₁ z⁻¹ + …) / (1 + d₁ z⁻¹ + …).
"""

from __future__ import annotations

import math

from dualbend.types import Vector

COMMAND_PERIOD_S = 0.028
"""Period of the Cartesian set-points that the joint servos accept [s] (the paper, section V)."""


NYQUIST_HZ = 0.5 / COMMAND_PERIOD_S
"""Half the command rate [Hz], 17.857."""


SERVO_TICKS_PER_CYCLE = 32
"""Interpolation steps of a joint servo in one command period."""


SERVO_TICK_S = 0.875e-3
"""Duration of one interpolation step [s]; 32 of them are the command period."""


TransferFunction = tuple[Vector, Vector]


def steps_per_cycle(step_s: float, period_s: float) -> int:
    """Count the physics steps in one command period: n = T / h, a whole number.

    Parameters
    ----------
    step_s
        Physics step h [s].
    period_s
        Command period T [s].

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
    if count >= 1 and abs(ratio - count) <= 1e-9 * count:
        return count
    shorter = math.floor(ratio) + 1
    counts = [shorter] if shorter == 1 else [shorter, shorter - 1]
    valid = " or ".join(f"{period_s / n:.9g} s ({n} steps)" for n in counts)
    raise ValueError(
        f"step_s = {step_s!r}: does not divide the command period of {period_s} s; "
        f"the nearest that does is {valid}"
    )
