"""Of which arm the numbers of a run speak: the one whose sensor the compliance listens to."""

import numpy as np
import pytest

from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from support.strip import STRIP8

SHORT = (
    *("path.end_rad=0.3", "path.interval_rad=0.1", "motion.speed_rad_per_s=0.4"),
    *("motion.settle_s=0.3", "motion.hold_s=0.1"),
)


def run(sensing: str) -> RunRecord:
    # The sheet lies across the right grip: the two arms do not feel quite the same.
    across = "task.misalignment.right.lateral_m=5e-4"
    return BendingRun(
        load_scenario(STRIP8, [*SHORT, across, f"compliance.sensing={sensing}"])
    ).run()


@pytest.mark.parametrize(
    ("sensing", "side"),
    [('["left"]', "left"), ('["right"]', "right"), ('["left","right"]', "left")],
)
def test_the_metrics_are_those_of_the_arm_that_senses(sensing: str, side: str) -> None:
    result = run(sensing)
    assert result.sensing_side == side
    bending = result.trace["phase"] == result.phases.index("bend")
    peaks = {
        one: float(np.abs(result.trace[f"{one}_true_moment_y"][bending]).max())
        for one in ("left", "right")
    }
    # Analytic: the same numbers; and the arms are not alike, or this would tell nothing.
    assert result.metrics["peak_moment"].value == peaks[side]
    pieces = result.metrics["peak_moment_by_piece"].value
    assert isinstance(pieces, list)
    assert max(value for value in pieces if value is not None) == peaks[side]
    assert abs(peaks["left"] / peaks["right"] - 1.0) > 1e-4
