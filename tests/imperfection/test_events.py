"""What happens at a time: to an arm, to a gripper's power, to the friction of a grip."""

import math
from functools import cache

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.imperfection.events import ArmStop, EventsConfig, Oil, PowerFailure
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario

KEY = "imperfections.events"
SHORT = ("imperfections=none", "path.end_rad=0.4", "motion.hold_s=0.5", "sheet.model.hinges=10")
FRICTION = ("grasp.friction=0.5",)


@cache
def run(name: str, *settings: str) -> RunRecord:
    return make_run(load_scenario(name, settings)).run()


def test_an_event_is_due_at_its_time_and_after() -> None:
    event = ArmStop(at_s=0.28)
    assert [event.due(t) for t in (0.0, 0.279, 10 * 0.028, 1.0)] == [False, False, True, True]


def test_a_gripper_without_power_loses_its_force_to_what_the_spring_keeps() -> None:
    event = PowerFailure(at_s=1.0, remaining=0.2, time_constant_s=0.1)
    # Analytic: r + (1 − r) exp(−t/τ).
    assert event.share(0.5) == 1.0
    assert event.share(1.1) == pytest.approx(0.2 + 0.8 * math.exp(-1.0), rel=1e-12)
    assert event.share(9.0) == pytest.approx(0.2, rel=1e-12)


def test_oil_lowers_the_friction_for_its_time_on_its_side() -> None:
    events = EventsConfig(
        oil=Oil(at_s=1.0, for_s=0.5, friction_ratio=0.1, side="right"),
        power_failure=PowerFailure(at_s=2.0, remaining=0.5, time_constant_s=1e-3, side="right"),
    )
    shares = [events.friction_share(t).tolist() for t in (0.9, 1.0, 1.499, 1.5, 3.0)]
    assert shares == [[1.0, 1.0], [1.0, 0.1], [1.0, 0.1], [1.0, 1.0], [1.0, 0.5]]


def test_events_of_a_grip_need_its_friction() -> None:
    with pytest.raises(InputError, match=r"grasp\.friction = none"):
        load_scenario("fig6", [f"{KEY}.oil.at_s=1.0"])


def test_friction_that_is_never_met_changes_no_bit_of_a_run() -> None:
    firm = "grasp.normal_force_n=1000"
    free, limited = run("fig6", *SHORT), run("fig6", *SHORT, *FRICTION, firm)
    for name in ("left_true_force_x", "right_true_moment_y", "left_q_joint3", "sag"):
        np.testing.assert_array_equal(free[name], limited[name])
    assert limited.metrics["peak_left_slip"].value == 0.0
    assert "peak_left_slip" not in free.metrics


@pytest.mark.parametrize("name", ["fig6", "pwb"])
def test_a_gripper_without_power_drops_the_sheet_and_the_task_ends(name: str) -> None:
    at_s = {"fig6": 2.0, "pwb": 18.0}[name]
    failure = f"{KEY}.power_failure={{at_s={at_s},side='left'}}"
    settings = SHORT if name == "fig6" else ()
    result = run(name, *settings, *FRICTION, failure)
    assert result.outcome == "aborted"
    assert result.reason.startswith("the left gripper has dropped the sheet, at ")
    # Analytic: at a hundredth of its friction a grip lets go, 4.6 time constants after the failure.
    assert result.simulated_s == pytest.approx(at_s + 0.05 * math.log(100.0), abs=0.06)
    assert result.metrics["peak_right_slip"].value < 1e-3


def test_oil_lets_the_sheet_slide_while_it_is_there() -> None:
    oil = f"{KEY}.oil={{at_s=2.0,for_s=0.3,friction_ratio=0.01,side='right'}}"
    result = run("fig6", *SHORT, *FRICTION, oil)
    slip, time = result["right_slip"], result["time"]
    assert not slip[time < 2.0].any()
    assert slip[-1] > 1e-4
    # Dry again it holds: what it slides after that is nothing.
    dry = slip[time > 2.4]
    assert np.ptp(dry) < 0.05 * slip[-1]
    again = make_run(load_scenario("fig6", [*SHORT, *FRICTION, oil])).run()
    np.testing.assert_array_equal(again["right_slip"], slip)
