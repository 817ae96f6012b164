"""The transport delay between a command and its execution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualbend.control.clock import TransferFunction
from dualbend.errors import InputError
from dualbend.types import Vector


class TransportDelay:
    """Hold a vector back by whole command periods: y[n] = u[n − d], H(z) = z⁻ᵈ.

    ``cycles``: d [command periods]; vectors are (*shape, size). :class:`WorldDelays` is that of
    worlds whose delays differ.

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

    @classmethod
    def stacked(cls, many: Sequence[TransportDelay]) -> TransportDelay | WorldDelays:
        """Return that of many worlds, freshly made."""
        cycles = np.array([one.cycles for one in many])
        shape = many[0]._held.shape[1:]
        if np.all(cycles == cycles[0]):
            return cls(int(cycles[0]), shape[-1], (len(many), *shape[:-1]))
        return WorldDelays(cycles, shape)

    def transfer_function(self) -> TransferFunction:
        """Tell z⁻ᵈ as (numerator, denominator) in powers of z⁻¹."""
        numerator = np.zeros(self.cycles + 1)
        numerator[-1] = 1.0
        return numerator, np.ones(1)


class WorldDelays:
    """Hold the vectors (n, *shape) of n worlds back, each by its own d (n,) [command periods]."""

    def __init__(self, cycles: NDArray[np.int_], shape: tuple[int, ...]) -> None:
        self._worlds, self._cycles = np.arange(len(cycles)), cycles
        self._held = np.zeros((int(cycles.max()) + 1, len(cycles), *shape))
        self._now = 0

    def update(self, value: Vector) -> Vector:
        """Send one vector of each world and receive the one that was sent d calls before."""
        length = len(self._held)
        self._held[self._now] = value
        delayed: Vector = self._held[(self._now - self._cycles) % length, self._worlds]
        self._now = (self._now + 1) % length
        return delayed
