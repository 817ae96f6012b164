"""The command link against what late, lost and doubled commands must do by hand calculation."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.guard import ProtectiveStop
from dualbend.imperfection.link import CommandLink, LinkConfig
from dualbend.run.disk.saved import load_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from dualbend.types import Vector
from support.left_runs import leave
from support.strip import STRIP6

NEVER = 1_000_000
SHORT = (
    "motion.speed_rad_per_s=1.0",
    "path.end_rad=0.2",
    "motion.settle_s=0.1",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
)


def link(seed: int = 1, **keys: Any) -> CommandLink:
    """Return the link of two arms with one joint each, at rest at −1."""
    config = LinkConfig(**{"stop_cycles": NEVER, **keys})
    start = np.full(2, -1.0)
    return CommandLink(config, seed, ("left", "right"), (1, 1), start, period_s=COMMAND_PERIOD_S)


def sent(through: CommandLink, count: int) -> tuple[Vector, Vector]:
    """Send the ramp 0, 1, 2, ... to both arms; return what is executed and its age (count, 2)."""
    pairs = [(through.deliver(np.full(2, float(n))), through.age) for n in range(count)]
    executed, ages = zip(*pairs, strict=True)
    return np.array(executed), np.array(ages)


@cache
def simulated(*settings: str) -> RunRecord:
    keys = [f"imperfections.link.{setting}" for setting in settings]
    return BendingRun(load_scenario(STRIP6, [*SHORT, *keys])).run()


def test_a_perfect_link_delivers_each_command_in_its_cycle() -> None:
    executed, ages = sent(link(), 50)
    assert np.array_equal(executed[:, 0], np.arange(50.0)) and not ages.any()


# --- late ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("jitter_s", "slack_s"), [(0.005, 0.005), (0.02, 0.0), (0.02, 0.01)])
def test_jitter_makes_the_normal_tails_part_of_the_commands_late(
    jitter_s: float, slack_s: float
) -> None:
    """Statistical: 4000 cycles × 2 arms, four standard errors.

    No command for cycle n has arrived by then where its own is late and the one before not late by
    exactly a cycle: with q_k the part that is late by k cycles or more, the own is executed in
    1 − q₁ of the cycles.
    """
    _, ages = sent(link(jitter_s=jitter_s, slack_s=slack_s), 4000)
    tail = float(norm.sf(slack_s / jitter_s))
    assert np.mean(ages == 0) == pytest.approx(1.0 - tail, abs=4.0 * np.sqrt(tail / 8000))
    # One cycle old: the own is late, the one before was late by no more than a cycle.
    next_tail = float(norm.sf((slack_s + COMMAND_PERIOD_S) / jitter_s))
    one_old = tail * (1.0 - next_tail)
    assert np.mean(ages == 1) == pytest.approx(one_old, abs=4.0 * np.sqrt(one_old / 8000))


def test_a_late_command_is_executed_a_cycle_later_unless_a_newer_one_came() -> None:
    """Exact: all late is a delay of a cycle; some late: the newest that has arrived."""
    executed, ages = sent(link(late_probability=1.0), 20)
    assert executed[:, 0].tolist() == [-1.0, *range(19)] and set(ages.ravel()) == {1}
    executed, ages = sent(link(late_probability=0.5), 2000)
    assert set(ages.ravel()) == {0, 1}
    assert np.array_equal(executed[1:], (np.arange(2000)[:, np.newaxis] - ages)[1:])
    assert np.mean(ages) == pytest.approx(0.5, abs=0.04)  # statistical: five standard errors


# --- lost ---------------------------------------------------------------------------------------


def bursts(ages: Vector) -> Vector:
    """Return the lengths of the gaps without a command."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ages > 0, [0]]).astype(int)))
    return edges[1::2] - edges[::2]


@pytest.mark.parametrize(("p", "mean"), [(0.05, 1.0), (0.02, 4.0)])
def test_commands_are_lost_in_bursts_of_a_mean_length(p: float, mean: float) -> None:
    """Statistical: share p L/(p L + 1 − p) and mean gap L/(1 − p), of 15000 cycles × 2 arms.

    A burst that begins where another one ends makes one gap: with q = 1 − p the mean is L/q.
    """
    _, ages = sent(link(lost_probability=p, burst_cycles=mean), 15000)
    share = p * mean / (p * mean + 1.0 - p)
    assert np.mean(ages > 0) == pytest.approx(share, rel=0.12)
    gaps = np.concatenate([bursts(arm) for arm in ages.T])
    assert np.mean(gaps) == pytest.approx(mean / (1.0 - p), rel=0.12)
    # The arms lose theirs by themselves.
    both = np.mean((ages > 0).all(axis=1))
    assert both < 3.0 * share**2


def test_held_is_behind_by_the_distance_of_the_lost_cycles() -> None:
    """Exact: error = speed × period × cycles without a command, of a ramp of 1 a cycle."""
    executed, ages = sent(link(lost_probability=0.1, burst_cycles=3.0), 500)
    assert ages.max() >= 5
    assert np.array_equal(np.arange(500)[:, np.newaxis] - executed, ages)


