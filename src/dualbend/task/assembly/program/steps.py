"""The kinds of steps that the assembly's program is made of: motions, waits, measurements.

A step holds what is the same for every execution of the program; what changes is in the `State`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dualbend.task.assembly.program.motions import Pace, Posture
from dualbend.task.assembly.program.state import State
from dualbend.types import SIDES


@dataclass(frozen=True, kw_only=True)
class Step:
    """One line of the table.

    ``alpha_ratio``: the compliance is that of a sheet bent as far as it is now, and at most this
    far, over the bending angle at which it is laid; None: no compliance. ``retry_only``: not in the
    first attempt. ``relax``: the compliance goes back to no deviation meanwhile.
    """

    alpha_ratio: float | None = None
    retry_only: bool = False
    relax: bool = False

    def advance(self, state: State) -> bool:
        """Choose the next cycle's posture, the first one at ``state.cycle`` 0; False: it is over.

        A step that is over in the first needs no cycle.
        """
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Motion(Step):
    """Go from the present posture to another one."""

    pace: Pace

    def target(self, state: State) -> Posture:
        """Return where to go; asked once, where the motion begins."""
        raise NotImplementedError

    def advance(self, state: State) -> bool:
        """Go on until the motion's time is over."""
        if state.cycle == 0:
            state.begin, state.end = state.posture, self.target(state)
            state.cycles = self.pace.cycles(state.begin, state.end)
        return state.go_on()


@dataclass(frozen=True, kw_only=True)
class Move(Motion):
    """Move some components of the posture."""

    to: Mapping[str, float]

    def target(self, state: State) -> Posture:
        """Leave the others as they are."""
        return replace(state.posture, **self.to)


@dataclass(frozen=True, kw_only=True)
class Wait(Step):
    """Stay until a quantity lies between two bounds, and stop the task where it takes too long.

    It is looked at after half a second, or where the time-out ends before; ``rest_cycles`` pass
    before all that.
    """

    quantity: Callable[[State], float]
    above: float = -math.inf
    below: float = math.inf
    otherwise: str
    timeout_s: float
    period_s: float
    rest_cycles: int = 0

    def advance(self, state: State) -> bool:
        """Stay for another cycle, or stop the task."""
        waited, allowed = state.cycle - self.rest_cycles, math.ceil(self.timeout_s / self.period_s)
        if waited >= min(state.mean_cycles, allowed):
            if self.above < self.quantity(state) < self.below:
                return False
            if waited == allowed:
                raise state.stopped(f"{self.otherwise} after {self.timeout_s:g} s")
        state.cycle += 1
        return True


@dataclass(frozen=True)
class Measure(Step):
    """Keep the mean of the last half second for later comparison."""

    name: Literal["empty", "free", "seated"]

    def advance(self, state: State) -> bool:
        """Keep it."""
        setattr(state, self.name, state.mean())
        return False


@dataclass(frozen=True)
class CheckGrasp(Step):
    """Stop the task where jaws have closed with no sheet between them."""

    thickness_m: float

    def advance(self, state: State) -> bool:
        """Compare the gaps with half of the thickness."""
        for side, gap in zip(SIDES, state.mean().gap, strict=True):
            if gap < 0.5 * self.thickness_m:
                raise state.stopped(
                    f"nothing is between the {side} jaws: they closed to {1e3 * gap:.2f} mm, "
                    f"the sheet has {1e3 * self.thickness_m:.2f} mm"
                )
        return False


@dataclass(frozen=True)
class CheckFlat(Step):
    """Stop the task where the lifted sheet is not flat by itself.

    A sheet of rest curvature κ that is held flat turns its grips by EI κ beyond ``moment_nm``, that
    of its weight. ``least_nm``: below it nothing is told. Both arms' mean is taken: arms of unequal
    heights turn their grips the one way and the other.
    """

    stiffness_nm2: float
    moment_nm: float
    least_nm: float

    def advance(self, state: State) -> bool:
        """Compare what has been added to the empty grippers."""
        assert state.empty is not None
        added = float(np.mean(state.mean().moment - state.empty.moment))
        if abs(added - self.moment_nm) >= self.least_nm:
            curvature = (added - self.moment_nm) / self.stiffness_nm2
            raise state.stopped(
                f"the sheet is bent by itself, by {curvature:.2f} 1/m: held flat it turns the "
                f"grips with {1e3 * added:.0f} mN m, a flat one with {1e3 * self.moment_nm:.0f}"
            )
        return False


@dataclass(frozen=True)
class CheckWeight(Step):
    """Stop the task where the arms carry something else than the sheet."""

    weight_n: float
    least_force_n: float

    def advance(self, state: State) -> bool:
        """Compare what has been added to the empty grippers; allow for half of the weight.

        Sensors do not tell the weight of a sheet that is lighter than what they are wrong by.
        """
        assert state.empty is not None
        carried = float(state.empty.net[2] - state.mean().net[2])
        if abs(carried - self.weight_n) >= max(0.5 * self.weight_n, 2.0 * self.least_force_n):
            raise state.stopped(
                f"the arms carry {carried:.2f} N, the sheet weighs {self.weight_n:.2f} N"
            )
        return False
