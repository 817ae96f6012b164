"""The 28 ms command clock, the transport delay and the path modification of VAL II's ALTER.

Every discrete element of this package runs once per command period and tells its own transfer
function as ``(numerator, denominator)`` in rising powers of z⁻¹, monic denominator:
H(z) = (n₀ + n₁ z⁻¹ + …) / (1 + d₁ z⁻¹ + …).
"""

import math
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualbend.errors import InputError

COMMAND_PERIOD_S = 0.028
"""Period of the Cartesian set-points that the joint servos accept [s] (the paper, section V)."""

SERVO_TICKS_PER_CYCLE = 32
"""Interpolation steps of a joint servo in one command period."""

SERVO_TICK_S = 0.875e-3
"""Duration of one interpolation step [s]; 32 of them are the command period."""

Vector = NDArray[np.float64]
TransferFunction = tuple[Vector, Vector]
AlterMode = Literal["world", "tool", "tool-frozen"]


def steps_per_cycle(step_s: float) -> int:
    """Count the physics steps in one command period: n = T / h, a whole number.

    Parameters
    ----------
    step_s
        Physics step h [s].

    Raises
    ------
    ValueError
        The step does not divide 28 ms (relative tolerance 1e-9); the message gives the nearest
        steps that do.
    """
    if not 0.0 < step_s < math.inf:
        raise ValueError(f"step_s = {step_s!r}: must be a positive, finite time in seconds")
    ratio = COMMAND_PERIOD_S / step_s
    count = round(ratio)
    if count >= 1 and abs(ratio - count) <= 1e-9 * count:
        return count
    shorter = math.floor(ratio) + 1
    counts = [shorter] if shorter == 1 else [shorter, shorter - 1]
    valid = " or ".join(f"{COMMAND_PERIOD_S / n:.9g} s ({n} steps)" for n in counts)
    raise ValueError(
        f"step_s = {step_s!r}: does not divide the command period of {COMMAND_PERIOD_S} s; "
        f"the nearest that does is {valid}"
    )


class AlterConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the path modification is executed and how long it takes to get to the servos."""

    mode: Annotated[
        AlterMode,
        msgspec.Meta(
            description="axes of the deviation: world, the tool's, or the tool's as they first were"
        ),
    ] = "world"
    delay_cycles: Annotated[
        int, msgspec.Meta(ge=0, le=100, description="transport delay [command periods]")
    ] = 1


class TransportDelay:
    """Hold a vector back by whole command periods: y[n] = u[n − d], H(z) = z⁻ᵈ.

    Parameters
    ----------
    cycles
        Delay d ≥ 0 [command periods].
    size
        Length of the vector.

    Raises
    ------
    InputError
        A negative delay or a size below 1.
    """

    def __init__(self, cycles: int, size: int) -> None:
        if cycles < 0 or size < 1:
            raise InputError(f"cycles = {cycles}, size = {size}: need cycles >= 0 and size >= 1")
        self.cycles = cycles
        self._held = np.zeros((cycles, size))
        self._oldest = 0

    def reset(self, value: ArrayLike = 0.0) -> None:
        """Fill the line with one value, as if it had been sent for ever."""
        self._held[:] = value
        self._oldest = 0

    def update(self, value: Vector) -> Vector:
        """Send one vector and receive the one that was sent `cycles` calls before."""
        if not self.cycles:
            return value.copy()
        slot: Vector = self._held[self._oldest]
        delayed = slot.copy()
        slot[:] = value
        self._oldest = (self._oldest + 1) % self.cycles
        return delayed

    def transfer_function(self) -> TransferFunction:
        """Tell z⁻ᵈ as (numerator, denominator) in powers of z⁻¹."""
        numerator = np.zeros(self.cycles + 1)
        numerator[-1] = 1.0
        return numerator, np.ones(1)


class PlanarPathModification:
    """Add a deviation to a nominal grip pose (x, z, α) in the bending frame B.

    The deviation is executed in a frame turned by φ about y_B:
    x' = x + δx cos φ, z' = z − δx sin φ, α' = α + δα, with φ = 0 in mode "world", φ = α in mode
    "tool" and φ = α at the start of ALTER in mode "tool-frozen". The last is what VAL II does: it
    does not update the tool's rotation matrix while moving (Robotics FAQ, section 12).
    The deviation is not cumulative: it is the whole deviation of this cycle.
    """

    def __init__(self, mode: AlterMode) -> None:
        self.mode: AlterMode = mode
        self._start_alpha_rad: float | None = None

    def reset(self) -> None:
        """End ALTER; the next call of `compose` starts it anew."""
        self._start_alpha_rad = None

    def compose(
        self, x_m: float, z_m: float, alpha_rad: float, dx_m: float, dalpha_rad: float
    ) -> tuple[float, float, float]:
        """Return the commanded (x [m], z [m], α [rad]) in B."""
        if self._start_alpha_rad is None:
            self._start_alpha_rad = alpha_rad
        if self.mode == "world":
            return x_m + dx_m, z_m, alpha_rad + dalpha_rad
        phi = alpha_rad if self.mode == "tool" else self._start_alpha_rad
        return (
            x_m + dx_m * math.cos(phi),
            z_m - dx_m * math.sin(phi),
            alpha_rad + dalpha_rad,
        )
