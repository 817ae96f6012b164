"""The wrist sensors of two arms, of which one may have none."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from dualbend.control.force_torque import WrenchChain, WrenchReading
from dualbend.control.worlds import Stackable
from dualbend.types import SIDES, Vector, Wrench


def arm_slice(arms: Sequence[int]) -> slice:
    """Return none, one or both of two arms as a slice of an axis of arms."""
    return slice(min(arms), max(arms) + 1) if arms else slice(0)


class WristSensors(Stackable):
    """The wrench chain of those arms, by index, that carry a sensor: its last leading axis."""

    def __init__(self, chain: WrenchChain, arms: Sequence[int]) -> None:
        self.chain, self.arms = chain, tuple(arms)
        self._part = arm_slice(arms)

    def read(self, wrench: Vector, rotation: Vector, *, new: bool = True) -> WrenchReading:
        """Measure the true wrenches (..., 2, 6) at the sensors, in S; their axes (..., 2, 3, 3).

        ``new``: these are other samples than the last ones.

        What is told at the grips is of both arms (2, ..., 2, 6), NaN of one without a sensor; the
        rest is of the arms with a sensor only.
        """
        arms = self._part
        reading = self.chain.update(wrench[..., arms, :], rotation[..., arms, :, :], new=new)
        if len(self.arms) == len(SIDES):
            return reading
        both = np.full((2, *wrench.shape), np.nan)
        both[..., arms, :] = reading.grips.components
        return msgspec.structs.replace(reading, grips=Wrench(both, "grip", "grip"))
