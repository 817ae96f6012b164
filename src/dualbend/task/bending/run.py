"""The paper's experiment: bend the sheet along a path between two grips that hold it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dualbend.control.controller import Controller
from dualbend.run.known_sheet import make_compliance
from dualbend.run.planar import PlanarRun
from dualbend.scenario.motion import NominalMotion, nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.simulation import Observation
from dualbend.task.bending.config import errors_over_time, misalignment_of
from dualbend.types import SIDES, Vector

SPACE_COLUMNS = tuple(
    (f"{side}_{place}_{turn}", "rad")
    for place in ("grip", "edge")
    for side in SIDES
    for turn in ("roll", "yaw")
)
"""What the trace of a misaligned run has beside a planar one's columns."""


def columns(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """Return the columns that only a run with misaligned grips has."""
    return () if _errors(scenario, _motion(scenario)) is None else SPACE_COLUMNS


def cycles(scenario: Scenario) -> int:
    """Return the command cycles of a run that goes to its end."""
    return _motion(scenario).cycles


def _motion(scenario: Scenario) -> NominalMotion:
    return nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)


def _errors(scenario: Scenario, motion: NominalMotion) -> Vector | None:
    return errors_over_time(misalignment_of(scenario), motion)


class BendingRun(PlanarRun):
    """Bend the sheet along the scenario's path, between grips that may be misaligned in space."""

    def __init__(
        self,
        scenario: Scenario,
        compliance: Callable[[Scenario], Controller] = make_compliance,
    ) -> None:
        motion = _motion(scenario)
        self._errors = _errors(scenario, motion)
        super().__init__(scenario, motion, compliance)

    def on_observed(self, cycle: int, seen: Observation) -> None:
        """Record and apply the misalignment of the grips."""
        if self._errors is not None:
            simulation = self.cell.simulation
            self.trace.record_task(simulation.roll_and_yaw().ravel().tolist())
            errors = np.zeros((2, 6))
            errors[:, [1, 3, 5]] = self._errors[cycle]
            simulation.displace_grasps(errors)
