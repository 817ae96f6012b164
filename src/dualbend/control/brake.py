"""The stop of a joint: its reference comes to rest in a given time and stays there."""

from __future__ import annotations

import numpy as np

from dualbend.control.response import CommandReference
from dualbend.types import Mask, Vector


class Brakes:
    """Which of n joints have stopped, and the reference that they follow instead.

    From place q₀ and speed v₀ at the stop the reference slows down evenly,
    ``q(t) = q₀ + v₀ t (1 − t/2T)``, to rest at ``q₀ + v₀ T/2``: joints that stop together stay on
    their common way. ``time_s``: T; ``steps`` physics steps a cycle of ``period_s``.
    """

    def __init__(self, joints: int, steps: int, *, period_s: float, time_s: float) -> None:
        self._times_s = (period_s / steps * np.arange(1, steps + 1))[:, np.newaxis]
        self._period_s, self._time_s = period_s, time_s
        self.stopped: Mask = np.zeros(joints, dtype=np.bool_)
        self.reset()

    def reset(self) -> None:
        """Let all joints follow their commands."""
        self.stopped[:] = False
        self._from, self._speed, self._since_s = np.zeros((3, len(self.stopped)))

    def stop(self, joints: Mask, position: Vector, speed: Vector) -> None:
        """Stop joints (n,) of a position [rad] and speed [rad/s]; those that have stay stopped."""
        new = joints & ~self.stopped
        self._from[new], self._speed[new], self._since_s[new] = position[new], speed[new], 0.0
        self.stopped |= joints

    def update(self, reference: CommandReference) -> CommandReference:
        """Return the reference (steps, n) of the next cycle: of the stopped joints that of a stop.

        Once a cycle; ``reference`` is what the commands ask for.
        """
        if not np.count_nonzero(self.stopped):
            return reference
        passed = np.minimum((self._since_s + self._times_s) / self._time_s, 1.0)
        self._since_s += self._period_s
        v, time_s = self._speed, self._time_s
        return CommandReference(
            position=np.where(
                self.stopped,
                self._slowed(passed),
                reference.position,
            ),
            velocity=np.where(self.stopped, v * (1.0 - passed), reference.velocity),
            acceleration=np.where(
                self.stopped, np.where(passed < 1.0, -v / time_s, 0.0), reference.acceleration
            ),
        )

    def position(self, commanded: Vector) -> Vector:
        """Return the reference (n,) at the end of the last cycle: where joints stopped, their own.

        ``commanded`` (n,): that of the joints that follow their commands.
        """
        if not np.count_nonzero(self.stopped):
            return commanded
        passed = np.minimum(self._since_s / self._time_s, 1.0)
        return np.where(self.stopped, self._slowed(passed), commanded)

    def _slowed(self, passed: Vector) -> Vector:
        """Return where joints are at shares t/T of the time of a stop."""
        return np.asarray(self._from + self._speed * self._time_s * passed * (1.0 - 0.5 * passed))
