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
    """Carry the sheet over the bed, to where those before had to be held; ``z`` [m]: how high."""

    z: float

    def target(self, state: State) -> Posture:
        """Go over the bed."""
        x, y, yaw = state.memory.start.tolist()
        return replace(state.posture, x=x, y=y, z=self.z, yaw=yaw)


@dataclass(frozen=True, kw_only=True)
class Learn(Step):
    """Remember where the seated sheet is held, from where it was in the air.

    ``near`` (3,): a sheet that is off by more is elsewhere than those before.
    """

    near: Vector

    def advance(self, state: State) -> bool:
        """Learn from it."""
        found = state.memory.start + state.came()
        state.memory.learn(found, self.near, np.array([state.height, *state.levels]))
        return False
