"""What a controller does wrong ends in a count or in a reason, never in a hang or a traceback."""

import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dualbend import InputError, load_scenario, make_run
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.serve.cell import ServedCell
from support.served import Answer, controllers, free_ports, served

SHORT = (
    *("motion.speed_rad_per_s=1.0", "path.end_rad=0.2", "motion.settle_s=0.2"),
    *("motion.hold_s=0.1", "guard.after_stop_s=0.1"),
)


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(load_scenario("fig8", SHORT))


def ipoc_of(telegram: bytes) -> int:
    return int(telegram.partition(b"<IPOC>")[2].partition(b"<")[0])


def correction(ipoc: int, korr: str = "") -> bytes:
    return f"<Sen><RKorr {korr}/><IPOC>{ipoc}</IPOC></Sen>".encode()


def still(telegram: bytes) -> list[bytes]:
    return [correction(ipoc_of(telegram))]


def nothing(telegram: bytes) -> list[bytes]:
    return []


def go_on(run: Run, left: Answer, right: Answer = still, **keys: object) -> RunRecord:
    with served(run, **keys) as (cell, go), controllers(cell, left, right):
        return go()


@pytest.fixture(scope="module")
def undisturbed(run: Run) -> RunRecord:
    record = go_on(run, still)
    assert record.outcome == "completed"
    return record


def same(one: RunRecord, other: RunRecord) -> None:
    for name, _ in one.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.mark.parametrize(
    ("packet", "count"),
    [
        (b"no telegram", "malformed"),
        (b"<Sen>" + 9000 * b" " + b"</Sen>", "oversized"),
        (correction(999_999_999, 'B="1"'), "wrong_ipoc"),
    ],
)
def test_a_wrong_packet_before_the_right_one_is_counted_and_changes_nothing(
    run: Run, undisturbed: RunRecord, packet: bytes, count: str
) -> None:
    record = go_on(run, lambda told: [packet, *still(told)])
    same(record, undisturbed)
    assert record.ports[0][count] == record.trace.rows
    assert record.ports[1][count] == 0


def test_an_answer_that_comes_twice_acts_once(run: Run) -> None:
    """Relative corrections, of which a second one would add up."""

    def twice(told: bytes) -> list[bytes]:
        return 2 * [correction(ipoc_of(told), 'B="0.001"')]

    record = go_on(run, twice, correction="relative")
    wanted = np.radians(0.001) * np.arange(1, record.trace.rows + 1)
    np.testing.assert_allclose(record["left_deviation_alpha"], wanted, rtol=1e-12)
    counts = record.ports[0]
    late = [counts[name] for name in ("doubled", "late")]  # the last may come after the end
    assert record.trace.rows - 1 <= sum(n for n in late if isinstance(n, int)) <= record.trace.rows


def test_the_robot_counts_wrong_answers_in_a_row_and_stops(run: Run) -> None:
    delays: list[int] = []

    def wrong(told: bytes) -> list[bytes]:
        found = re.search(rb'<Delay D="(\d+)"/>', told)
        assert found is not None
        delays.append(int(found[1]))
        if len(delays) == 1:
            return [b"?", b"?", *still(told)]  # a right one sets the count back
        return [correction(ipoc_of(told) + 1)] * 8

    record = go_on(run, wrong, late_limit=5)
    assert record.outcome == "protective_stop"
    assert "left arm's controller gave 5 wrong answers in a row (serve.late_limit)" in record.reason
    assert delays == [0, 2]


@pytest.mark.parametrize(
    ("korr", "said"),
    [
        ('B="20"', "a deviation of 0.3491 rad, beyond serve.limit_rad = 0.2"),
        ('X="1e9"', "a deviation of 1e+06 m, beyond serve.limit_m = 0.05"),
        ('Z="-20"', "a step of 0.02 m, beyond serve.step_m = 0.005"),
        ('B="5"', "a step of 0.08727 rad, beyond serve.step_rad = 0.05"),
    ],
)
def test_a_correction_out_of_bounds_is_refused_by_name(run: Run, korr: str, said: str) -> None:
    record = go_on(run, lambda told: [correction(ipoc_of(told), korr)])
    assert record.outcome == "protective_stop"
    assert f"the left arm's controller asks for {said}" in record.reason


@pytest.mark.parametrize(("answered", "left"), [(0, "wait_s"), (7, "timeout_s")])
def test_a_controller_that_dies_ends_the_run_with_the_reason(
    run: Run, answered: int, left: str
) -> None:
    cycles = []

    def dies(told: bytes) -> list[bytes]:
        cycles.append(told)
        return still(told) if len(cycles) <= answered else []

    began = time.monotonic()
    record = go_on(run, dies, **{"wait_s": 20.0, "timeout_s": 20.0, left: 0.3})
    assert time.monotonic() - began < 15.0
    assert record.outcome == "aborted"
    assert "no answer from the controller of the left arm" in record.reason
    assert f"in cycle {answered} for 0.3 s" in record.reason
    assert record.trace.rows == answered + 1


def test_nobody_at_all_ends_the_run(run: Run) -> None:
    with served(run, wait_s=0.3) as (_, go):
        record = go()
    assert "controller of the left and right arm in cycle 0 for 0.3 s" in record.reason


