"""What happens at a time: an arm stops, a gripper fails, the sheet slips."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from dualbend.types import SIDES, Config, Side, Vector, said

_ROUNDING_S = 1e-9


class Event(Config):
    """Something that happens once, on one side of the cell."""

    at_s: Annotated[float, said("simulated time at which it happens", ge=0, le=3600)] = 0.0
    side: Annotated[Side, said("arm or gripper that it happens to")] = "left"

    def due(self, time_s: float) -> bool:
        """Tell whether it has happened at a time of the simulation."""
        return time_s >= self.at_s - _ROUNDING_S


class ArmStop(Event):
    """One arm stops by itself, as after a fault of its controller; [guard] says how."""


class PowerFailure(Event):
    """A gripper's power fails: the force of its jaws decays to what a return spring keeps."""

    remaining: Annotated[float, said("share of the force that a spring keeps", ge=0, le=1)] = 0.0
    time_constant_s: Annotated[float, said("of the decay; assumed", ge=1e-3, le=10)] = 0.05

    def share(self, time_s: float) -> float:
        """Return the share of the jaws' force that is left, r + (1 − r) exp(−t/τ)."""
        since = max(time_s - self.at_s, 0.0)
        return self.remaining + (1.0 - self.remaining) * math.exp(-since / self.time_constant_s)


class Oil(Event):
    """Something slippery gets into a grip: its friction is lower for a time."""

    for_s: Annotated[float, said("until the friction is as it was", ge=0, le=3600)] = 0.5
    friction_ratio: Annotated[float, said("friction over that of the dry grip", ge=0, le=1)] = 0.1

    def share(self, time_s: float) -> float:
        """Return the share of the friction that is left."""
        slippery = self.due(time_s) and not time_s >= self.at_s + self.for_s - _ROUNDING_S
        return self.friction_ratio if slippery else 1.0


class EventsConfig(Config):
    """What happens at a time: an arm stops, a gripper fails, the sheet slips."""

    arm_stop: ArmStop | None = None
    power_failure: PowerFailure | None = None
    oil: Oil | None = None

    @property
    def grips(self) -> tuple[PowerFailure | Oil, ...]:
        """What happens to a gripper's friction."""
        return tuple(event for event in (self.power_failure, self.oil) if event is not None)

    def friction_share(self, time_s: float) -> Vector:
        """Return the share of its friction that each grip has at a time (2,)."""
        share = np.ones(len(SIDES))
        for event in self.grips:
            share[SIDES.index(event.side)] *= event.share(time_s)
        return share
