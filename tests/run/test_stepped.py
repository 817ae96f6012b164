"""A run stepped from outside: the run's trace bit for bit, actions as a controller's answers."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from dualbend import Cell, InputError, load_run, load_scenario, make_run, open_cell, write_results
from dualbend.control.controller import Observation
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.scenario import Scenario
from dualbend.types import Vector

SHORT = ("motion.speed_rad_per_s=1.0", "path.end_rad=0.3", "motion.hold_s=0.1")
STOPS = (
    "compliance=none",
    "imperfections.events.arm_stop.at_s=0.392",
    "guard.other_arm=continue",
    "guard.after_stop_s=0.2",
)


def stepped(cell: Cell, seed: int | None = None) -> RunRecord:
    cell.reset(seed)
    while not cell.done:
        cell.step()
    return cell.record()


def assert_same(one: RunRecord, other: RunRecord) -> None:
    """Compare bit for bit all but the clock on the wall."""
    assert (one.outcome, one.reason) == (other.outcome, other.reason)
    assert one.trace.columns == other.trace.columns
    for name, _ in one.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    np.testing.assert_array_equal(one.trace.qpos, other.trace.qpos)


@pytest.mark.parametrize(
    ("name", "settings"),
    [("fig8", SHORT), ("exact", SHORT), ("fig6", (*SHORT, *STOPS)), ("learned", ())],
    ids=["fig8", "exact", "one-arm-stops", "learned"],
)
def test_stepped_to_its_end_it_is_the_run(name: str, settings: tuple[str, ...]) -> None:
    whole = make_run(load_scenario(name, settings)).run()
    own = stepped(open_cell(name, settings))
    assert_same(own, whole)
    assert own.controller == whole.controller == ""
    if "arm_stop" in str(settings):
        assert whole.outcome == "protective_stop"
        assert np.count_nonzero(whole.stopped) > 3


@pytest.mark.slow
def test_a_stepped_assembly_is_the_run() -> None:
    assert_same(stepped(open_cell("pwb")), make_run(load_scenario("pwb")).run())


def test_the_first_cycles_of_an_assembly_are_those_of_the_run() -> None:
    cell, run = open_cell("pwb"), make_run(load_scenario("pwb"))
    cell.reset()
    run.begin()
    for _ in range(40):
        cell.step()
        run.step()
    for name, _ in run.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(cell.trace[name][:40], run.trace[name], err_msg=name)


def swing(observation: Observation) -> Vector:
    """Return an action (2, 3) that follows time and moment."""
    turn = 0.02 * np.sin(observation.time_s) + 0.1 * observation.filtered.torque_nm[0, 1]
    return np.array([[1e-4, -2e-4, turn], [-1e-4, 0.0, 0.5 * turn]])


def swinging(_: Scenario) -> Callable[[Observation], Vector]:
    def answer(observation: Observation) -> Vector:
        deviation = np.zeros((2, 6))
        deviation[:, ::2] = swing(observation)
        return deviation

    return answer


def test_actions_are_a_controller_that_returns_the_same(tmp_path: Path) -> None:
    whole = make_run(load_scenario("fig8", SHORT), compliance=swinging).run()
    cell = open_cell("fig8", SHORT)
    observation = cell.reset()
    while not cell.done:
        observation = cell.step(swing(observation))
    own = cell.record()
    assert_same(own, whole)
    assert own.controller == "dualbend.Cell.step"
    assert write_results(own, tmp_path, record=False) == []
    assert load_run(tmp_path).summary.controller == own.controller


def test_after_an_action_the_own_controller_goes_on_as_it_would() -> None:
    """Its own answers as actions for some cycles change nothing after them."""
    whole = make_run(load_scenario("fig8", SHORT)).run()
    answers = np.zeros((10, 2, 3))
    for i, side in enumerate(("left", "right")):
        answers[:, i, 0] = whole[f"{side}_deviation_x"][:10]
        answers[:, i, 2] = whole[f"{side}_deviation_alpha"][:10]
    assert answers.any()
    cell = open_cell("fig8", SHORT)
    cell.reset()
    for answer in answers:
        cell.step(answer)
    while not cell.done:
        cell.step()
    assert_same(cell.record(), whole)


def test_what_is_observed_is_what_the_next_row_says() -> None:
    cell = open_cell("exact", (*SHORT, "imperfections=none"))
    first = cell.reset()
    assert first.time_s == 0.0
    for cycle in range(1, 20):
        seen = cell.step()
        assert seen is cell.observation
        assert cell.trace.rows == cycle + 1
        assert seen.time_s == cell.trace["time"][-1]
        np.testing.assert_array_equal(seen.measured.x_m[0], cell.trace["left_grip_x"][-1])


def test_a_seed_is_that_of_the_scenario() -> None:
    cell = open_cell("fig8", SHORT, seed=3)
    three = stepped(cell)
    four = stepped(cell, seed=4)
    assert four.scenario.seed == cell.scenario.seed == 4
    assert not three.trace.equals(four.trace)
    assert_same(stepped(cell, seed=3), three)
    assert_same(stepped(open_cell(load_scenario("fig8", SHORT), seed=3)), three)
    assert three.identity is not None
    assert four.identity is not None
    assert three.identity.id != four.identity.id


def test_a_callback_sees_every_cycle_whole() -> None:
    seen = list[float]()
    cell = open_cell(
        "fig6",
        (*SHORT, *STOPS),
        on_cycle=lambda cell: seen.append(float(cell.trace["left_setpoint_joint2"][-1])),
    )
    result = stepped(cell)
    assert np.array_equal(seen, result["left_setpoint_joint2"][-len(seen) :], equal_nan=True)
    assert len(seen) == result.trace.rows


def test_a_run_that_is_left_is_aborted(tmp_path: Path) -> None:
    with open_cell("fig8", SHORT) as cell:
        cell.reset()
        for _ in range(10):
            cell.step()
        left = cell.record()
        assert cell.record() is left
    assert left.outcome == "aborted"
    assert left.reason == "ended by the script, at 0.280 s"
    assert left.trace.rows == 11
    assert write_results(left, tmp_path, record=False) == []
    assert load_run(tmp_path).outcome == "aborted"
    with open_cell("fig8", SHORT) as other:
        other.reset()
    assert other.done


def test_an_action_out_of_reach_ends_the_run_as_a_controllers_does() -> None:
    cell = open_cell("fig8", SHORT)
    cell.reset()
    while not cell.done:
        cell.step([[5.0, 0.0, 0.0]] * 2)
    assert cell.record().outcome == "protective_stop"


def test_an_action_in_six_directions_is_that_in_the_plane_where_it_is() -> None:
    """Exact: the same commands; and one along y moves the grips there."""
    plain, six, aside = (open_cell("exact", SHORT) for _ in range(3))
    for cell in (plain, six, aside):
        cell.reset(seed=1)
    for n in range(20):
        plain.step([[1e-4 * n, 0.0, 1e-4 * n]] * 2)
        six.step([[1e-4 * n, 0.0, 0.0, 0.0, 1e-4 * n, 0.0]] * 2)
        aside.step([[0.0, 1e-4 * n, 0.0, 0.0, 0.0, 0.0], [0.0, -1e-4 * n, 0.0, 0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(plain.trace["left_grip_x"], six.trace["left_grip_x"])
    moved = aside.trace["left_grip_y"][-1] - plain.trace["left_grip_y"][-1]
    assert moved > 2e-4


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (0.1, r"action: of shape \(\); need \(2, 3\)"),
        (np.zeros((2, 4)), r"action: of shape \(2, 4\)"),
        (np.zeros((3, 6)), r"action: of shape \(3, 6\)"),
        ([[0, 0, np.nan], [0, 0, 0]], "action: not finite"),
        ([["a", 0, 0], [0, 0, 0]], "action: no array of numbers"),
        ([[0, 0], [0, 0, 0]], "action: no array of numbers"),
    ],
)
def test_a_wrong_action_is_refused_and_the_run_goes_on(action: object, said: str) -> None:
    cell = open_cell("exact", SHORT)
    cell.reset()
    with pytest.raises(InputError, match=said):
        cell.step(action)  # type: ignore[arg-type]
    assert not cell.done
    cell.step()


def test_what_cannot_be_is_said() -> None:
    cell = open_cell("exact", SHORT)
    for early in (cell.step, cell.record, lambda: cell.trace):
        with pytest.raises(InputError, match=r"no run yet: cell\.reset\(\) begins one"):
            early()
    cell.close()
    assert not cell.done
    stepped(cell)
    with pytest.raises(InputError, match=r"the run has ended \(completed\)"):
        cell.step()
    with pytest.raises(InputError, match="seed"):
        cell.reset(seed=-1)
    with pytest.raises(InputError, match="give them to load_scenario"):
        open_cell(load_scenario("exact"), SHORT)
    with pytest.raises(InputError, match="scenario 'nothing'"):
        open_cell("nothing")
    at_once = open_cell("exact", (*SHORT, "imperfections.events.arm_stop.at_s=0"))
    with pytest.raises(InputError, match="ends before its first cycle: the left arm stops"):
        at_once.reset()


def test_between_steps_warnings_are_those_of_who_asks() -> None:
    before = mujoco.get_mju_user_warning()
    one, other = open_cell("exact", SHORT), open_cell("exact", SHORT)
    one.reset()
    other.reset()
    one.step()
    assert mujoco.get_mju_user_warning() is before
    one.close()
    other.step()
    assert mujoco.get_mju_user_warning() is before


def test_an_interrupt_is_passed_on_and_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = open_cell("exact", SHORT)
    cell.reset()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cell.run.cell, "send", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cell.step()
    assert cell.record().reason.startswith("interrupted by the user")
