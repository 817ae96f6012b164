"""EGM's messages against bytes written by hand, and a run against the same one over RSI."""

import math
import socket
import struct

import numpy as np
import pytest

from dualbend import InputError, load_scenario, make_run
from dualbend.control.alter import turn
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServedArmConfig
from dualbend.serve.cell import ServedCell
from dualbend.serve.robot.egm import EgmRobot, decode, encode
from dualbend.serve.robot.pose import quaternion_of
from dualbend.serve.robot.protobuf import fields
from dualbend.types import SIDES
from support.served import Answer, arm_state, controllers, free_ports, served, served_arm, take

SHORT = (
    *("motion.speed_rad_per_s=1.0", "path.end_rad=0.2", "motion.settle_s=0.2"),
    *("motion.hold_s=0.1", "guard.after_stop_s=0.1"),
)
TURN_RAD = math.radians(0.25)


def le(*values: float) -> bytes:
    """Return doubles as fields 1, 2, ...: a tag of one byte, eight bytes little-endian."""
    return b"".join(
        bytes([i << 3 | 1]) + struct.pack("<d", value) for i, value in enumerate(values, 1)
    )


def sensor(place_mm: tuple[float, ...], orient: tuple[float, ...]) -> bytes:
    """Return an EgmSensor written by hand, number 5, a correction."""
    cartesian = b"\x0a\x1b" + le(*place_mm) + b"\x12\x24" + le(*orient)
    return b"\x0a\x04\x08\x05\x18\x03" + b"\x12\x45\x12\x43" + cartesian


def test_what_the_robot_sends_is_written_by_hand() -> None:
    state = arm_state(
        1,
        measured=np.array([-0.5, 0.0, 1.25, 0.0, 0.0, 0.0]),
        joints=np.array([10.0, -20.0]),
        setpoint=np.array([11.0]),
        wrench=np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    )
    upright = b"\x12\x24" + le(1.0, 0.0, 0.0, 0.0)
    clock = bytes.fromhex("22 06 08 00 10 e0 da 01")  # 0 s, 28000 us
    joints = b"\x0a\x12\x09" + struct.pack("<d", 10.0) + b"\x09" + struct.pack("<d", -20.0)
    measured = b"\x12\x43\x0a\x1b" + le(-500.0, 0.0, 1250.0) + upright
    nominal = b"\x12\x43\x0a\x1b" + le(0.0, 0.0, 0.0) + upright
    force = b"".join(b"\x11" + struct.pack("<d", value) for value in range(1, 7))
    feedback = joints + measured + clock
    planned = b"\x0a\x09\x09" + struct.pack("<d", 11.0) + nominal + clock
    assert encode(state, 0.028) == (
        bytes.fromhex("0a 06 08 01 10 1c 18 02")
        + (b"\x12" + bytes([len(feedback)]) + feedback)
        + (b"\x1a" + bytes([len(planned)]) + planned)
        + bytes.fromhex("22 02 08 01 2a 02 08 03 30 01 42 02 08 02")
        + (b"\x4a\x38\x08\x01" + force)
    )


def part(data: bytes, number: int) -> bytes:
    (value,) = (value for key, value in fields(data) if key == number)
    assert isinstance(value, bytes)
    return value


def test_an_answer_written_by_hand_is_read() -> None:
    half = math.radians(15.0)
    found = decode(sensor((-400.0, 1.0, 1250.0), (math.cos(half), 0.0, math.sin(half), 0.0)))
    assert found is not None
    np.testing.assert_allclose(found[0], [-0.4, 1e-3, 1.25], rtol=1e-15)
    np.testing.assert_allclose(found[1], turn(np.array([0.0, 2.0 * half, 0.0])), atol=1e-15)