def test_extrapolated_is_exact_at_constant_speed() -> None:
    """Exact: of a ramp no error, after two commands; of n² the error of the second difference."""
    through = link(lost_probability=0.1, burst_cycles=3.0, policy="extrapolate")
    executed, ages = sent(through, 500)
    assert not ages[:2].any()
    assert ages.max() >= 5 and np.array_equal(executed[:, 0], np.arange(500.0))
    through = link(lost_probability=0.1, policy="extrapolate")
    values = np.arange(60.0) ** 2
    executed = np.array([through.deliver(np.full(2, value)) for value in values])
    first = int(np.argmax(executed[:, 0] != values))
    assert first > 2 and executed[first, 0] == values[first] - 2.0


def test_a_kind_of_error_does_not_move_the_draws_of_another() -> None:
    """Exact: with more of the commands lost no cycle's is fresher, as it were with other draws."""
    late = {"jitter_s": 0.02, "late_probability": 0.2}
    _, ages = sent(link(**late), 1000)
    _, more = sent(link(lost_probability=0.1, **late), 1000)
    assert (more >= ages).all() and 100 < np.count_nonzero(more > ages) < 900


# --- doubled ------------------------------------------------------------------------------------


def test_a_doubled_command_takes_the_next_ones_cycle() -> None:
    """Exact: each is executed in its own cycle, or that of the one before is for a second time."""
    executed, ages = sent(link(doubled_probability=1.0), 6)
    assert executed[:, 0].tolist() == [0.0, 0.0, 2.0, 2.0, 4.0, 4.0]
    executed, ages = sent(link(doubled_probability=0.25), 4000)
    assert np.array_equal(np.arange(4000)[:, np.newaxis] - executed, ages)
    assert ages.max() == 1
    # Statistical: p/(1 + p) of the cycles, five standard errors.
    assert np.mean(ages) == pytest.approx(0.2, abs=0.025)


def test_a_command_whose_cycle_a_doubled_one_took_is_gone() -> None:
    """Exact: none is late, so each executed one is this cycle's or older by a cycle than before."""
    _, ages = sent(link(doubled_probability=0.5, lost_probability=0.3, burst_cycles=3.0), 2000)
    assert set(np.unique(ages[1:][ages[1:] > 0] - ages[:-1][ages[1:] > 0])) == {1}


# --- what stops ---------------------------------------------------------------------------------


def cycles_until_stop(policy: str, stop_cycles: int) -> int:
    through = link(lost_probability=1.0, policy=policy, stop_cycles=stop_cycles)
    for n in range(100):
        try:
            through.deliver(np.zeros(2))
        except ProtectiveStop as stop:
            plural = "" if n == 0 else "s"
            assert (
                str(stop) == f"the left arm's controller got no command for {n + 1} cycle{plural}"
            )
            return n + 1
    return 100


@pytest.mark.parametrize(
    ("policy", "stop_cycles", "expected"),
    [("hold", 5, 5), ("extrapolate", 3, 3), ("hold", 1, 1), ("stop", 5, 1)],
)
def test_an_arm_without_commands_stops(policy: str, stop_cycles: int, expected: int) -> None:
    assert cycles_until_stop(policy, stop_cycles) == expected


def test_only_cycles_in_a_row_stop() -> None:
    """Exact: all late or doubled are no gap but the first; single losses never make two."""
    for keys in ({"late_probability": 1.0}, {"doubled_probability": 1.0}):
        sent(link(stop_cycles=2, **keys), 500)
    with pytest.raises(ProtectiveStop, match="got no command for 2 cycles"):
        sent(link(stop_cycles=2, lost_probability=0.2), 500)


# --- in a run -----------------------------------------------------------------------------------


def test_a_perfect_link_has_no_columns_and_no_metric() -> None:
    run = simulated()
    assert "left_command_age" not in run.trace and "stale_commands" not in run.metrics


def test_a_run_counts_what_its_arms_executed_late() -> None:
    """Exact: the metric is the count of the columns; the same seed gives the same run."""
    keys = ("lost_probability=0.2", "late_probability=0.1", "stop_cycles=1000", "jitter_s=0.004")
    run = simulated(*keys, "doubled_probability=0.1")
    ages = np.array([run.trace[f"{side}_command_age"] for side in ("left", "right")])
    assert run.outcome == "completed" and ages.any(axis=1).all()
    assert run.metrics["stale_commands"].value == np.count_nonzero(ages, axis=1).tolist()
    perfect = simulated()
    assert not np.array_equal(run.trace["left_q_joint2"], perfect.trace["left_q_joint2"])
    simulated.cache_clear()
    again = simulated(*keys, "doubled_probability=0.1")
    for name, _ in run.trace.columns:
        assert name == "wall_s" or np.array_equal(
            run.trace[name], again.trace[name], equal_nan=True
        )


def test_a_run_with_its_ages_is_read_back(tmp_path: Path) -> None:
    lost = "imperfections.link.lost_probability=0.2"
    read = load_run(leave(tmp_path / "run", STRIP6, *SHORT, lost, until=15))
    assert read.trace["right_command_age"].any()
    assert ("left_command_age", "cycles") in read.trace.columns


def test_a_run_that_loses_all_is_stopped_for_that_reason() -> None:
    run = simulated("lost_probability=1")
    assert run.outcome == "protective_stop"
    assert run.reason == "the left arm's controller got no command for 5 cycles, at 0.112 s"
    assert run.stopped.tolist().index(True) == 5
