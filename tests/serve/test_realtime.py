"""Real time: what is late is counted and does not stop the arm, and the clock is the machine's."""

import time

import numpy as np
import pytest

from dualbend import load_scenario, make_run
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServedArmConfig
from dualbend.serve.robot.protobuf import doubles, message
from support.served import Answer, controllers, free_ports, served

SHORT = (
    *("motion.speed_rad_per_s=1.0", "path.end_rad=0.2", "motion.settle_s=0.2"),
    *("motion.hold_s=0.1", "guard.after_stop_s=0.1"),
)


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(load_scenario("fig8", SHORT))


def answer(cycle: int, turn_deg: float = 0.0) -> bytes:
    return f'<Sen><RKorr B="{turn_deg}"/><IPOC>{28 * (cycle + 1)}</IPOC></Sen>'.encode()


def cycle_of(told: bytes) -> int:
    return int(told.partition(b"<IPOC>")[2].partition(b"<")[0]) // 28 - 1


def still(told: bytes) -> list[bytes]:
    return [answer(cycle_of(told))]


def go(run: Run, first: Answer, second: Answer = still, **keys: object) -> RunRecord:
    with served(run, realtime=True, **keys) as (cell, go_on), controllers(cell, first, second):
        return go_on()


def missed(record: RunRecord, robot: int) -> int:
    row = record.ports[robot]
    return int(row["missed"] or 0) + int(row["missed_cell_late"] or 0)


def test_every_cycle_is_answered_or_missed_and_all_take_as_long_as_they_do(run: Run) -> None:
    began = time.monotonic()
    record = go(run, still)
    rows, period_s = record.trace.rows, run.scenario.period_s
    assert record.outcome == "completed"
    assert time.monotonic() - began >= (rows - 1) * period_s
    histogram = record.summary.tables["lateness"]
    for i, name in enumerate(("left robot", "right robot")):
        assert record.ports[i]["answered"] == rows - missed(record, i)
        # The first cycle is waited for: it starts the clock.
        in_time = sum(int(row[name] or 0) for row in histogram[:-1])
        assert in_time == rows - 1 - missed(record, i)
        assert histogram[-1][name] == missed(record, i)
    assert sum(int(row["cell"] or 0) for row in histogram[:-1]) == rows - 1


def test_what_is_not_answered_is_missed_and_the_last_deviation_stands(run: Run) -> None:
    def skips(told: bytes) -> list[bytes]:
        cycle = cycle_of(told)
        return [answer(cycle, 0.01 * cycle)] if cycle % 3 < 2 else []

    record = go(run, skips)
    assert record.outcome == "completed"
    assert missed(record, 0) >= record.trace.rows // 3
    turns = np.degrees(record["left_deviation_alpha"])
    assert np.all(turns[2::3] == turns[1::3][: len(turns[2::3])])
    assert turns[-1] > 0.1


def test_an_answer_of_an_earlier_cycle_is_late_and_does_not_act(run: Run) -> None:
    def late(told: bytes) -> list[bytes]:
        cycle = cycle_of(told)
        if cycle % 2:
            return []
        return [answer(cycle - 1, 1.0), answer(cycle)] if cycle else [answer(cycle)]

    record = go(run, late)
    assert record.outcome == "completed"
    assert np.all(record["left_deviation_alpha"] == 0.0)
    assert int(record.ports[0]["late"] or 0) >= (record.trace.rows - 1) // 2


def test_a_pose_that_comes_too_late_is_gone_to_all_the_same(run: Run) -> None:
    """An answer of EGM has no cycle: each is too late for its own and is taken for a later one."""

    def late(told: bytes) -> list[bytes]:
        time.sleep(1.3 * run.scenario.period_s)
        there = message(1, doubles(-399.9, 0.0, 672.0)) + message(2, doubles(1.0, 0.0, 0.0, 0.0))
        return [message(2, message(2, there))]

    arms = [
        ServedArmConfig(robot=robot, robot_port=port, sensor="none")  # type: ignore[arg-type]
        for robot, port in zip(("egm", "rsi"), free_ports(2), strict=True)
    ]
    wide = {"limit_m": 0.5, "limit_rad": 0.5}
    record = go(run, late, left=arms[0], right=arms[1], path="outside", **wide)
    assert record.outcome == "completed", record.reason
    assert missed(record, 0) >= 2
    np.testing.assert_allclose(record["left_command_x"][6:], -0.3999, atol=1e-12)


def test_a_controller_that_dies_stops_the_arm_after_the_limit(run: Run) -> None:
    record = go(run, lambda told: still(told) if cycle_of(told) < 5 else [], late_limit=4)
    assert record.outcome == "protective_stop"
    assert "missed 4 cycles in a row (serve.late_limit)" in record.reason
