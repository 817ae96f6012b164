"""What ends a run: the robots' protective stop, or physics that can no longer be believed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Annotated, Literal

import numpy as np

from dualbend.types import SIDES, Config, Mask, Side, Vector, said

SENSOR_AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
"""Names of a wrist sensor's axes, in the order of a reading."""


class GuardConfig(Config):
    """Limits of the robots' own protective stop, and how the arms stop; the defaults are assumed.

    An arm that stops slows down evenly in each joint and is held where it comes to rest.
    """

    following_error_rad: Annotated[float, said("joint against its reference", gt=0, le=10)] = 0.02
    following_error_m: Annotated[
        float, said("the same of a slide, such as a rail", gt=0, le=10)
    ] = 0.01
    torque_cycles: Annotated[
        int, said("cycles in a row at the torque limit", ge=1, le=1_000_000)
    ] = 3
    speed_fraction: Annotated[float, said("of the published joint speeds", gt=0, le=1)] = 1.0
    sensor_cycles: Annotated[
        int, said("cycles in a row at a sensor's range end", ge=1, le=1_000_000)
    ] = 5
    lost_cycles: Annotated[
        int, said("cycles in a row without a new reading of a sensor", ge=1, le=1_000_000)
    ] = 5
    contact: Annotated[
        Literal["stop", "record"], said("what a contact does that the task does not intend")
    ] = "stop"
    other_arm: Annotated[
        Literal["stop", "continue"], said("what the other arm does when one stops")
    ] = "stop"
    stop_time_s: Annotated[float, said("from the speed at the stop to rest", ge=1e-3, le=5)] = 0.1
    after_stop_s: Annotated[
        float,
        said("how long the run goes on after a stop, to tell what the sheet bears", ge=0, le=60),
    ] = 0.5


class ProtectiveStop(Exception):  # noqa: N818 - an event of the robot, not an error of ours
    """The robot controller stops an arm; the message says which joint or sensor and why.

    ``sides``: the arms that stop by themselves, both where it does not say which.
    """

    def __init__(self, reason: str, *sides: Side) -> None:
        super().__init__(reason)
        self.sides: tuple[Side, ...] = sides or SIDES


class Guard:
    """Checks, once per command period, what a robot controller checks.

    All over the n joints of both arms: their names, range (n, 2) [rad], torque limit [N m] and
    speed limit [rad/s], of which the configured fraction is allowed; those of ``slides`` in m and
    N. ``shape``: leading shape.
    """

    def __init__(
        self,
        config: GuardConfig,
        joints: Sequence[str],
        joint_range: Vector,
        torque_limit: Vector,
        speed_limit: Vector,
        shape: tuple[int, ...] = (),
        *,
        slides: Collection[str] = (),
    ) -> None:
        self._config, self._joints = config, joints
        self._slides = np.isin([*joints], [*slides])
        self._following = np.where(
            self._slides, config.following_error_m, config.following_error_rad
        )
        self._torque_limit = torque_limit * (1.0 - 1e-6)
        self._speed_limit = config.speed_fraction * speed_limit
        # At or beyond one of these a value is outside: above a limit is at the next larger number.
        low, high = joint_range.T
        over = np.nextafter((self._following, self._speed_limit), np.inf)
        bounds = np.array([(*-over, -self._torque_limit, low), (*over, self._torque_limit, high)])
        self._low, self._high = bounds.reshape(2, 4, *[1] * len(shape), len(joints))
        self._values = np.empty((4, *shape, len(joints)))
        self._cycles_at_limit = np.zeros((*shape, len(joints)), dtype=np.int_)
        self._sides: tuple[Side, ...] = tuple(
            side for joint in joints for side in SIDES if joint.startswith(side)
        )
        self._watched = np.ones(len(joints), dtype=np.bool_)

    def release(self, joints: Mask) -> None:
        """No longer check joints (n,): they have stopped."""
        self._watched &= ~joints

    def outside(self, q: Vector, speed: Vector, torque: Vector, reference: Vector) -> Mask:
        """Tell which joints (..., n) are outside what the controller allows; call once a cycle.

        Returns
        -------
        Mask
            (4, ..., n): by following error, speed, cycles in a row at the torque limit, range.
        """
        values = self._values
        np.subtract(q, reference, out=values[0])
        values[1], values[2], values[3] = speed, torque, q
        outside: Mask = values <= self._low
        outside |= values >= self._high
        if not np.count_nonzero(outside):
            self._cycles_at_limit.fill(0)
            return outside
        at_limit = outside[2]
        self._cycles_at_limit += 1
        self._cycles_at_limit *= at_limit
        np.greater_equal(self._cycles_at_limit, self._config.torque_cycles, out=at_limit)
        return outside

    def check(self, q: Vector, speed: Vector, torque: Vector, reference: Vector) -> None:
        """Raise ProtectiveStop where a joint (n,) of a single robot cell is :meth:`outside`."""
        outside = self.outside(q, speed, torque, reference)
        if not np.count_nonzero(outside):
            return
        outside &= self._watched
        if not outside.any():
            return
        error, speed = np.abs(q - reference), np.abs(speed)
        kind = int(np.argmax(outside.any(axis=1)))
        measures = (
            error / self._following,
            speed / self._speed_limit,
            self._cycles_at_limit,
            outside[3],
        )
        i = int(np.argmax(np.where(self._watched, measures[kind], -1.0)))
        name, allowed = self._joints[i], self._following[i]
        unit, torque_unit, end = "rad", "N m", f"{np.degrees(q[i]):.1f} degrees"
        if self._slides[i]:
            unit, torque_unit, end = "m", "N", f"{q[i]:.4g} m"
        raise ProtectiveStop(
            (
                f"following error of {name} is {error[i]:.4g} {unit}, above {allowed:.4g}",
                f"speed of {name} is {speed[i]:.4g} {unit}/s, above {self._speed_limit[i]:.4g}",
                f"{name} is at its torque limit of {self._torque_limit[i]:.1f} {torque_unit} "
                f"for {self._cycles_at_limit[i]} cycles",
                f"{name} is at its range's end, {end}",
            )[kind],
            *self._sides[i : i + 1],
        )


