"""What the command link does wrong, and what the robot controllers do then."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np

from dualbend.control.guard import ProtectiveStop
from dualbend.imperfection.draws import stream
from dualbend.types import Config, Side, Vector, said

Policy = Literal["hold", "extrapolate", "stop"]


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


class CommandLink:
    """The joint set-points (n,) of both arms on their way to the robot controllers.

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
        ends = itertools.accumulate(joints)
        self._own = [slice(end - n, end) for end, n in zip(ends, joints, strict=True)]
        self._arms = [
            _Arm(config, seed, side, start[own], period_s, repeat)
            for side, own in zip(sides, self._own, strict=True)
        ]

    def deliver(self, setpoint: Vector) -> Vector:
        """Send the set-points of a cycle and return those that are executed in it.

        Raises
        ------
        ProtectiveStop
            An arm has been without a command for too long.
        """
        return np.concatenate(
            [arm.deliver(setpoint[own]) for arm, own in zip(self._arms, self._own, strict=True)]
        )

    @property
    def ages(self) -> list[int]:
        """How many cycles ago the newest command that each arm has was due; 0: it is this one's."""
        return [arm.age for arm in self._arms]


class _Arm:
    """One arm's link and what its controller executes."""

    def __init__(
        self,
        config: LinkConfig,
        seed: int,
        side: Side,
        start: Vector,
        period_s: float,
        repeat: int,
    ) -> None:
        self._config, self._side, self._period_s = config, side, period_s
        names = ("jitter", "late", "lost", "doubled")
        self._jitter, self._late, self._lost, self._doubled = (
            stream(seed, "link", side, name, repeat=repeat) for name in names
        )
        self._due: dict[int, tuple[int, Vector]] = {}
        self._executed = self._before = start
        self._cycle = self._newest = -1
        self._missing, self._burst, self._again = 0, 0, False

    @property
    def age(self) -> int:
        """Cycles since the newest command that arrived was due."""
        return self._cycle - self._newest

    def deliver(self, q: Vector) -> Vector:
        """Send a set-point and return the one that is executed."""
        self._cycle += 1
        # All are drawn in every cycle: no kind of error moves the draws of another.
        late, doubled = self._lateness(), self._doubled.random() < self._config.doubled_probability
        if not self._is_lost():
            # A newer command takes the place of one that is due in the same cycle.
            self._due[self._cycle + late] = self._cycle, q
        found = self._due.pop(self._cycle, None)
        executed = self._executed
        if self._again:
            self._again, self._missing = False, 0
        elif found is not None and found[0] > self._newest:
            self._newest, executed = found
            self._again, self._missing = doubled, 0
        else:
            executed = self._without_command()
        self._before, self._executed = self._executed, executed
        return executed

    def _without_command(self) -> Vector:
        config = self._config
        self._missing += 1
        if self._missing >= (1 if config.policy == "stop" else config.stop_cycles):
            raise ProtectiveStop(
                f"the {self._side} arm's controller got no command for {self._missing} cycle"
                f"{'s' if self._missing > 1 else ''}",
                self._side,
            )
        if config.policy == "hold":
            return self._executed
        return 2.0 * self._executed - self._before

    def _is_lost(self) -> bool:
        if not self._burst and self._lost.random() < self._config.lost_probability:
            self._burst = int(self._lost.geometric(1.0 / self._config.burst_cycles))
        lost = self._burst > 0
        self._burst -= lost
        return lost

    def _lateness(self) -> int:
        """Return by how many cycles the command is late."""
        config = self._config
        after_s = config.jitter_s * self._jitter.standard_normal() - config.slack_s
        late = max(math.ceil(after_s / self._period_s), 0)
        return max(late, int(self._late.random() < config.late_probability))
