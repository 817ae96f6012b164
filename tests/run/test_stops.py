"""One arm stops: what the other one does, what the sheet then bears, and how the run ends."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.disk.saved import load_run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES

SHORT = (
    "imperfections=none",
    "motion.speed_rad_per_s=1.0",
    "path.end_rad=0.4",
    "motion.settle_s=0.1",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
)
STOP = ("imperfections.events.arm_stop.at_s=0.392",)
CYCLES = round(0.5 / COMMAND_PERIOD_S)
"""After a stop, by default."""


@cache
def run(*settings: str) -> RunRecord:
    return BendingRun(load_scenario("fig6", [*SHORT, *settings])).run()


def first_stopped(result: RunRecord) -> int:
    return int(np.argmax(result.stopped))


def test_both_arms_stop_and_the_run_goes_on_for_the_stated_time() -> None:
    result = run(*STOP)
    assert result.outcome == "protective_stop"
    assert result.reason == "the left arm stops, as events.arm_stop says, at 0.392 s"
    # Analytic: 14 cycles before, the one in which it stops, and those after it.
    assert result.trace.rows == 15 + CYCLES - 1
    assert result.stopped.tolist() == [False] * 15 + [True] * (CYCLES - 1)
    assert result.simulated_s == pytest.approx(COMMAND_PERIOD_S * result.trace.rows)
    time = COMMAND_PERIOD_S * np.arange(result.trace.rows)
    np.testing.assert_allclose(result["time"], time, atol=1e-12)
    late = result["left_q_joint2"][-4:], result["right_q_joint2"][-4:]
    # Both are at rest: less than a thousandth of what they moved in as long before the stop.
    for joint, q in zip(("left_q_joint2", "right_q_joint2"), late, strict=True):
        before = abs(result[joint][14] - result[joint][10])
        assert np.ptp(q) < 0.01 * before


def test_nothing_changes_before_the_stop() -> None:
    stopped, whole = run(*STOP), run()
    for column in ("left_q_joint3", "right_true_force_x", "bend_004"):
        np.testing.assert_array_equal(stopped[column][:15], whole[column][:15])


def test_the_joints_come_to_rest_where_their_speed_takes_them() -> None:
    """Without sheet and friction errors the joints are where their references are."""
    prepared = BendingRun(load_scenario("fig6", [*SHORT, *STOP, "guard.stop_time_s=0.2"]))
    prepared.begin()
    with pytest.raises(Exception, match="the left arm stops"):
        while prepared.step():
            pass
    cell = prepared.cell
    place, speed = cell.response.position, cell.response.speed
    cell.stop(SIDES)
    for _ in range(10):
        cell.send(cell.home)
        cell.simulation.observe()
    # Analytic: half the speed for the time of the stop.
    np.testing.assert_allclose(cell.reference, place + 0.1 * speed, atol=1e-12)
    np.testing.assert_allclose(cell.simulation.q, cell.reference, atol=2e-3)


def test_the_other_arm_continues_where_the_scenario_says_so() -> None:
    stop, go_on = run(*STOP), run(*STOP, "guard.other_arm=continue")
    assert go_on.outcome == "protective_stop"
    whole = run()
    last = min(whole.trace.rows, go_on.trace.rows) - 1

    def moved(result: RunRecord, side: str) -> float:
        return float(result[f"{side}_grip_x"][last] - result[f"{side}_grip_x"][14])

    # The right arm does as if nothing had happened, the left one stands.
    assert moved(go_on, "right") == pytest.approx(moved(whole, "right"), rel=0.05)
    assert abs(moved(go_on, "left")) < 0.3 * abs(moved(whole, "left"))
    assert moved(go_on, "left") == pytest.approx(moved(stop, "left"), rel=0.05)
    # The sheet is bent further than where both arms stop.
    key = "after_stop_peak_strain"
    assert go_on.metrics[key].value > 1.05 * stop.metrics[key].value


def test_what_the_sheet_bears_afterwards_is_a_metric() -> None:
    result = run(*STOP)
    rows = slice(first_stopped(result), None)
    force = max(
        math.sqrt(sum(result[f"{side}_true_force_{axis}"][row] ** 2 for axis in "xyz"))
        for side in SIDES
        for row in range(*rows.indices(result.trace.rows))
    )
    # Analytic, from the columns.
    assert result.metrics["after_stop_peak_force"].value == pytest.approx(force, rel=1e-12)
    sheet = result.scenario.sheet.sheet()
    bent = np.abs(result.trace.bends[rows]).max() * 10 / sheet.length_m * sheet.thickness_m / 2
    assert result.metrics["after_stop_peak_strain"].value == pytest.approx(bent, rel=1e-12)
    assert "after_stop_peak_force" not in run().metrics


def test_without_time_after_the_stop_the_run_ends_in_its_cycle() -> None:
    result = run(*STOP, "guard.after_stop_s=0")
    assert (result.trace.rows, result.stopped.any()) == (15, False)
    assert result.reason == run(*STOP).reason


@pytest.mark.parametrize("other", ["stop", "continue"])
def test_a_guard_names_the_arm_and_its_stop_is_the_same(other: str) -> None:
    result = run("guard.following_error_rad=1e-5", f"guard.other_arm={other}")
    assert result.outcome == "protective_stop"
    assert result.reason.startswith("following error of ")
    assert result.stopped.any()
    assert result.reason.count("following error") == (1 if other == "stop" else 2)


def test_a_folder_of_a_stopped_run_is_read_back(tmp_path: Path) -> None:
    result = run(*STOP)
    with run_folder(tmp_path / "run") as kept:
        write_numbers(result, kept)
    again = load_run(tmp_path / "run")
    assert again.trace.equals(result.trace)
    assert again.phases[int(again["phase"][-1])] == "stopped"


@pytest.mark.parametrize("at_s", [0.0, 0.28])
def test_an_assembly_stops_alike(tmp_path: Path, at_s: float) -> None:
    settings = [f"imperfections.events.arm_stop={{at_s={at_s},side='right'}}"]
    result = make_run(load_scenario("pwb", settings)).run()
    assert result.outcome == "protective_stop"
    assert result.reason == f"the right arm stops, as events.arm_stop says, at {at_s:.3f} s"
    assert result.trace.rows == round(at_s / COMMAND_PERIOD_S) + CYCLES
    assert "after_stop_peak_force" in result.metrics
    with run_folder(tmp_path / "run") as kept:
        write_numbers(result, kept)
    assert load_run(tmp_path / "run").trace.equals(result.trace)
