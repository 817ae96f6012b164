"""RTDE against bytes written by hand, and runs that its registers steer."""

import math
import selectors
import socket
import struct
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

import numpy as np
import pytest

from dualbend import InputError, load_scenario, make_run
from dualbend.control.alter import turn
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServedArmConfig
from dualbend.serve.cell import ServedCell
from dualbend.serve.robot.pose import axes_about, deviation_from, rotation_vector_of
from dualbend.serve.robot.ur.robot import UrRobot
from dualbend.serve.robot.ur.variables import UNKNOWN
from support.rtde import COMMAND, Rtde, Target, free_robot_port, play, steered
from support.served import arm_state, served, served_arm

SHORT = (
    *("motion.speed_rad_per_s=1.0", "path.end_rad=0.2", "motion.settle_s=0.2"),
    *("motion.hold_s=0.1", "guard.after_stop_s=0.1", "imperfections=none"),
)


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(load_scenario("fig8", SHORT))


@contextmanager
def listening(cycles: Iterable[int] = (), **known: object) -> Iterator[UrRobot]:
    """Give a robot that takes what comes, in a thread, and goes through cycles once it streams."""
    robot = UrRobot(served_arm(**known), "127.0.0.1", free_robot_port())
    ended, left = threading.Event(), list(cycles)

    def take() -> None:
        with selectors.DefaultSelector() as selector:
            robot.watch(selector)
            while not ended.is_set():
                for key, _ in selector.select(0.01):
                    key.data()
                while left and robot.counted()["sent"]:
                    robot.ask(arm_state(left.pop(0)))

    thread = threading.Thread(target=take)
    robot.ask(arm_state(0))
    thread.start()
    try:
        yield robot
    finally:
        ended.set()
        thread.join()
        robot.close()


def bytes_of(text: str) -> bytes:
    return bytes.fromhex(text)


def test_the_handshake_is_written_by_hand() -> None:
    with listening() as robot:
        raw = socket.create_connection(("127.0.0.1", robot.port), 5.0)
        for sent, wanted in (
            (bytes_of("0005 56 0001"), bytes_of("0004 56 00")),  # version 1 is not spoken
            (bytes_of("0005 56 0002"), bytes_of("0004 56 01")),
            (bytes_of("0003 76"), bytes_of("0013 76 00000005 0000000b 00000000 00000000")),
            (
                bytes_of("0022 4f 405f400000000000") + b"timestamp,actual_TCP_pose"[:23],
                bytes_of("0014 4f 00") + b"DOUBLE,NOT_FOUND",
            ),
            (
                bytes_of("0024 4f 405f400000000000") + b"timestamp,actual_TCP_pose",
                bytes_of("0013 4f 01") + b"DOUBLE,VECTOR6D",
            ),
            (bytes_of("0017 49") + b"input_int_register_0", bytes_of("0009 49 01") + b"INT32"),
            (bytes_of("0003 50"), bytes_of("0004 50 01")),
            (
                bytes_of("0003 53"),
                bytes_of("0004 53 01 003c 55 01") + struct.pack(">7d", 0.028, *[0.0] * 6),
            ),
        ):
            raw.sendall(sent)
            found = b""
            while len(found) < len(wanted):
                found += raw.recv(len(wanted) - len(found))
            assert found == wanted
        raw.close()


def test_what_the_cell_does_not_know_is_not_found_or_zero() -> None:
    names = ",".join(UNKNOWN)
    for unknown, numbers in (("refused", 0), ("zero", 1)):
        with listening(unknown=unknown) as robot:
            client = Rtde(robot.port).negotiated()
            found = client.outputs(f"timestamp,{names}")
            assert found[0] == numbers
            types = found[1:].decode().split(",")
            assert types[1:] == (
                list(UNKNOWN.values()) if numbers else ["NOT_FOUND"] * len(UNKNOWN)
            )
            assert client.asked(b"S") == bytes([numbers])
            if numbers:
                assert not any(client.receive()[1][9:])
            assert client.outputs("timestamp,no_such_variable")[1:] == b"DOUBLE,NOT_FOUND"


def test_a_sensor_that_is_not_there_is_not_found() -> None:
    with listening(sensed=False) as robot:
        assert Rtde(robot.port).negotiated().outputs("actual_TCP_force")[1:] == b"NOT_FOUND"


def test_an_input_has_one_writer() -> None:
    with listening() as robot:
        first, second = Rtde(robot.port).negotiated(), Rtde(robot.port).negotiated()
        assert first.asked(b"I", b"input_int_register_0") == b"\1INT32"
        assert second.asked(b"I", COMMAND.encode())[:7] == b"\0IN_USE"
        assert second.asked(b"I", b"speed_slider_mask,input_int_register_48") == (
            b"\0NOT_FOUND,NOT_FOUND"
        )
        first.socket.close()
        while second.asked(b"I", b"input_int_register_0")[0] == 0:
            pass


