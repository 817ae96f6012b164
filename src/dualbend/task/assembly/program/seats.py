"""Steps that feel whether a sheet is on its pins."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from dualbend.task.assembly.program.motions import Posture, interpolate
from dualbend.task.assembly.program.state import State
from dualbend.task.assembly.program.steps import Motion, Step


@dataclass(frozen=True, kw_only=True)
class TouchPins(Step):
    """Move the sheet one way until its pins hold it; stop the task where they do not.

    ``axis``: x, y or yaw; ``step``: of a cycle, one way or the other, [m] or [rad]. They hold it
    where it is pushed back with ``force`` [N] or [N m], within ``most`` of motion, as the encoders
    tell it: arms that stick need not go where they are sent. ``slack``: sent further, an arm that
    has not moved is stuck.
    """

    axis: int
    step: float
    force: float
    most: float
    slack: float

    def advance(self, state: State) -> bool:
        """Go on until the force is felt."""
        seen, name, way = state.seen[-1], ("x", "y", "yaw")[self.axis], math.copysign(1, self.step)
        if state.cycle == 0:
            state.begin, state.touch_from = state.posture, seen.place
        assert state.touch_from is not None
        felt = -way * float(state.contact_wrench(seen.net)[self.axis])
        if felt >= self.force:
            return False
        moved = way * float(seen.place[self.axis] - state.touch_from[self.axis])
        sent = abs(state.cycle * self.step)
        if moved > self.most or sent > self.most + self.slack:
            raise state.stopped(self._said(moved, felt))
        here = getattr(state.posture, name) + self.step
        state.posture, state.cycle = replace(state.posture, **{name: here}), state.cycle + 1
        return True

    def _said(self, moved: float, felt: float) -> str:
        how = ("along it", "across it", "by turning it")[self.axis]
        way, push = ("mrad", "N m") if self.axis == 2 else ("mm", "N")
        return (
            f"not all holes are on their pins: moving the sheet {how} by {1e3 * moved:.2f} {way} "
            f"is held with {felt:.2f} {push}; pins would hold it with {self.force:.2f} {push} "
            f"within {1e3 * self.most:.2f} {way}"
        )


@dataclass(frozen=True, kw_only=True)
class Centre(Motion):
    """Go back by half of the motion from one contact to the other."""

    def target(self, state: State) -> Posture:
        """Return the middle between here and where the last motion began."""
        return interpolate(state.posture, state.begin, 0.5)
