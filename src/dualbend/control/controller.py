"""What a controller is: once per command period from an observation to a deviation of both arms."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Protocol

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualbend.control.alter import AlterMode, PathModification
from dualbend.control.delay import TransportDelay, WorldDelays
from dualbend.control.force_torque import WrenchReading
from dualbend.registry import raised_at
from dualbend.types import Mask, PlanarPose, Vector, Wrench

IN_PLANE, AT_REST = np.zeros((2, 3)), np.zeros(4)
"""Nothing out of the bending plane; the place of bending frames that are carried nowhere."""
IN_PLANE.flags.writeable = AT_REST.flags.writeable = False


class Observation(msgspec.Struct, frozen=True, kw_only=True):
    """What a controller knows at the start of a command cycle, of any leading shape.

    Attributes
    ----------
    time_s
        Since the start of the run [s].
    phase
        Name of the phase of the motion; an array of names where worlds differ.
    raw, filtered
        Wrenches (..., 2, 6) on the left and the right arm about the grip centres, each in its arm's
        bending frame, before and after the low-pass; NaN for an arm without a sensor.
    clipped
        (..., arms with a sensor, 6): axes of a sensor at the end of its range: more acts than read.
    fresh
        (..., arms with a sensor): its reading is a new one; else the last one stands here again.
    joints_rad
        Measured joint angles (..., n) of both arms.
    measured, nominal
        Poses (..., 2, 3) of the grips, each in its arm's bending frame: as the joints' encoders
        tell them, and as the path has them.
    aside
        y [m], roll and yaw [rad] (..., 2, 3) of the measured grips, out of the bending plane.
    place
        x, y, z [m] and turn about the vertical [rad] (4,) in the world of the frames in which an
        assembly has nominal poses, and executes deviations: the bending frames, carried with the
        sheet. 0 where they rest, as in bending.
    """

    time_s: float
    phase: str | NDArray[np.str_]
    raw: Wrench
    filtered: Wrench
    clipped: Mask
    fresh: Mask
    joints_rad: Vector
    measured: PlanarPose
    nominal: PlanarPose
    aside: Vector = IN_PLANE
    place: Vector = AT_REST

    @classmethod
    def of(
        cls,
        reading: WrenchReading,
        *,
        time_s: float,
        phase: str | NDArray[np.str_],
        joints_rad: Vector,
        measured: PlanarPose,
        nominal: PlanarPose,
        aside: Vector = IN_PLANE,
        place: Vector = AT_REST,
    ) -> Observation:
        """Return what a reading tells in the bending frames, turned by the measured slopes."""
        both = reading.grips.in_bending_frame(measured.alpha_rad)
        return cls(
            time_s=time_s,
            phase=phase,
            raw=both.part(0),
            filtered=both.part(1),
            clipped=reading.clipped,
            fresh=reading.fresh,
            joints_rad=joints_rad,
            measured=measured,
            nominal=nominal,
            aside=aside,
            place=place,
        )


NEVER: Mask = np.zeros(1, dtype=np.bool_)
"""What a controller without bounds of its own has met of them."""


class Controller(Protocol):
    """What turns an observation into a deviation of both arms, once per command period.

    A deviation (..., 2, 6) is what is added to the nominal poses of the left and the right arm: x,
    y, z [m], roll, pitch, yaw [rad] in the arm's bending frame; it is not cumulative. A controller
    that bounds it may say so in an attribute ``saturated`` (..., any further axes), which a run
    records.
    """

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation (..., 2, 6) of this cycle."""


def as_numbers(given: ArrayLike) -> Vector:
    """Return what a controller gave as an array of floats; TypeError where it is no real number."""
    numbers = np.asarray(given)
    if numbers.dtype.kind == "c":
        raise TypeError("its deviation is complex")
    return np.asarray(numbers, dtype=np.float64)


class ControllerFailed(Exception):  # noqa: N818 - it ends a run, as a protective stop does
    """A controller raised an exception, or gave what is no deviation; the message says which."""


class Command(msgspec.Struct, frozen=True, kw_only=True):
    """What is sent in one cycle.

    ``deviation`` (..., 2, 6) as the controller gave it. ``pose`` (..., 2, 3): the commanded poses
    of the grips in their bending frames, with the deviation that the transport delay let through;
    ``aside`` (..., 2, 3): y [m], roll and yaw [rad] of them, out of the bending plane.
    ``saturated`` (..., any further axes): the controller met a bound of its own.
    """

    deviation: Vector
    pose: PlanarPose
    aside: Vector
    saturated: Mask


class ControlledPath:
    """Controller → transport delay of each arm [command periods] → path modification."""

    def __init__(
        self,
        controller: Controller,
        *,
        delay_cycles: Sequence[int],
        mode: AlterMode,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.controller = controller
        self._delays: list[TransportDelay | WorldDelays]
        self._delays = [TransportDelay(cycles, 6, shape) for cycles in delay_cycles]
        self._modification = PathModification(mode)

    @classmethod
    def stacked(cls, many: Sequence[ControlledPath], controller: Controller) -> ControlledPath:
        """Return that of many worlds, of one mode, which their controllers in one go before."""
        joined = copy.copy(many[0])
        joined.controller = controller
        arms = zip(*(one._delays for one in many), strict=True)
        joined._delays = [TransportDelay.stacked(delays) for delays in arms]
        joined._modification = PathModification(joined._modification.mode)
        return joined

    def command(self, observation: Observation, action: Vector | None = None) -> Command:
        """Ask the controller and modify the nominal poses.

        An ``action`` takes the place of its deviation in this cycle. It is asked all the same: what
        it remembers goes on.

        Raises
        ------
        ControllerFailed
            The controller did, or its deviation is not finite, or of another shape.
        """
        shape = (*observation.nominal.coordinates.shape[:-1], 6)
        try:
            deviation = as_numbers(self.controller(observation))
        except (Exception, SystemExit) as error:
            raise ControllerFailed(f"{type(error).__name__}: {error}{raised_at(error)}") from error
        saturated = getattr(self.controller, "saturated", NEVER)
        if action is not None:
            deviation, saturated = action, NEVER
        if deviation.shape != shape:
            raise ControllerFailed(f"its deviation is of shape {deviation.shape}, not {shape}")
        if np.count_nonzero(np.isfinite(deviation)) < deviation.size:
            raise ControllerFailed(f"its deviation is not finite: {deviation.tolist()}")
        late = np.empty(shape)
        for i, delay in enumerate(self._delays):
            late[..., i, :] = delay.update(deviation[..., i, :])
        pose, aside = self._modification.compose(observation.nominal, late)
        return Command(deviation=deviation, pose=pose, aside=aside, saturated=saturated)
