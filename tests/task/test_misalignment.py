"""Misaligned grips: how the errors come in, where the edges end up, what is refused."""

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.motion import nominal_motion
from dualbend.task.bending.config import GripError, MisalignmentConfig, errors_over_time
from dualbend.task.bending.run import SPACE_COLUMNS, BendingRun
from support.strip import STRIP6

SHORT = ("path.end_rad=0.2", "motion.hold_s=0.1")
ERROR = MisalignmentConfig(right=GripError(lateral_m=1e-3, roll_rad=0.02, yaw_rad=-0.01))


def test_errors_rise_from_nothing_while_the_arms_settle_and_then_stay() -> None:
    scenario = load_scenario(STRIP6, SHORT)
    motion = nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)
    errors = errors_over_time(ERROR, motion)
    assert errors is not None
    # Analytic.
    assert not errors[0].any()
    assert (errors[motion.phase > 0] == ERROR.errors()).all()
    assert (np.diff(np.abs(errors), axis=0) >= 0).all()


def test_no_error_is_no_misalignment() -> None:
    scenario = load_scenario(STRIP6, SHORT)
    motion = nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)
    assert errors_over_time(None, motion) is None
    assert errors_over_time(MisalignmentConfig(), motion) is None


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_edge_stands_to_its_gripper_as_configured(side: str) -> None:
    settings = (
        f"task.misalignment.{side}.lateral_m=1e-4",
        f"task.misalignment.{side}.roll_rad=0.02",
    )
    result = BendingRun(load_scenario(STRIP6, [*SHORT, *settings])).run()
    trace = result.trace
    assert result.outcome == "completed"
    assert {name for name, _ in SPACE_COLUMNS} <= {name for name, _ in trace.columns}
    row = int(np.argmax(trace["phase"] > 0)) - 1
    # The pads give: 0.3 N over 0.96e6 N/m, some mN m over 267 N m/rad; golden, 5 %.
    offset = trace[f"{side}_edge_y"][row] - trace[f"{side}_grip_y"][row]
    assert offset == pytest.approx(1e-4, rel=0.05)
    rolled = trace[f"{side}_edge_roll"][row] - trace[f"{side}_grip_roll"][row]
    assert rolled == pytest.approx(0.02, rel=0.01)


def test_both_grips_wrong_alike_do_not_twist_the_sheet() -> None:
    # Rolled alike as seen from outside: each about its own x_G, which point at each other.
    alike = ("task.misalignment.left.roll_rad=0.02", "task.misalignment.right.roll_rad=-0.02")
    twisted = ("task.misalignment.left.roll_rad=0.02", "task.misalignment.right.roll_rad=0.02")
    torque = []
    for errors in (alike, twisted):
        trace = BendingRun(load_scenario(STRIP6, [*SHORT, *errors])).run().trace
        row = int(np.argmax(trace["phase"] > 0)) - 1
        torque.append(abs(float(trace["left_true_moment_x"][row])))
    # The weight of the tilted sheet is all that is left of it.
    assert torque[0] < 0.05 * torque[1]


@pytest.mark.parametrize(
    ("scenario", "settings", "reason"),
    [
        (
            "fig6",
            ["task.misalignment.right.lateral_m=0.2"],
            "task.misalignment.right.lateral_m = 0.2",
        ),
        ("fig6", ["task.misalignment.right.rol_rad=0.2"], "did you mean roll_rad"),
        (
            "fig6",
            ["task.misalignment.right.roll_rad=0.1", "motion.settle_s=0.1"],
            "at least 0.25 s",
        ),
        ("pwb", ["task.misalignment.right.roll_rad=0.1"], 'belongs to kind = "bending"'),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(
    scenario: str, settings: list[str], reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        load_scenario(scenario, settings)