class SensorGuard:
    """Stops the arms where a wrist sensor tells too long less than acts on it, or nothing new.

    Of the sensors of the arms ``sides``, which give a new reading every ``reading_cycles``;
    ``shape``: leading shape.
    """

    def __init__(
        self,
        config: GuardConfig,
        sides: Sequence[Side],
        shape: tuple[int, ...] = (),
        *,
        reading_cycles: int = 1,
    ) -> None:
        self._sides = sides
        self._cycles = np.zeros((2, *shape, len(sides)), dtype=np.int_)
        allowed = np.array([config.sensor_cycles, config.lost_cycles + reading_cycles - 1])
        self._allowed = allowed.reshape(2, *[1] * (len(shape) + 1))
        self._none = np.zeros_like(self._cycles, dtype=np.bool_)
        self._watched = np.ones(len(sides), dtype=np.bool_)

    def release(self, sides: Collection[Side]) -> None:
        """No longer check the sensors of arms that have stopped."""
        self._watched &= [side not in sides for side in self._sides]

    def outside(self, clipped: Mask, fresh: Mask) -> Mask:
        """Tell which sensors were at their range's end, or lost, for too long; once a cycle.

        ``clipped`` (..., arms, 6): axes at the end of the range in this cycle. ``fresh``
        (..., arms): sensors with a new reading.

        Returns
        -------
        Mask
            (2, ..., arms): by cycles in a row at the range's end, without a new reading.
        """
        if not np.count_nonzero(clipped) and np.count_nonzero(fresh) == fresh.size:
            self._cycles.fill(0)
            return self._none
        self._cycles += 1
        self._cycles[0] *= clipped.any(axis=-1)
        self._cycles[1] *= ~fresh
        return np.asarray(self._cycles >= self._allowed)

    def check(self, clipped: Mask, fresh: Mask) -> None:
        """Raise ProtectiveStop where a sensor (arms,) of a single robot cell is :meth:`outside`."""
        outside = self.outside(clipped, fresh)
        if not np.count_nonzero(outside):
            return
        outside &= self._watched
        if not outside.any():
            return
        kind, i = np.argwhere(outside)[0]
        axes = ", ".join(np.array(SENSOR_AXES)[clipped[i]])
        does = (f"is at the end of its range ({axes})", "has told nothing new")[kind]
        raise ProtectiveStop(
            f"the {self._sides[i]} sensor {does} for {self._cycles[kind, i]} cycles",
            self._sides[i],
        )
