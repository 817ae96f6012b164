"""The paper's experiment: bend the sheet along a path between two grips that hold it."""

from __future__ import annotations

import numpy as np

from dualbend.control.controller import Controller
from dualbend.control.learning import CorrectedController
from dualbend.run.learned import read_for
from dualbend.run.planar import PlanarRun
from dualbend.scenario.motion import NominalMotion, nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.observation import SensorSample
from dualbend.task.bending.config import errors_over_time, imposed_errors
from dualbend.types import SIDES, Mask, Vector

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

    Attributes
    ----------
    grip_errors : how the edges lie to their grippers (k, 2, 6), up to where they stay as they are;
        None where they lie right
    grips_change : (cycles,) whether they lie otherwise than in the cycle before

    ``correction`` (2, cycles): turn that is added to each arm's path [rad], and ``friction`` (n,):
    true over believed Coulomb friction of all joints, in place of the file that the scenario names.
    """

    def __init__(
        self,
        scenario: Scenario,
        correction: Vector | None = None,
        friction: Vector | None = None,
    ) -> None:
        self._imposed = imposed_errors(scenario)
        self.grip_errors: Vector | None = None
        self.grips_change: Mask = np.zeros(1, dtype=np.bool_)
        self._correction = correction
        if correction is not None:
            self.learned = "a correction from Python"
        elif scenario.path.learned is not None:
            found, self.learned = read_for(scenario)
            self._correction, friction = found.correction, found.friction
        super().__init__(scenario, _motion(scenario))
        if friction is not None:
            self.cell.friction.known[:] = friction

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
            taken = simulation.observer.grasps(simulation.data)
        errors = errors_over_time(taken, self._imposed, self.motion)
        changes = np.any(np.diff(errors, axis=0), axis=(1, 2))
        self.grips_change = np.concatenate(([False], changes))
        self.grip_errors = errors[: np.flatnonzero(self.grips_change).max(initial=0) + 1].copy()
        simulation.displace_grasps(self.grip_errors[0])
        return super().start()

    def on_cycle(self, cycle: int) -> None:
        """Apply the misalignment of the grips."""
        if self.grip_errors is not None and self.grips_change[cycle]:
            self.cell.simulation.displace_grasps(self.grip_errors[cycle])

    def on_observed(self) -> None:
        """Record how the grips are turned, where they are misaligned."""
        if self.grip_errors is not None:
            simulation = self.cell.simulation
            self.trace.record_task(simulation.observer.roll_and_yaw(simulation.data).ravel())
