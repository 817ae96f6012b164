"""The controllers of many worlds as one."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from dualbend.control.compliance.admittance import Admittance
from dualbend.control.compliance.pair import PairCompliance
from dualbend.control.controller import NEVER, Controller, Observation, as_numbers
from dualbend.control.learning import CorrectedController
from dualbend.types import Mask, PlanarPose, Vector, Wrench


def joined(controllers: Sequence[Controller]) -> Controller:
    """Return what gives the deviations (n, 2, 6) of n worlds, each by its own controller.

    Those of the paper's kind are computed in one go, others one after the other.
    """
    corrected = [one for one in controllers if isinstance(one, CorrectedController)]
    if len(corrected) == len(controllers):
        return CorrectedController.stacked(corrected, joined([one.controller for one in corrected]))
    plain = [one for one in controllers if isinstance(one, PairCompliance)]
    plain = [one for one in plain if type(one.admittance) is Admittance]
    if len(plain) == len(controllers):
        return PairCompliance.stacked(plain)
    return OneByOne(controllers)


def one_by_one(controller: Controller) -> OneByOne | None:
    """Return the controllers that are asked world by world; None where there are none."""
    inner = controller.controller if isinstance(controller, CorrectedController) else controller
    return inner if isinstance(inner, OneByOne) else None


class OneByOne:
    """Controllers that know of one world only, such as a user's.

    ``failed`` (n,): what one raised, or gave that is no deviation; its world has none from then on.
    """

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self._controllers = controllers
        self.failed: Mask = np.zeros(len(controllers), dtype=np.bool_)
        self.saturated: Mask = np.zeros((len(controllers), 1), dtype=np.bool_)

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviations (n, 2, 6)."""
        shape = (*observation.nominal.coordinates.shape[:-1], 6)
        deviation = np.zeros(shape)
        for world, controller in enumerate(self._controllers):
            if self.failed[world]:
                continue
            try:
                given = as_numbers(controller(of_world(observation, world)))
            except (Exception, SystemExit):  # the world is run again alone, and says what it was
                self.failed[world] = True
                continue
            if given.shape != shape[1:] or not np.isfinite(given).all():
                self.failed[world] = True
                continue
            deviation[world] = given
            self.saturated[world] = np.any(getattr(controller, "saturated", NEVER))
        return deviation


class ActiveOnly:
    """A controller of n worlds of which the others than the ``active`` (n,) have no deviation.

    What is observed of them may be NaN.
    """

    def __init__(self, controller: Controller, active: Mask) -> None:
        self._controller, self._active = controller, active

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviations (n, 2, 6)."""
        deviation = self._controller(observation)
        deviation[~self._active] = 0.0
        return deviation

    @property
    def saturated(self) -> Mask:
        """What the controller says of its own bounds."""
        return np.asarray(getattr(self._controller, "saturated", NEVER))


def of_world(observation: Observation, world: int) -> Observation:
    """Return what is observed in one of many worlds."""

    def wrench(of: Wrench) -> Wrench:
        return Wrench(of.components[world], of.frame, of.point)

    return msgspec.structs.replace(
        observation,
        phase=str(np.asarray(observation.phase)[world]),
        raw=wrench(observation.raw),
        filtered=wrench(observation.filtered),
        clipped=observation.clipped[world],
        fresh=observation.fresh[world],
        joints_rad=observation.joints_rad[world],
        measured=PlanarPose(observation.measured.coordinates[world]),
        nominal=PlanarPose(observation.nominal.coordinates[world]),
        aside=observation.aside[world],
    )
