"""Another command period: the same mechanics, the loop at its own rate, sensors by their clock."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualbend.control.clock import default_step_s, steps_per_cycle
from dualbend.errors import InputError
from dualbend.run.disk.saved import load_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.stability.prediction import predict
from dualbend.task.bending.run import BendingRun
from support.left_runs import leave
from support.strip import STRIP6

SHORT = (
    "motion.speed_rad_per_s=0.5",
    "path.end_rad=0.2",
    "motion.settle_s=0.28",
    "motion.hold_s=0.3",
    "sheet.model.hinges=10",
)
STIFF = ("compliance=none", "sensor.force_noise_n=0", "sensor.torque_noise_nm=0")


def run(*settings: str) -> RunRecord:
    return BendingRun(load_scenario(STRIP6, [*SHORT, *settings])).run()


@given(st.floats(1e-3, 0.05))
def test_the_step_that_nobody_gives_divides_the_period_and_is_no_longer_than_the_pumas(
    period_s: float,
) -> None:
    step_s = default_step_s(period_s)
    count = steps_per_cycle(step_s, period_s)
    # Exact but for rounding: one step fewer would be longer than 1.75 ms.
    assert step_s <= 0.00175 * (1.0 + 1e-8)
    assert count == 1 or period_s / (count - 1) > 0.00175


def test_the_pumas_step_is_a_sixteenth_of_its_period() -> None:
    assert load_scenario("fig6").step_s == 0.028 / 16


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.014, 0.04])
def test_what_the_arms_do_on_their_path_does_not_depend_on_how_often_they_are_told(
    period_s: float,
) -> None:
    """A command is reached by a ramp, at its period's end: all is one period later than sent."""
    puma, other = run(*STIFF), run(*STIFF, f"robot.command_period_s={period_s}", "filter.kind=none")
    np.testing.assert_allclose(
        other["time"], period_s * np.arange(other.trace.rows), rtol=0.0, atol=1e-12
    )
    at = np.linspace(0.2, 0.9, 200)
    first, second = (
        np.interp(at + one.scenario.period_s, one["time"], one["left_true_moment_y"])
        for one in (puma, other)
    )
    # Discretisation-limited: a ramp cuts the corners of the motion, and rows are between peaks.
    assert np.abs(second - first).max() < 0.05 * np.abs(first).max()


def test_a_run_at_another_period_is_read_as_it_was_written(tmp_path: Path) -> None:
    settings = ("robot.command_period_s=0.008",)
    found = load_run(leave(tmp_path / "run", STRIP6, *SHORT, *settings))
    assert found.scenario.period_s == 0.008
    np.testing.assert_array_equal(found["time"], run(*settings)["time"])


def test_a_slow_sensor_says_the_same_until_it_says_something_new() -> None:
    """40 ms of one reading at a command every 8 ms: five cycles, and no sensor is lost."""
    trace = run("robot.command_period_s=0.008", "sensor.sampling_ms=40").trace
    told = np.column_stack([trace[f"left_sensor_force_{axis}"] for axis in "xyz"])
    changes = np.flatnonzero(np.any(np.diff(told, axis=0) != 0.0, axis=1))
    assert changes.size > 10
    # With noise of a count hardly a reading is equal to the one before on all three axes.
    assert np.all(np.diff(changes) % 5 == 0)


def test_a_sensor_that_keeps_step_with_the_commands_is_one_that_answers_them() -> None:
    """A sample at each command's start, one step old, by either clock: bit for bit."""
    own, asked = (
        run(*STIFF, "sensor.latency_ms=1.75", key) for key in ("sensor.sampling_ms=28", "repeat=0")
    )
    np.testing.assert_array_equal(own["left_sensor_moment_y"], asked["left_sensor_moment_y"])


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("robot.command_period_s=0.0005", "≥ 0.001"),
        ("robot.command_period_s=0.05", "filter.cutoff_hz = 10.0: must be below 10.000 Hz"),
        ("sensor.sampling_ms=0", "> 0"),
    ],
)
def test_a_period_that_cannot_be_is_refused(setting: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scenario(STRIP6, [setting])


LATE, PROMPT = "robot.right.delay_cycles=5", "robot.alter.delay_cycles=1"
SLOW = "robot.right.response={natural_frequency_hz=1.0,damping_ratio=1.0}"
BOTH = ('compliance.sensing=["left","right"]', 'compliance.complying=["left","right"]')


def test_each_arm_executes_its_deviation_after_a_delay_of_its_own() -> None:
    trace = run(*BOTH, "compliance.rotation={b=0.5,k=10000}", LATE, PROMPT)
    for side, delay in (("left", 1), ("right", 5)):
        executed = trace[f"{side}_command_alpha"] - trace["nominal_alpha"]
        sent = trace[f"{side}_deviation_alpha"]
        assert np.abs(sent).max() > 1e-4
        np.testing.assert_allclose(executed[delay:], sent[:-delay], atol=1e-15)


def test_each_arm_answers_as_it_does_beside_one_of_its_kind() -> None:
    """Without compliance the set-points of both arms are alike, whatever the other one does."""
    slow = "robot.response={natural_frequency_hz=1.0,damping_ratio=1.0}"
    mixed, quick, both_slow = (run(*STIFF, *more) for more in ([SLOW], [], [slow]))
    # What the servos are sent is exact; where the arms are, they are to what the sheet makes of it.
    reach = np.ptp(quick["left_grip_alpha"])
    for side, alone, other in (("left", quick, both_slow), ("right", both_slow, quick)):
        name = f"{side}_grip_alpha"
        off = np.abs(mixed[name] - alone[name]).max()
        assert off < 0.02 * reach
        assert np.abs(mixed[name] - other[name]).max() > 5.0 * off


def test_what_is_computed_of_one_arm_is_refused_where_the_other_answers_otherwise() -> None:
    for setting in (LATE, SLOW):
        with pytest.raises(InputError, match=r"robot\.left and robot\.right"):
            predict(load_scenario("fig8", [setting]))