GOOD = sensor((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        GOOD[:-1],
        GOOD[:6],  # no pose
        GOOD + GOOD[6:],  # two of them
        sensor((math.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        sensor((math.inf, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        sensor((0.0, 0.0, 0.0), (1.1, 0.0, 0.0, 0.0)),
        sensor((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        b"\x12\x00" + GOOD[:6],
        b"\x00" + GOOD,
        b"\xff" * 20,
    ],
)
def test_what_asks_for_no_pose_is_none(data: bytes) -> None:
    assert decode(data) is None


def test_mutated_answers_are_read_or_refused() -> None:
    rng, read = np.random.default_rng(5), 0
    for _ in range(4000):
        data = bytearray(GOOD)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(data)))
            if rng.integers(3):
                data[at] = int(rng.integers(256))
            else:
                del data[at : at + int(rng.integers(1, 5))]
        found = decode(bytes(data))
        if found is not None:
            read += 1
            assert np.isfinite(found[0]).all()
            np.testing.assert_allclose(found[1] @ found[1].T, np.eye(3), atol=1e-12)
    assert 100 < read < 3900


@pytest.mark.parametrize("seed", range(8))
def test_quaternions_are_those_of_scipy(seed: int) -> None:
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation.random(rng=seed)
    x, y, z, w = rotation.as_quat()
    wanted = np.array([w, x, y, z]) * (1.0 if w >= 0.0 else -1.0)
    np.testing.assert_allclose(quaternion_of(rotation.as_matrix()), wanted, atol=1e-14)


def by_egm(telegram: bytes) -> list[bytes]:
    """Answer with the nominal pose, turned."""
    pose = part(part(telegram, 3), 2)
    place = [value for _, value in fields(part(pose, 1))]
    u0, _, u2, _ = (value for _, value in fields(part(pose, 2)))
    assert isinstance(u0, float)
    assert isinstance(u2, float)
    half = math.atan2(u2, u0) + 0.5 * TURN_RAD
    return [sensor(tuple(place), (math.cos(half), 0.0, math.sin(half), 0.0))]  # type: ignore[arg-type]


def by_rsi(telegram: bytes) -> list[bytes]:
    ipoc = telegram.partition(b"<IPOC>")[2].partition(b"<")[0].decode()
    return [f'<Sen><RKorr B="{math.degrees(TURN_RAD)}"/><IPOC>{ipoc}</IPOC></Sen>'.encode()]


def driven(run: Run, protocol: str, answer: Answer) -> RunRecord:
    arms = [
        ServedArmConfig(robot=protocol, robot_port=port, sensor="none")  # type: ignore[arg-type]
        for port in free_ports(2)
    ]
    with (
        served(run, left=arms[0], right=arms[1]) as (cell, go),
        controllers(cell, answer, answer),
    ):
        return go()


def test_the_same_deviations_over_egm_and_rsi_are_the_same_run() -> None:
    run = make_run(load_scenario("fig8", SHORT))
    egm, rsi = driven(run, "egm", by_egm), driven(run, "rsi", by_rsi)
    assert egm.outcome == rsi.outcome == "completed"
    for side in SIDES:
        np.testing.assert_allclose(egm[f"{side}_deviation_alpha"], TURN_RAD, atol=1e-14)
        name = f"{side}_true_moment_y"
        np.testing.assert_allclose(egm[name], rsi[name], atol=1e-9)
    assert [row["protocol"] for row in egm.ports] == ["egm", "egm"]


@pytest.mark.parametrize("setting", ["serve.correction=relative", "robot.alter.mode=tool"])
def test_what_a_whole_pose_cannot_mean_is_refused(setting: str) -> None:
    run = make_run(load_scenario("fig8", [*SHORT, "serve.left.robot=egm", setting]))
    with pytest.raises(InputError, match=r'serve.left.robot = "egm" .*needs'):
        ServedCell(run)


def test_an_answer_after_its_cycle_is_late_and_acts_in_the_next_one_as_a_pose() -> None:
    """In real time: the pose that it asks for is another deviation from where the path is then."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
        controller.bind(("127.0.0.1", 0))
        controller.settimeout(5.0)
        robot = EgmRobot(served_arm(), "127.0.0.1", controller.getsockname()[1])
        robot.ask(arm_state(0))
        _, at = controller.recvfrom(1000)
        robot.missed = True
        controller.sendto(sensor((3.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), at)
        assert take(robot)
        assert robot.answer is None
        robot.ask(arm_state(1, origin=np.array([0.001, 0.0, 0.0, 0.0, 0.0, 0.0])))
        np.testing.assert_allclose(robot.late, [0.002, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-15)
        assert robot.counted()["late"] == 1
        robot.ask(arm_state(2))
        assert robot.late is None
        robot.close()


@pytest.mark.parametrize("packed", [True, False])
def test_joints_are_the_pose_that_they_have(packed: bool) -> None:
    angles = [math.degrees(value) for value in (0.001, 0.002, 0.003, 0.0, 0.0, 0.0)]
    numbers = [struct.pack("<d", angle) for angle in angles]
    joints = b"\x0a\x30" + b"".join(numbers) if packed else b"\x09" + b"\x09".join(numbers)
    planned = b"\x0a" + bytes([len(joints)]) + joints
    robot = EgmRobot(served_arm(), "127.0.0.1", 9)
    found = robot.decode(b"\x12" + bytes([len(planned)]) + planned)
    np.testing.assert_allclose(found, [0.001, 0.002, 0.003, 0.0, 0.0, 0.0], atol=1e-15)
    planned = b"\x0a\x09" + joints[2 if packed else 0 :][:8].rjust(9, b"\x09")
    assert robot.decode(b"\x12\x0b" + planned) == "malformed"  # one joint
    robot.close()


def test_what_came_before_the_question_is_no_answer() -> None:
    """An answer has no number of a cycle in it: an old one is taken off the socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
        controller.bind(("127.0.0.1", 0))
        controller.settimeout(5.0)
        robot = EgmRobot(served_arm(), "127.0.0.1", controller.getsockname()[1])
        for cycle, place_mm in enumerate((1.0, 2.0)):
            robot.ask(arm_state(cycle))
            _, at = controller.recvfrom(1000)
            for place in (place_mm, 99.0):
                controller.sendto(sensor((place, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), at)
            robot.receive()
            assert robot.answer is not None
            assert robot.answer[0] == 1e-3 * place_mm
        assert robot.counted()["late"] == 1
        robot.close()
