"""What the command link does wrong, and what the robot controllers do then."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from dualbend.control.guard import ProtectiveStop
from dualbend.control.worlds import BLOCK, Draw, Stackable, drawn
from dualbend.imperfection.draws import ahead, stream
from dualbend.types import Config, Mask, Side, Vector, said

Policy = Literal["hold", "extrapolate", "stop"]
_LARGEST_NORMAL = 12.3
"""NumPy's normal numbers are smaller: the tail of its ziggurat ends at 3.65 + √(106 ln 2)."""


class LinkConfig(Config):
    """The link from the supervisor to both robot controllers, each arm's by itself.

    A command that arrives after its cycle began is late: it is executed in the first cycle that
    begins after its arrival, unless that has a newer one. With jitter the part Q(slack/jitter) of
    the commands is late, Q the upper tail of the normal distribution. A doubled command is executed
    once more in the next cycle, in place of that one's own. Losses come in bursts whose length is
    geometric; with p the probability that one begins and L its mean length, the part
    p L/(p L + 1 − p) of all commands is lost.
    """

    jitter_s: Annotated[
        float, said("standard deviation of a command's time of arrival", ge=0, le=1)
    ] = 0.0
    slack_s: Annotated[
        float, said("from the mean arrival to the cycle that is to execute it", ge=0, le=1)
    ] = 0.005
    late_probability: Annotated[
        float, said("that a command is late by a cycle, beside the jitter [-]", ge=0, le=1)
    ] = 0.0
    lost_probability: Annotated[float, said("that a burst of losses begins [-]", ge=0, le=1)] = 0.0
    burst_cycles: Annotated[float, said("mean length of such a burst", ge=1, le=1e6)] = 1.0
    doubled_probability: Annotated[
        float, said("that a command is executed twice [-]", ge=0, le=1)
    ] = 0.0
    policy: Annotated[
        Policy,
        said(
            "in a cycle that gets no command: hold the last set-point, go on at the last speed, or "
            "stop at once"
        ),
    ] = "hold"
    stop_cycles: Annotated[
        int, said("cycles in a row without a command that stop the arm", ge=1, le=1_000_000)
    ] = 5

    @property
    def errs(self) -> bool:
        """Whether any command can be late, lost or doubled."""
        return bool(
            self.jitter_s
            or self.late_probability
            or self.lost_probability
            or self.doubled_probability
        )