def test_a_frequency_below_the_cells_gets_every_nth_cycle() -> None:
    with listening(range(1, 7)) as robot:
        client = Rtde(robot.port).negotiated()
        client.outputs("timestamp", 12.0)  # of 35.7 Hz
        client.asked(b"S")
        assert [client.doubles()[0] for _ in range(3)] == pytest.approx([0.028, 0.112, 0.196])


def command(client: Rtde, robot: UrRobot, number: int, state: int) -> None:
    """Send a command and wait for what the program says of itself."""
    client.write(number, [0.0] * 6)
    while struct.unpack(">Iid", client.receive()[1][1:])[:2] != (1 + robot.program.running, state):
        pass


def test_ur_rtdes_script_starts_the_program_and_commands_have_their_states() -> None:
    with listening() as robot:
        client = Rtde(robot.port).negotiated()
        client.outputs("runtime_state,output_int_register_24,timestamp")
        client.asked(b"I", COMMAND.replace("r_", "r_2", 1).replace("r_20", "r_24").encode())
        client.asked(b"S")
        assert struct.unpack(">Bii", client.receive()[1][:9]) == (1, 1, 0)
        with socket.create_connection(("127.0.0.1", robot.port - 1), 5.0) as script:
            script.sendall(b"set_digital_out(0, True)\n")
        with socket.create_connection(("127.0.0.1", robot.port - 1), 5.0) as script:
            script.sendall(
                b"def rtde_control():\n global reg_offset_int = # int register offset\n24"
            )
            script.sendall(
                b"\n# HEADER_END\n# NODE_CONTROL_LOOP_BEGINS\n# NODE_CONTROL_LOOP_ENDS\nend\n"
            )
            assert struct.unpack(">Bii", client.receive()[1][:9]) == (1, 2, 1)
        command(client, robot, 16, 2)
        command(client, robot, 0, 1)
        client.write(255, [0.0] * 6)
        assert struct.unpack(">Bii", client.receive()[1][:9]) == (1, 1, 1)


def test_the_dashboard_answers_as_the_real_one() -> None:
    with listening() as robot, socket.create_connection(("127.0.0.1", robot.port - 5)) as one:
        lines = one.makefile("rwb")
        assert lines.readline().startswith(b"Connected: Universal Robots Dashboard Server")
        for asked, answered in (
            (b"PolyscopeVersion", b"URSoftware 5.11.0.0"),
            (b"programState", b"STOPPED rtde_control.urp"),
            (b"play", b"Starting program"),
            (b"running", b"Program running: true"),
            (b"shutdown", b"could not understand: 'shutdown'"),
            (b"stop", b"Stopped"),
        ):
            lines.write(asked + b"\n")
            lines.flush()
            assert lines.readline().startswith(answered)


@pytest.mark.parametrize(
    "data",
    [
        b"\0\0U",
        b"\0\2V",
        b"\0\3?",
        b"\0\4Vx",
        bytes_of("000c 4f 7ff8000000000000") + b"t",
        bytes_of("000c 4f 0000000000000001") + b"t",  # 5e-324 Hz
        bytes_of("0004 55 09"),
        b"\0\5I\xff\xff",
    ],
)
def test_what_is_no_package_ends_the_connection_and_is_counted(data: bytes) -> None:
    with listening() as robot:
        client = Rtde(robot.port).negotiated()
        client.socket.sendall(data)
        with suppress(ConnectionError):
            client.receive()
        Rtde(robot.port).negotiated()
        assert robot.counted()["malformed"] == 1


def test_a_number_that_is_none_ends_the_connection() -> None:
    with listening() as robot:
        client = Rtde(robot.port).negotiated()
        client.asked(b"I", COMMAND.encode())
        play(robot.port)
        client.write(24, [math.nan] * 6)
        with pytest.raises(ConnectionError):
            client.receive()
        assert robot.answer is None


