"""What ends a run: the robots' protective stop, or physics that can no longer be believed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np

from dualbend.types import Vector


class GuardConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Limits of the robots' own protective stop; the defaults are assumed."""

    following_error_rad: Annotated[
        float, msgspec.Meta(gt=0, description="joint against its reference")
    ] = 0.02
    torque_cycles: Annotated[
        int, msgspec.Meta(ge=1, description="cycles in a row at the torque limit")
    ] = 3
    speed_fraction: Annotated[
        float, msgspec.Meta(gt=0, le=1, description="of the published joint speeds")
    ] = 1.0


class ProtectiveStop(Exception):  # noqa: N818 - an event of the robot, not an error of ours
    """The robot controller stops the arms; the message says which joint and why."""


class Guard:
    """Checks, once a command cycle, what a robot controller checks.

    All over the n joints of both arms: their names, range (n, 2) [rad], torque limit [N m] and
    speed limit [rad/s], of which the configured fraction is allowed.
    """

    def __init__(
        self,
        config: GuardConfig,
        joints: Sequence[str],
        joint_range: Vector,
        torque_limit: Vector,
        speed_limit: Vector,
    ) -> None:
        self._config, self._joints = config, joints
        self._low, self._high = joint_range.T
        self._torque_limit = torque_limit * (1.0 - 1e-6)
        self._speed_limit = config.speed_fraction * speed_limit
        self._cycles_at_limit = np.zeros(len(joints), dtype=np.int_)

    def check(self, q: Vector, speed: Vector, torque: Vector, reference: Vector) -> None:
        """Raise ProtectiveStop where a joint (n,) is outside what the controller allows."""
        error = q - reference
        checks = (
            (np.abs(error), self._config.following_error_rad, "following error", "rad"),
            (np.abs(speed), self._speed_limit, "speed", "rad/s"),
        )
        for value, limit, name, unit in checks:
            over = value > limit
            if over.any():
                i = int(np.argmax(value / limit))
                allowed = float(np.broadcast_to(limit, value.shape)[i])
                raise ProtectiveStop(
                    f"{name} of {self._joints[i]} is {value[i]:.4g} {unit}, above {allowed:.4g}"
                )
        at_limit = np.abs(torque) >= self._torque_limit
        self._cycles_at_limit = np.where(at_limit, self._cycles_at_limit + 1, 0)
        if (self._cycles_at_limit >= self._config.torque_cycles).any():
            i = int(np.argmax(self._cycles_at_limit))
            raise ProtectiveStop(
                f"{self._joints[i]} is at its torque limit of {self._torque_limit[i]:.1f} N m "
                f"for {self._cycles_at_limit[i]} cycles"
            )
        outside = (q <= self._low) | (q >= self._high)
        if outside.any():
            i = int(np.argmax(outside))
            raise ProtectiveStop(
                f"{self._joints[i]} is at its range's end, {np.degrees(q[i]):.1f} degrees"
            )
