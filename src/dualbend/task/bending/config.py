"""The section of the task ``bending``: grips may hold the sheet wrong in space.

Each arm is where it should be; what is wrong is how the sheet's edge stands to the gripper: off
across, rolled or yawed, because the sheet was taken so or the tool stands so on its flange. Path,
controller and sensor know nothing of it: the sheet is twisted and pushed across all the same.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np

from dualbend.errors import InputError
from dualbend.scenario.motion import MotionConfig, NominalMotion
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import SheetConfig
from dualbend.scenario.task import TaskConfig
from dualbend.types import Config, Vector, said

SHORTEST_SETTLE_S = 0.25
"""The errors come in while the arms settle: faster, the sheet would be struck."""


class GripError(Config):
    """How the sheet's edge stands off the gripper's frame G: R_GE = R_z(yaw) R_x(roll)."""

    lateral_m: Annotated[float, said("across the sheet, along y_G", ge=-0.05, le=0.05)] = 0.0
    roll_rad: Annotated[float, said("about x_G, which points into the sheet", ge=-0.5, le=0.5)] = (
        0.0
    )
    yaw_rad: Annotated[float, said("about z_G, the jaws' normal", ge=-0.5, le=0.5)] = 0.0


class MisalignmentConfig(Config):
    """Errors of both grips in space, which neither path nor controller knows."""

    left: GripError = GripError()
    right: GripError = GripError()

    def errors(self) -> Vector:
        """Return (2, 3): lateral [m], roll and yaw [rad] of the left and the right grip."""
        return np.array([msgspec.structs.astuple(side) for side in (self.left, self.right)])


class BendingConfig(TaskConfig, tag="bending"):
    """Bend the sheet along the path between two grips, hold it, and maybe go back."""

    misalignment: MisalignmentConfig | None = None

    def check(self, sheet: SheetConfig, motion: MotionConfig) -> None:
        """Refuse misalignment that would strike the sheet."""
        del sheet
        if self.misalignment is not None and motion.settle_s < SHORTEST_SETTLE_S:
            raise InputError(
                f"motion.settle_s = {motion.settle_s}: misalignment comes in while the arms "
                f"settle and needs at least {SHORTEST_SETTLE_S} s"
            )


def misalignment_of(scenario: Scenario) -> MisalignmentConfig | None:
    """Return the misalignment of the grips; None where there is none, or the task has none."""
    task = scenario.task
    return task.misalignment if isinstance(task, BendingConfig) else None


def errors_over_time(config: MisalignmentConfig | None, motion: NominalMotion) -> Vector | None:
    """Return the errors (cycles, 2, 3) at every cycle, None where there are none.

    They rise smoothly, by (1 − cos πτ)/2, over the first three quarters of the settling phase: the
    sheet starts in its plane, and at the end of the phase it is at rest.
    """
    if config is None or not config.errors().any():
        return None
    settle = max(int(np.count_nonzero(motion.phase == 0)), 1)
    tau = np.minimum(np.arange(motion.cycles) / (0.75 * settle), 1.0)
    share = 0.5 * (1.0 - np.cos(np.pi * tau))
    return np.asarray(share[:, np.newaxis, np.newaxis] * config.errors())
