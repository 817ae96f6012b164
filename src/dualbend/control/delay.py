"""The transport delay between a command and its execution."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dualbend.control.clock import TransferFunction
from dualbend.errors import InputError
from dualbend.types import Vector


class TransportDelay:
    """Hold a vector back by whole command periods: y[n] = u[n − d], H(z) = z⁻ᵈ.

    ``cycles``: d [command periods]; vectors are (*shape, size).

    Raises
    ------
    InputError
        A negative delay or a size below 1.
    """

    def __init__(self, cycles: int, size: int, shape: tuple[int, ...] = ()) -> None:
        if cycles < 0 or size < 1:
            raise InputError(f"cycles = {cycles}, size = {size}: need cycles >= 0 and size >= 1")
        self.cycles = cycles
        self._held = np.zeros((cycles, *shape, size))
        self._oldest = 0

    def reset(self, value: ArrayLike) -> None:
        """Fill the line with one vector, as if it had been sent for ever."""
        self._held[:] = value

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
