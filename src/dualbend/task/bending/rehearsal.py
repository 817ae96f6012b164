"""The motion without a sheet, before the first one, that tells the joints' friction."""

from __future__ import annotations

import msgspec

from dualbend.control.compliance.admittance import NoComplianceConfig
from dualbend.errors import InputError
from dualbend.imperfection.events import EventsConfig
from dualbend.run.record import RunRecord, whole
from dualbend.scenario.scenario import Scenario
from dualbend.scene.observation import SensorSample
from dualbend.task.bending.run import BendingRun
from dualbend.types import Vector


class Rehearsal(BendingRun):
    """Both arms go the scenario's path forth and back without a sheet and without compliance.

    What happens to a sheet at a time (``imperfections.events``) does not happen before it.
    """

    free = True

    def __init__(self, scenario: Scenario) -> None:
        motion = scenario.motion
        if motion.return_rad is None:
            motion = msgspec.structs.replace(motion, return_rad=scenario.path.start_rad)
        path = msgspec.structs.replace(scenario.path, learned=None)
        alone = NoComplianceConfig(sensing=scenario.compliance.sensing)
        errors = msgspec.structs.replace(scenario.imperfections, events=EventsConfig())
        parts = {"path": path, "motion": motion, "compliance": alone, "imperfections": errors}
        super().__init__(msgspec.structs.replace(scenario, **parts))

    def start(self) -> SensorSample:
        """Put the arms at rest in the path's start, the sheet away from them."""
        sample = super().start()
        self.cell.simulation.take_sheet_away()
        return sample

    def told(self, record: RunRecord) -> Vector:
        """Return true over believed Coulomb friction (n,) of all joints, told by this run [-].

        1 of a joint that the path does not move. InputError where the motion did not go to its end,
        KeyboardInterrupt where the user ended it.
        """
        if whole(record).outcome != "completed":
            raise InputError(
                "robot.servo.friction_estimate: the motion without a sheet ended with "
                f"{record.outcome.replace('_', ' ')}: {record.reason}"
            )
        return self.cell.friction.ratio.copy()