def test_a_target_after_its_cycle_is_late_and_acts_in_the_next_one_as_a_pose() -> None:
    robot = UrRobot(served_arm(), "127.0.0.1", free_robot_port())
    robot.program.play()
    with selectors.DefaultSelector() as selector:
        robot.watch(selector)
        client = socket.create_connection(("127.0.0.1", robot.port))
        client.sendall(bytes_of("0005 56 0002") + struct.pack(">Hc", 3 + len(COMMAND), b"I"))
        client.sendall(COMMAND.encode())
        robot.ask(arm_state(0))
        robot.missed = True
        client.sendall(struct.pack(">HcBi6d", 56, b"U", 1, 24, 0.003, *[0.0] * 5))
        while not robot.counted()["late"]:
            for key, _ in selector.select(5.0):
                key.data()
        assert robot.answer is None
        robot.ask(arm_state(1, origin=np.array([0.001, 0.0, 0.0, 0.0, 0.0, 0.0])))
        np.testing.assert_allclose(robot.late, [0.002, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-15)
        for number in (24, 255):  # and where the program has ended since, nothing is late
            client.sendall(struct.pack(">HcBi6d", 56, b"U", 1, number, *[0.0] * 6))
        robot.missed = True
        while robot.program.running:
            for key, _ in selector.select(5.0):
                key.data()
        robot.ask(arm_state(2))
        assert robot.late is None
        client.close()
        robot.close()


def driven(run: Run, target: Target, names: str = "target_TCP_pose", **keys: object) -> RunRecord:
    arms = [
        ServedArmConfig(
            robot="rtde", robot_port=free_robot_port(), robot_address="127.0.0.1", sensor="none"
        )
        for _ in range(2)
    ]
    with (
        served(run, left=arms[0], right=arms[1], **keys) as (cell, go),
        steered(cell, target, names),
    ):
        return go()


def test_targets_act_and_variables_are_what_the_trace_has(run: Run) -> None:
    told: list[list[float]] = []
    names = (
        "target_TCP_pose,actual_TCP_pose,actual_TCP_force,ft_raw_wrench,actual_q,actual_qd,"
        "target_q,actual_TCP_speed,target_TCP_speed"
    )

    def target(numbers: list[float]) -> list[float]:
        told.append(numbers)
        pose = np.array(numbers[:6])
        axes = turn(np.array([0.0, math.radians(0.25), 0.0])) @ axes_about(pose[3:])
        return [pose[0] + 1e-5, *pose[1:3], *rotation_vector_of(axes)]

    record = driven(run, target, names)
    assert record.outcome == "completed", record.reason
    for side in ("left", "right"):
        np.testing.assert_allclose(
            record[f"{side}_deviation_alpha"], math.radians(0.25), atol=1e-14
        )
        np.testing.assert_allclose(record[f"{side}_deviation_x"], 1e-5, atol=1e-15)
    # Both arms' packages, in whatever order of their threads: each is found at its own cycle.
    rows, found = record.trace.rows, np.array(told)
    forces = [f"sensor_{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz"]
    for side in ("left", "right"):
        raw = np.stack([record[f"{side}_{name}"] for name in forces], axis=1)
        at = [int(np.flatnonzero(np.all(found[:, 18:24] == row, axis=1))[0]) for row in raw]
        assert len(set(at)) == rows
        np.testing.assert_allclose(found[at, 16], record[f"{side}_measured_moment_y"], atol=1e-15)
        np.testing.assert_allclose(found[at, 10], record[f"{side}_grip_alpha"], atol=1e-9)
        q, setpoint = (
            np.stack([record[f"{side}_{kind}_joint{i}"] for i in range(1, 7)], axis=1)
            for kind in ("q", "setpoint")
        )
        np.testing.assert_allclose(found[at, 24:30], q, atol=1e-15)
        period_s = run.scenario.period_s
        np.testing.assert_allclose(found[at[1:], 30:36], np.diff(q, axis=0) / period_s, atol=1e-12)
        # The servos are sent where the arm is, and lag behind the commands.
        assert np.abs(found[at, 36:42] - q).max() < 0.01 < np.abs(setpoint - q).max()
        for first, pose in ((42, "grip"), (48, "nominal")):
            turn_rad = record[f"{side}_grip_alpha" if pose == "grip" else "nominal_alpha"]
            rate = np.diff(turn_rad) / period_s
            np.testing.assert_allclose(found[at[1:], first + 4], rate, atol=1e-9)
    assert [row["answered"] for row in record.ports] == [rows, rows]


def moves(client: Rtde) -> None:
    """Ask for a motion that is not served."""
    client.negotiated().asked(b"I", COMMAND.encode())
    play(client.socket.getpeername()[1])
    client.write(1, [0.0] * 6)


def test_what_is_not_served_ends_the_run_by_its_name(run: Run) -> None:
    arms = [
        ServedArmConfig(robot="rtde", robot_port=free_robot_port(), sensor="none"),
        ServedArmConfig(robot="none", sensor="none"),
    ]
    with served(run, left=arms[0], right=arms[1]) as (cell, go):
        client = Rtde(cell.robots[0].port)  # type: ignore[attr-defined]
        threading.Thread(target=moves, args=(client,), daemon=True).start()
        record = go()
    assert record.outcome == "aborted"
    assert "the left arm's controller asks for moveJ (1), which is not served" in record.reason


def test_who_starts_no_program_is_told(run: Run) -> None:
    none = ServedArmConfig(robot="none", sensor="none")
    arm = ServedArmConfig(robot="rtde", robot_port=free_robot_port(), sensor="none")
    with served(run, left=arm, right=none, wait_s=0.2) as (_, go):
        record = go()
    assert (
        "in cycle 0 for 0.2 s (serve.wait_s) (its program does not run: ur_rtde's script"
        in record.reason
    )


def test_joint_targets_are_the_same_pose_by_forward_kinematics(run: Run) -> None:
    """Of the home pose both are known, as near as the inverse kinematics goes."""
    with served(run) as (cell, _):
        assert isinstance(cell, ServedCell)
        known = cell._served("right")
        place, axes = known.forward(run.cell.home[run.cell.arms.joints("right")])
    nominal = np.zeros(6)
    nominal[::2] = run.nominal_poses[0]  # type: ignore[attr-defined]
    np.testing.assert_allclose(deviation_from(nominal, place, axes), 0.0, atol=2e-8)


@pytest.mark.parametrize("seed", range(4))
def test_rotation_vectors_are_those_of_scipy(seed: int) -> None:
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation.random(rng=seed)
    vector = rotation.as_rotvec()
    np.testing.assert_allclose(rotation_vector_of(rotation.as_matrix()), vector, atol=1e-14)
    np.testing.assert_allclose(axes_about(vector), rotation.as_matrix(), atol=1e-14)


def test_a_client_that_connects_again_goes_on(run: Run) -> None:
    """Lock step waits for it; its registers are free again."""
    arms = [
        ServedArmConfig(robot="rtde", robot_port=free_robot_port(), sensor="none"),
        ServedArmConfig(robot="none", sensor="none"),
    ]

    def steer(port: int) -> None:
        play(port)
        with suppress(ConnectionError):
            while True:  # a connection a cycle
                client = Rtde(port).negotiated()
                client.outputs("timestamp,target_TCP_pose")
                while client.asked(b"I", COMMAND.encode())[0] != 1:
                    pass
                client.asked(b"S")
                client.write(24, client.doubles()[1:])
                client.socket.close()

    with served(run, left=arms[0], right=arms[1]) as (cell, go):
        port = cell.robots[0].port  # type: ignore[attr-defined]
        threading.Thread(target=steer, args=(port,), daemon=True).start()
        record = go()
    assert record.outcome == "completed", record.reason
    np.testing.assert_allclose(record["left_deviation_alpha"], 0.0, atol=1e-14)


def test_who_waits_for_a_package_that_it_has_had_gets_it_again(run: Run) -> None:
    """With the same timestamp: ur_rtde gives up after 2.5 s without a package."""
    arms = [
        ServedArmConfig(robot="rtde", robot_port=free_robot_port(), sensor="none"),
        ServedArmConfig(robot="none", sensor="none"),
    ]
    times: list[float] = []

    def steer(port: int) -> None:
        with suppress(ConnectionError):
            client = Rtde(port).negotiated()
            client.outputs("timestamp,target_TCP_pose")
            client.asked(b"I", COMMAND.encode())
            client.asked(b"S")
            while len(times) < 3:
                times.append(client.doubles()[0])
            play(port)
            while True:
                client.write(24, client.doubles()[1:])

    with served(run, left=arms[0], right=arms[1]) as (cell, go):
        port = cell.robots[0].port  # type: ignore[attr-defined]
        threading.Thread(target=steer, args=(port,), daemon=True).start()
        record = go()
    assert record.outcome == "completed", record.reason
    assert times == [0.028] * 3


def test_ports_that_cannot_be_are_refused_by_their_key() -> None:
    port = free_robot_port()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port - 5))
        with pytest.raises(
            InputError, match=rf"serve.left.robot_port - 5 = {port - 5} at .*opened"
        ):
            UrRobot(served_arm(), "127.0.0.1", port)
    with pytest.raises(InputError, match=r"robot_port = 3: the dashboard is 5 below it"):
        UrRobot(served_arm(), "127.0.0.1", 3)


def test_an_arm_that_is_no_urs_is_refused() -> None:
    with pytest.raises(InputError, match="a UR robot has 6 turning joints, this arm has 7"):
        UrRobot(served_arm(joints=7), "127.0.0.1", free_robot_port())
