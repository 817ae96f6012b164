"""The section of the task ``bending``: grips may hold the sheet wrong in space.

How the sheet's edge stands to the gripper is wrong because the sheet was taken so or the tool
stands so on its flange. Path, controller and sensor know nothing of it: the sheet is pushed,
twisted and bent all the same.

Arms that stand wrong themselves close their jaws on a sheet that lies where it should. Where its
edge then is in the jaws' plane, and how it is turned in it, stays; the jaws' normal is forced on
it.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np

from dualbend.errors import InputError
from dualbend.imperfection.draws import cut_normal, stream
from dualbend.scenario.motion import MotionConfig, NominalMotion
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import SheetConfig
from dualbend.scenario.task import TaskConfig
from dualbend.types import Config, Vector, said

SHORTEST_SETTLE_S = 0.25
"""The errors come in while the arms settle: faster, the sheet would be struck."""

_FORCED = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])
"""Which of x, y, z, roll, pitch and yaw the jaws force on an edge on which they close."""


class GripError(Config):
    """How the edge stands off the gripper's frame G: R_GE = R_z(yaw) R_y(pitch) R_x(roll)."""

    along_m: Annotated[float, said("into the sheet, along x_G", ge=-0.05, le=0.05)] = 0.0
    lateral_m: Annotated[float, said("across the sheet, along y_G", ge=-0.05, le=0.05)] = 0.0
    height_m: Annotated[float, said("along z_G, the jaws' normal", ge=-0.05, le=0.05)] = 0.0
    roll_rad: Annotated[float, said("about x_G, which points into the sheet", ge=-0.5, le=0.5)] = (
        0.0
    )
    pitch_rad: Annotated[float, said("about y_G, the bending axis", ge=-0.5, le=0.5)] = 0.0
    yaw_rad: Annotated[float, said("about z_G, the jaws' normal", ge=-0.5, le=0.5)] = 0.0


class MisalignmentConfig(Config):
    """Errors of both grips in space, which neither path nor controller knows."""

    left: GripError = GripError()
    right: GripError = GripError()
    along_spread_m: Annotated[
        float, said("of along_m from sheet to sheet, each grip", ge=0, le=0.01)
    ] = 0.0
    pitch_spread_rad: Annotated[
        float, said("of pitch_rad from sheet to sheet, each grip", ge=0, le=0.1)
    ] = 0.0

    def errors(self, seed: int = 0, repeat: int = 0) -> Vector:
        """Return (2, 6): x, y, z [m], roll, pitch, yaw [rad] of the left and the right grip.

        Of a cell's seed and the number of a sheet, which draws what differs between sheets.
        """
        found = np.array([msgspec.structs.astuple(side) for side in (self.left, self.right)])
        spread = np.array([self.along_spread_m, self.pitch_spread_rad])
        rng = stream(seed, "grips", repeat=repeat)
        found[:, [0, 4]] += cut_normal(rng, 1.0, (2, 2)) * spread
        return found


class BendingConfig(TaskConfig, tag="bending"):
    """Bend the sheet along the path between two grips, hold it, and maybe go back."""

    misalignment: MisalignmentConfig | None = None

    @property
    def learns(self) -> bool:
        """A path of it can be corrected from sheet to sheet."""
        return True

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


def is_in_space(scenario: Scenario) -> bool:
    """Tell whether what the grips do to the sheet leaves the bending plane."""
    return misalignment_of(scenario) is not None or scenario.imperfections.robot.displaces


def imposed_errors(scenario: Scenario) -> Vector | None:
    """Return what is imposed on both grips (2, 6); None where every grip lies as it should."""
    config, displaced = misalignment_of(scenario), scenario.imperfections.robot.displaces
    imposed = (config or MisalignmentConfig()).errors(scenario.seed, scenario.repeat)
    if not displaced and not imposed.any():
        return None
    return imposed


def errors_over_time(taken: Vector, imposed: Vector, motion: NominalMotion) -> Vector:
    """Return how the edges lie to their grippers (cycles, 2, 6) at every cycle.

    They begin as ``taken`` (2, 6) where the jaws close and go to what is imposed (2, 6) smoothly,
    by (1 − cos πτ)/2, over the first three quarters of the settling phase: the sheet is at rest in
    its plane before and at the end of it. Of what was taken x, y and yaw stay, beside what is
    imposed: jaws do not force them.
    """
    settle = max(int(np.count_nonzero(motion.phase == 0)), 1)
    tau = np.minimum(np.arange(motion.cycles) / (0.75 * settle), 1.0)
    share = 0.5 * (1.0 - np.cos(np.pi * tau))[:, np.newaxis, np.newaxis]
    return np.asarray(taken + share * (imposed - taken * _FORCED))
