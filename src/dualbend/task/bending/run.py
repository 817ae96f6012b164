"""The paper's experiment: bend the sheet along a path between two grips that hold it."""

from __future__ import annotations

import numpy as np

from dualbend.control.controller import Controller
from dualbend.control.learning import CorrectedController
from dualbend.run.learned import path_correction
from dualbend.run.planar import PlanarRun
from dualbend.scenario.motion import NominalMotion, nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.simulation import Observation, SensorSample
from dualbend.task.bending.config import errors_over_time, imposed_errors
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
    return () if imposed_errors(scenario) is None else SPACE_COLUMNS


def cycles(scenario: Scenario) -> int:
    """Return the command cycles of a run that goes to its end."""
    return _motion(scenario).cycles


def _motion(scenario: Scenario) -> NominalMotion:
    return nominal_motion(
        scenario.path, scenario.motion, scenario.sheet.length_m, scenario.period_s
    )


class BendingRun(PlanarRun):
    """Bend the sheet along the scenario's path, between grips that may be misaligned in space.

    ``correction`` (2, cycles): turn that is added to each arm's path [rad], in place of the file
    that the scenario names.
    """

    def __init__(self, scenario: Scenario, correction: Vector | None = None) -> None:
        self._imposed = imposed_errors(scenario)
        self._correction = correction
        if correction is not None:
            self.learned = "a correction from Python"
        elif scenario.path.learned is not None:
            self._correction, self.learned = path_correction(scenario)
        super().__init__(scenario, _motion(scenario))

    def controller(self) -> Controller:
        """Return the compliance, with what was learned added where something was."""
        plain = super().controller()
        if self._correction is None:
            return plain
        return CorrectedController(plain, self._correction, period_s=self.scenario.period_s)

    def start(self) -> SensorSample:
        """Put the cell at rest in its start; the jaws close on the sheet where they are."""
        sample = super().start()
        if self._imposed is None:
            return sample
        simulation, taken = self.cell.simulation, np.zeros_like(self._imposed)
        if self.scenario.imperfections.robot.displaces:
            taken = simulation.grasps()
        self._errors = errors_over_time(taken, self._imposed, self.motion)
        self._changes = np.ones(len(self._errors), dtype=np.bool_)
        self._changes[1:] = np.any(self._errors[1:] != self._errors[:-1], axis=(1, 2))
        simulation.displace_grasps(self._errors[0])
        return super().start()

    def on_observed(self, cycle: int, seen: Observation) -> None:
        """Record and apply the misalignment of the grips."""
        if self._imposed is not None:
            simulation = self.cell.simulation
            self.trace.record_task(simulation.roll_and_yaw().ravel().tolist())
            if self._changes[cycle]:
                simulation.displace_grasps(self._errors[cycle])
