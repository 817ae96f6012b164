"""Served cells and the controllers that steer them, in processes and threads of their own."""

import selectors
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import numpy as np

from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServeConfig, ServedArmConfig
from dualbend.serve.cell import ServedCell
from dualbend.serve.port import ArmState, Port, Served
from dualbend.types import Vector

CLIENT = Path(__file__).parents[2] / "docs" / "examples" / "own_client.py"
TOLD = "import sys; sys.path.insert(0, sys.argv[1]); import own_client as c; c.main({}, {}, {})"

Answer = Callable[[bytes], list[bytes]]
"""What a controller sends when a telegram comes."""


def free_ports(count: int) -> list[int]:
    """Return UDP ports that nobody has."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def take(port: Port, seconds: float = 5.0) -> bool:
    """Let a port take what comes within a time; returns whether something has."""
    with selectors.DefaultSelector() as selector:
        port.watch(selector)
        came = selector.select(seconds)
        for key, _ in came:
            key.data()
    return bool(came)


def served_arm(**known: object) -> Served:
    """Return the left arm as a port knows it; its joint angles are place [m] and rotation [rad]."""

    def forward(joints: Vector) -> tuple[Vector, Vector]:
        return joints[:3], np.eye(3)

    return msgspec.structs.replace(Served(side="left", period_s=0.028, forward=forward), **known)


def arm_state(cycle: int, **known: object) -> ArmState:
    """Return a state of an arm in which all is 0 that is not given."""
    rest = {name: np.zeros(6) for name in ("measured", "nominal", "origin", "joints", "setpoint")}
    return ArmState(cycle=cycle, **rest | known)  # type: ignore[arg-type]


@contextmanager
def served(
    run: Run, *, realtime: bool = False, **keys: object
) -> Iterator[tuple[ServedCell, Callable[[], RunRecord]]]:
    """Give a cell with open ports, all free ones, and what runs it to its end."""
    left, right = (
        ServedArmConfig(robot_port=port, sensor_port=0, http_port=0) for port in free_ports(2)
    )
    config = msgspec.structs.replace(ServeConfig(left=left, right=right), **keys)
    before = run.scenario
    run.scenario = msgspec.structs.replace(before, serve=config)
    try:
        cell = ServedCell(run)
        with cell.open(realtime=realtime) as loop:
            yield cell, loop.run
    finally:
        run.scenario = before


@contextmanager
def example_client(cell: ServedCell, tools: object) -> Iterator[None]:
    """Steer a cell by the example of the documentation, in a process of its own."""
    robots = [cell.robot_port(robot.side) for robot in cell.robots]
    sensors = [sensor.port for sensor in cell.sensors]  # type: ignore[attr-defined]
    code = TOLD.format(robots, sensors, tools)
    client = subprocess.Popen([sys.executable, "-c", code, str(CLIENT.parent)])
    try:
        yield
    finally:
        client.kill()
        client.wait()


@contextmanager
def controllers(cell: ServedCell, *answers: Answer) -> Iterator[None]:
    """Steer the arms of a cell by one function each, in threads."""
    sockets = []
    for robot, answer in zip(cell.robots, answers, strict=True):
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        one.bind(("127.0.0.1", cell.robot_port(robot.side)))
        one.settimeout(30.0)
        sockets.append(one)
        threading.Thread(target=_answer, args=(one, answer), daemon=True).start()
    try:
        yield
    finally:
        for one in sockets:
            with suppress(OSError):  # wakes the thread
                one.shutdown(socket.SHUT_RDWR)
            one.close()


def _answer(robot: socket.socket, answer: Answer) -> None:
    with suppress(OSError):
        while True:
            telegram, at = robot.recvfrom(8192)
            for packet in answer(telegram):
                robot.sendto(packet, at)
