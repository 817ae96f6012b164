"""Steps that begin a sheet with what was found with those before, and that learn from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dualbend.task.assembly.program.motions import Posture
from dualbend.task.assembly.program.state import State
from dualbend.task.assembly.program.steps import Motion, Step
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class Carry(Motion):
    """Carry the sheet to where those before had to be held over the bed, at the height ``z`` [m].

    On the way the arms are raised by as much as they had to be.
    """

    z: float

    def target(self, state: State) -> Posture:
        """Go over the bed."""
        x, y, yaw = state.memory.start[:3].tolist()
        return replace(state.posture, x=x, y=y, z=self.z, yaw=yaw)

    def advance(self, state: State) -> bool:
        """Go on until the motion's time is over."""
        goes_on = super().advance(state)
        state.raise_arms(state.cycle / state.cycles)
        return goes_on


@dataclass(frozen=True, kw_only=True)
class Learn(Step):
    """Remember where the seated sheet is held, from where it was in the air, and how high.

    ``near`` (6,): a sheet that is off by more differs from those before.
    """

    near: Vector

    def advance(self, state: State) -> bool:
        """Learn from it."""
        place = state.memory.start[:3] + state.came()
        found = np.array([*place, state.height, *state.levels])
        state.memory.learn(found, self.near)
        return False
