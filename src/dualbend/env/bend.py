"""Bending as an environment: what is rewarded is that the grips bear no moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dualbend.control.controller import Observation
from dualbend.env.base import SENSING, CellEnv, Info
from dualbend.errors import InputError
from dualbend.scenario.load import Settings
from dualbend.task.bending.run import cycles
from dualbend.types import SIDES, Reals, Vector


class BendEnv(CellEnv):
    """Bend the sheet along the scenario's path with little moment at the grips.

    Observation (14,): of the left arm, then of the right one: filtered force along x and z [N] and
    moment about y [N m], 0 for an arm without a sensor; x, z [m] and pitch [rad] of the grip as the
    encoders tell it, less the nominal one. Then the nominal bending angle [rad] and the time [s].
    All in the arms' bending frames, clipped to the bounds of the space: the sensor's full scale,
    0.1 m and 1 rad.

    Reward of a step: −½ Σ (M/``moment_scale_nm``)² of the true moments at both grips when it is
    done; of the last step, before it. ``info["moment_nm"]`` has them.
    """

    def __init__(
        self,
        scenario: str = "fig6",
        settings: Settings = SENSING,
        *,
        moment_scale_nm: float = 0.5,
        failure_cost: float = 1000.0,
    ) -> None:
        super().__init__(scenario, settings, failure_cost)
        self.moment_scale_nm = moment_scale_nm

    def further(self) -> list[tuple[float, float]]:
        """Return the bounds of bending angle and time."""
        scenario = self.cell.scenario
        if scenario.task.kind != "bending":
            raise InputError(f"scenario {scenario.name!r}: dualbend/Bend-v1 needs a bending")
        return [(0.0, np.pi), (0.0, cycles(scenario) * scenario.period_s)]

    def observed(self, observation: Observation) -> Sequence[Reals]:
        """Return bending angle and time."""
        return observation.nominal.alpha_rad[..., 0], observation.time_s

    def rewarded(self) -> tuple[float, Info]:
        """Return how little the grips' moments are."""
        trace = self.cell.trace
        moment_nm: Vector = np.array([trace[f"{side}_true_moment_y"][-1] for side in SIDES])
        return float(self.reward(moment_nm)), {"moment_nm": moment_nm}

    def reward(self, moment_nm: Vector) -> Reals:
        """Return that of true moments at both grips (..., 2) [N m]."""
        return np.asarray(-0.5 * np.sum((moment_nm / self.moment_scale_nm) ** 2, axis=-1))
