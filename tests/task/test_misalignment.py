"""Misaligned grips: how the errors come in, where the edges end up, what is refused."""

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.motion import nominal_motion
from dualbend.task.bending.config import (
    GripError,
    MisalignmentConfig,
    errors_over_time,
    imposed_errors,
)
from dualbend.task.bending.run import SPACE_COLUMNS, BendingRun
from support.strip import STRIP6

SHORT = ("path.end_rad=0.2", "motion.hold_s=0.1")
ERROR = MisalignmentConfig(right=GripError(lateral_m=1e-3, roll_rad=0.02, yaw_rad=-0.01))


def test_errors_rise_from_nothing_while_the_arms_settle_and_then_stay() -> None:
    scenario = load_scenario(STRIP6, SHORT)
    motion = nominal_motion(
        scenario.path, scenario.motion, scenario.sheet.length_m, scenario.period_s
    )
    errors = errors_over_time(np.zeros((2, 6)), ERROR.errors(), motion)
    # Analytic.
    assert not errors[0].any()
    assert (errors[motion.phase > 0] == ERROR.errors()).all()
    assert (np.diff(np.abs(errors), axis=0) >= 0).all()


def test_of_what_the_jaws_took_only_their_plane_stays() -> None:
    scenario = load_scenario(STRIP6, SHORT)
    motion = nominal_motion(
        scenario.path, scenario.motion, scenario.sheet.length_m, scenario.period_s
    )
    taken = np.array([[1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.03]] * 2)
    errors = errors_over_time(taken, ERROR.errors(), motion)
    # Analytic.
    np.testing.assert_array_equal(errors[0], taken)
    stays = taken * [1, 1, 0, 0, 0, 1]
    np.testing.assert_allclose(errors[-1], stays + ERROR.errors(), atol=1e-15)


def test_grips_that_differ_do_so_from_sheet_to_sheet_and_not_within_one() -> None:
    spread = ["task.misalignment={along_spread_m=1e-4,pitch_spread_rad=1e-3}"]
    found = np.array(
        [imposed_errors(load_scenario(STRIP6, [*spread, f"repeat={i}"])) for i in range(200)]
    )
    again = imposed_errors(load_scenario(STRIP6, [*spread, "repeat=7"]))
    np.testing.assert_array_equal(found[7], again)
    # Statistical: relative error of a standard deviation of 400 draws 1/√800.
    assert found[:, :, [0, 4]].std(axis=(0, 1)) == pytest.approx([1e-4, 1e-3], rel=0.15)
    assert not found[:, :, [1, 2, 3, 5]].any()


def test_no_error_is_no_misalignment() -> None:
    assert imposed_errors(load_scenario(STRIP6, SHORT)) is None
    assert (
        imposed_errors(load_scenario(STRIP6, [*SHORT, "task.misalignment.left.yaw_rad=0"])) is None
    )


def test_a_sheet_gripped_too_high_and_pitched_is_bent_by_its_grip() -> None:
    settings = ("height_m=2e-4", "pitch_rad=0.01", "along_m=1e-4")
    scenario = load_scenario(STRIP6, [*SHORT, *(f"task.misalignment.right.{s}" for s in settings)])
    run = BendingRun(scenario)
    run.begin()
    for _ in range(int(np.count_nonzero(run.motion.phase == 0))):
        run.step()
    run.cell.simulation.observe()
    x, _, z, _, pitch, _ = run.cell.simulation.observer.grasps(run.cell.simulation.data)[1]
    # The pads give: some N over 0.96e6 N/m, some mN m over 267 N m/rad.
    assert z == pytest.approx(2e-4, rel=0.02)
    assert pitch == pytest.approx(0.01, rel=0.01)
    assert 0.0 < x < 1e-4


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
