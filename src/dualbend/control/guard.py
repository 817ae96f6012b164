"""What ends a run: the robots' protective stop, or physics that can no longer be believed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from dualbend.types import Config, Mask, Vector, said


class GuardConfig(Config):
    """Limits of the robots' own protective stop; the defaults are assumed."""

    following_error_rad: Annotated[float, said("joint against its reference", gt=0, le=10)] = 0.02
    torque_cycles: Annotated[
        int, said("cycles in a row at the torque limit", ge=1, le=1_000_000)
    ] = 3
    speed_fraction: Annotated[float, said("of the published joint speeds", gt=0, le=1)] = 1.0


class ProtectiveStop(Exception):  # noqa: N818 - an event of the robot, not an error of ours
    """The robot controller stops the arms; the message says which joint and why."""


class Guard:
    """Checks, once per command period, what a robot controller checks.

    All over the n joints of both arms: their names, range (n, 2) [rad], torque limit [N m] and
    speed limit [rad/s], of which the configured fraction is allowed. ``shape``: leading shape.
    """

    def __init__(
        self,
        config: GuardConfig,
        joints: Sequence[str],
        joint_range: Vector,
        torque_limit: Vector,
        speed_limit: Vector,
        shape: tuple[int, ...] = (),
    ) -> None:
        self._config, self._joints = config, joints
        self._low, self._high = joint_range.T
        self._torque_limit = torque_limit * (1.0 - 1e-6)
        self._speed_limit = config.speed_fraction * speed_limit
        self._cycles_at_limit = np.zeros((*shape, len(joints)), dtype=np.int_)

    def outside(self, q: Vector, speed: Vector, torque: Vector, reference: Vector) -> Mask:
        """Tell which joints (..., n) are outside what the controller allows; call once a cycle.

        Returns
        -------
        Mask
            (4, ..., n): by following error, speed, cycles in a row at the torque limit, range.
        """
        self._cycles_at_limit += 1
        self._cycles_at_limit *= np.abs(torque) >= self._torque_limit
        outside = np.empty((4, *q.shape), dtype=np.bool_)
        np.greater(np.abs(q - reference), self._config.following_error_rad, out=outside[0])
        np.greater(np.abs(speed), self._speed_limit, out=outside[1])
        np.greater_equal(self._cycles_at_limit, self._config.torque_cycles, out=outside[2])
        np.logical_or(q <= self._low, q >= self._high, out=outside[3])
        return outside

    def check(self, q: Vector, speed: Vector, torque: Vector, reference: Vector) -> None:
        """Raise ProtectiveStop where a joint (n,) of a single robot cell is :meth:`outside`."""
        outside = self.outside(q, speed, torque, reference)
        if not np.count_nonzero(outside):
            return
        error, speed = np.abs(q - reference), np.abs(speed)
        kind = int(np.argmax(outside.any(axis=1)))
        measures = (error, speed / self._speed_limit, self._cycles_at_limit, outside[3])
        i = int(np.argmax(measures[kind]))
        name, allowed = self._joints[i], self._config.following_error_rad
        raise ProtectiveStop(
            (
                f"following error of {name} is {error[i]:.4g} rad, above {allowed:.4g}",
                f"speed of {name} is {speed[i]:.4g} rad/s, above {self._speed_limit[i]:.4g}",
                f"{name} is at its torque limit of {self._torque_limit[i]:.1f} N m "
                f"for {self._cycles_at_limit[i]} cycles",
                f"{name} is at its range's end, {np.degrees(q[i]):.1f} degrees",
            )[kind]
        )
