"""The control experiment: constants in the controller's place, of the same mean deviation."""

from __future__ import annotations

import numpy as np

from dualbend.control.controller import Observation
from dualbend.evaluation.metrics import bending_rows
from dualbend.run.record import RunRecord
from dualbend.types import SIDES, Vector

_PITCH = 4
"""Of a deviation's components x, y, z, roll, pitch, yaw."""


class Constants:
    """Turns both grips by a constant for each piece of the path; the last one stays in the hold.

    ``knots``: inner knots of the path [rad]; ``turns``: (pieces, 2) deviations of both arms [rad].
    Before the bending, the grips stay where they are.
    """

    def __init__(self, knots: Vector, turns: Vector) -> None:
        self._knots, self._turns = knots, turns

    @classmethod
    def of(cls, run: RunRecord, one: bool) -> Constants:
        """Take the means of a run's deviations while it bends: of each piece, or one of all."""
        knots = run.scenario.path.make(run.scenario.sheet.length_m).knots[1:-1]
        rows = bending_rows(run)
        turns = np.column_stack([run[f"{side}_deviation_alpha"][rows] for side in SIDES])
        if one:
            return cls(knots[:0], turns.mean(axis=0, keepdims=True))
        piece = np.searchsorted(knots, run["nominal_alpha"][rows], side="right")
        return cls(knots, np.array([turns[piece == k].mean(axis=0) for k in range(len(knots) + 1)]))

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation (2, 6) of the piece that the nominal angle is in."""
        deviation = np.zeros((2, 6))
        if observation.phase != "settle":
            alpha = float(observation.nominal.alpha_rad[0])
            deviation[:, _PITCH] = self._turns[np.searchsorted(self._knots, alpha, side="right")]
        return deviation
