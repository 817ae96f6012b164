"""The paper's compliance of both arms as one controller."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from dualbend.control.compliance.admittance import Admittance
from dualbend.control.controller import Observation
from dualbend.control.wrist import arm_slice
from dualbend.types import Mask, PlanarPose, Vector


class PairCompliance:
    """Each sensing arm complies by an admittance; an arm without a sensor mirrors the first one.

    The sensing arms are the last axis of the admittance's leading shape; ``complying`` are those
    that deviate, both as indices.
    """

    def __init__(
        self, admittance: Admittance, *, sensing: Sequence[int], complying: Sequence[int]
    ) -> None:
        self.admittance = admittance
        self._sensing, self._complying = arm_slice(sensing), arm_slice(complying)
        # Mirrored, a deviation has the same components: each arm's frame is its own.
        self._source = self._complying if len(sensing) > 1 else slice(None)

    @classmethod
    def stacked(cls, many: Sequence[PairCompliance]) -> PairCompliance:
        """Return that of many worlds, whose arms sense and comply alike."""
        joined = copy.copy(many[0])
        joined.admittance = Admittance.stacked([one.admittance for one in many])
        return joined

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation (..., 2, 6) along x and in pitch."""
        arms = self._sensing
        given = self.admittance.comply(
            observation.filtered.planar[..., arms, :],
            PlanarPose(observation.nominal.coordinates[..., arms, :]),
        )
        deviation = np.zeros(observation.filtered.components.shape)
        deviation[..., self._complying, ::4] = given[..., self._source, :]
        return deviation

    @property
    def saturated(self) -> Mask:
        """Deviations (..., sensing arms, 2) that are at their bounds, δx and δα."""
        return self.admittance.saturated