class CommandLink(Stackable):
    """The joint set-points (..., n) of both arms on their way to the robot controllers.

    ``joints``: number of joints of each arm of ``sides``; ``start``: set-points (n,) [rad] that the
    controllers have before the first command. One is sent a cycle of ``period_s`` [s].
    ``repeat``: number of the sheet in a series; each has errors of its own.
    """

    def __init__(
        self,
        config: LinkConfig,
        seed: int,
        sides: Sequence[Side],
        joints: Sequence[int],
        start: Vector,
        *,
        period_s: float,
        repeat: int = 0,
    ) -> None:
        self._sides, self._joints = tuple(sides), tuple(joints)
        arms = len(sides)
        lost = config.lost_probability

        def streams(name: str) -> list[np.random.Generator]:
            return [stream(seed, "link", side, name, repeat=repeat) for side in sides]

        # Each has a stream of its own: no kind of error moves the draws of another.
        self._jitter = [
            ahead(own.standard_normal, when=config.jitter_s) for own in streams("jitter")
        ]
        self._late = [ahead(own.random, when=config.late_probability) for own in streams("late")]
        self._lost = [
            losses(own, lost, config.burst_cycles) if lost else None for own in streams("lost")
        ]
        self._doubled = [
            ahead(own.random, when=config.doubled_probability) for own in streams("doubled")
        ]
        of_arms = partial(np.full, arms)
        self._jitter_s, self._slack_s = of_arms(config.jitter_s), of_arms(config.slack_s)
        self._p_late = of_arms(config.late_probability)
        self._p_doubled = of_arms(config.doubled_probability)
        self._extrapolates = of_arms(config.policy == "extrapolate")
        self._stop_cycles = of_arms(1 if config.policy == "stop" else config.stop_cycles)
        latest = np.ceil(_LARGEST_NORMAL * config.jitter_s / period_s)
        self._period_s, self._remembered = of_arms(period_s), of_arms(int(latest) + 2)
        self._executed = self._before = start
        self._newest, self._missing = np.full(arms, -1), np.zeros(arms, dtype=np.int_)
        self._again: Mask = np.zeros(arms, dtype=np.bool_)
        self._cycle, self._waiting = -1, False

    def deliver(self, setpoint: Vector) -> Vector:
        """Do what :meth:`forward` does with the set-points (n,) of a single robot cell.

        Raises
        ------
        ProtectiveStop
            An arm has been without a command for too long.
        """
        executed = self.forward(setpoint)
        if self._waiting:
            for side, cycles in zip(self._sides, self.starved, strict=True):
                if cycles:
                    raise no_command(side, cycles)
        return executed

    def forward(self, setpoint: Vector) -> Vector:
        """Send the set-points (..., n) of a cycle and return those that are executed in it."""
        self._cycle += 1
        at = self._cycle % BLOCK
        if not at:
            self._draw()
        if self._waiting or self._wrong[at]:
            executed = self._received(setpoint, at)
        else:
            executed = setpoint.copy()
            self._newest.fill(self._cycle)
        self._before, self._executed = self._executed, executed
        return executed

    @property
    def starved(self) -> NDArray[np.int_]:
        """Cycles without a command (..., arms) of arms that stop for that; 0 of all others."""
        return np.where(self._missing >= self._stop_cycles, self._missing, 0)

    @property
    def age(self) -> NDArray[np.int_]:
        """How many cycles ago the newest command that each arm has was due (..., arms); 0: now."""
        return self._cycle - self._newest

    def _draw(self) -> None:
        """Draw when the next commands arrive and which are lost or doubled."""
        shape = self._newest.shape
        if not self._cycle:
            # Command s is in row s of these, modulo their length, and is due in row s + late.
            rows = int(self._remembered.max())
            self._sent = np.zeros((rows, *self._executed.shape))
            # The last row is of those that are lost.
            self._due = np.full((rows + 1, *shape), -1)
            self._arms = tuple(np.indices(shape))
            self._axes = tuple(np.indices(self._executed.shape))
        after_s = self._jitter_s * drawn(self._jitter, shape) - self._slack_s
        late = np.maximum(np.ceil(after_s / self._period_s), 0.0).astype(np.int_)
        late = np.maximum(late, drawn(self._late, shape) < self._p_late)
        lost = drawn(self._lost, shape) > 0.0
        self._doubles = drawn(self._doubled, shape) < self._p_doubled
        cycles = np.arange(self._cycle, self._cycle + BLOCK).reshape(-1, *[1] * len(shape))
        rows = len(self._sent)
        self._arrives = np.where(lost, rows, (cycles + late) % rows)
        wrong = (late > 0) | lost | self._doubles
        self._wrong = wrong.reshape(BLOCK, -1).any(axis=1).tolist()

    def _received(self, setpoint: Vector, at: int) -> Vector:
        """Send the set-points (..., n) of a cycle in which an arm may not get its own command."""
        row = self._cycle % len(self._sent)
        self._sent[row] = setpoint
        # A newer command takes the place of one that is due in the same cycle.
        self._due[(self._arrives[at], *self._arms)] = self._cycle
        found = self._due[row].copy()
        self._due[row] = -1
        new = (found > self._newest) & ~self._again
        without = ~(new | self._again)
        self._newest = np.where(new, found, self._newest)
        self._missing = (self._missing + 1) * without
        self._again = new & self._doubles[at]
        self._waiting = bool((self._again | without).any())
        came = self._of_joints(found % len(self._sent))
        executed = np.where(self._of_joints(new), self._sent[(came, *self._axes)], self._executed)
        further = without & self._extrapolates
        if further.any():
            at_last_speed = 2.0 * self._executed - self._before
            executed = np.where(self._of_joints(further), at_last_speed, executed)
        return executed

    def _of_joints(self, of_arms: NDArray[Any]) -> NDArray[Any]:
        """Return for each joint (..., n) what is said of its arm (..., arms)."""
        return np.repeat(of_arms, self._joints, axis=-1)


def no_command(side: Side, cycles: int) -> ProtectiveStop:
    """Return the stop of an arm that has been without a command for so many cycles."""
    plural = "s" if cycles > 1 else ""
    return ProtectiveStop(
        f"the {side} arm's controller got no command for {cycles} cycle{plural}", side
    )


def losses(rng: np.random.Generator, probability: float, burst_cycles: float) -> Draw:
    """Return what tells of the next BLOCK commands which are lost; in a burst none can begin.

    A number is drawn for each command out of a burst, and then the burst's length where one begins:
    what was drawn beyond a beginning is drawn again after it.
    """
    source, left = rng.bit_generator, 0
    assert isinstance(source, np.random.PCG64)

    def draw() -> Mask:
        nonlocal left
        lost, at = np.arange(BLOCK) < left, min(left, BLOCK)
        left -= at
        while at < BLOCK:
            begins = np.flatnonzero(rng.random(BLOCK - at) < probability)
            if not begins.size:
                break
            first = at + int(begins[0])
            source.advance(first + 1 - BLOCK)
            end = first + int(rng.geometric(1.0 / burst_cycles))
            at = min(end, BLOCK)
            lost[first:at], left = True, end - at
        return lost

    return draw