def test_a_controller_that_is_slow_at_first_is_waited_for(run: Run, undisturbed: RunRecord) -> None:
    with served(run) as (cell, go), controllers(cell, *(late_by(0.3), still)):
        same(go(), undisturbed)


def late_by(seconds: float) -> Callable[[bytes], list[bytes]]:
    waited: list[float] = []

    def answer(told: bytes) -> list[bytes]:
        if not waited:
            waited.append(seconds)
            time.sleep(seconds)
        return still(told)

    return answer


def test_an_answer_from_another_socket_is_not_heard(run: Run, undisturbed: RunRecord) -> None:
    """The robot listens to its controller alone."""
    with served(run) as (cell, go):
        stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

        def answer(told: bytes) -> list[bytes]:
            port = cell.robots[0]._socket.getsockname()  # type: ignore[attr-defined]
            stranger.sendto(correction(ipoc_of(told), 'B="1"'), port)
            return still(told)

        with controllers(cell, answer, still):
            record = go()
        stranger.close()
    same(record, undisturbed)


def test_where_one_arm_stops_the_other_is_still_asked() -> None:
    run = make_run(load_scenario("fig8", [*SHORT, "guard.other_arm=continue"]))
    asked: list[int] = []

    def listened(told: bytes) -> list[bytes]:
        asked.append(ipoc_of(told))
        return still(told)

    of_the_stopped: list[int] = []

    def stops(told: bytes) -> list[bytes]:
        of_the_stopped.append(ipoc_of(told))
        return [correction(ipoc_of(told), 'B="20"' if len(asked) > 5 else "")]

    record = go_on(run, stops, listened)
    assert record.outcome == "protective_stop"
    stopped = int(np.count_nonzero(record.stopped))
    assert stopped > 1
    assert len(asked) == record.trace.rows
    assert len(of_the_stopped) == record.trace.rows - stopped


def test_a_controller_that_waits_for_a_record_that_it_has_had_gets_it_again(run: Run) -> None:
    with served(run, timeout_s=5.0) as (cell, go):
        sensor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sensor.settimeout(4.0)
        port = cell.sensors[0].port  # type: ignore[attr-defined]
        numbers: list[int] = []

        def waits(told: bytes) -> list[bytes]:
            if not numbers:
                sensor.sendto(bytes.fromhex("1234 0002 00000000"), ("127.0.0.1", port))
                while len(numbers) < 2:
                    numbers.append(int.from_bytes(sensor.recv(100)[4:8]))
            return still(told)

        with controllers(cell, waits, still):
            record = go()
        sensor.close()
    assert record.outcome == "completed", record.reason
    assert numbers == [1, 1]


def test_another_address_than_a_loopback_one_is_said(run: Run) -> None:
    with served(run) as (cell, _):
        assert not any("network" in line for line in cell.told())
        tools = [line for line in cell.told() if "tool: 0.6" in line]
        assert len(tools) == 2
        cell._address = "192.168.7.1"
        assert "open to the network: 192.168.7.1 is no loopback address" in cell.told()
    with pytest.raises(InputError, match="--address is empty"):
        ServedCell(run, "")


def test_mutated_answers_over_the_port_end_in_a_count(run: Run) -> None:
    rng = np.random.default_rng(11)

    def noisy(told: bytes) -> list[bytes]:
        packets = []
        for _ in range(60):
            data = bytearray(correction(ipoc_of(told), 'B="0.01"'))
            data[int(rng.integers(len(data)))] = int(rng.integers(256))
            packets.append(bytes(data[: int(rng.integers(len(data) // 2, len(data) + 1))]))
        return [*packets, *still(told)]

    record = go_on(run, noisy, noisy, late_limit=1_000_000)
    assert record.outcome == "completed"
    for row in record.ports[:2]:
        counts = [row[name] for name in ("malformed", "wrong_ipoc", "doubled")]
        assert sum(n for n in counts if isinstance(n, int)) > 50 * record.trace.rows


def test_what_cannot_be_served_is_refused() -> None:
    none = ["serve.left.robot=none", "serve.right.robot=none"]
    with pytest.raises(InputError, match="nothing is steered"):
        ServedCell(make_run(load_scenario("fig8", [*SHORT, *none])))


def test_the_command_ends_with_3_and_the_reason_or_with_2_and_the_key(tmp_path: Path) -> None:
    ports = free_ports(2)
    settings = [
        *SHORT,
        *(f"serve.{s}.robot_port={p}" for s, p in zip(("left", "right"), ports, strict=True)),
        *(f"serve.{s}.{p}=0" for s in ("left", "right") for p in ("sensor_port", "http_port")),
        "serve.wait_s=0.2",
    ]
    command = [sys.executable, "-m", "dualbend", "serve", "fig8", "--no-record", "--out", "run"]
    for setting in settings:
        command += ["--set", setting]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 3, done.stderr
    assert "aborted (no answer from the controller of the left and right arm" in done.stdout
    assert "1000000 counts per N" in done.stdout
    command[-1] = f"serve.left.sensor_port={ports[0]}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", ports[0]))
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 + done.stderr.count("warning:")
    assert "serve.left.sensor_port" in done.stderr
