"""Served cells and the controllers that steer them, in processes and threads of their own."""

import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServeConfig, ServedArmConfig
from dualbend.serve.cell import ServedCell

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


@contextmanager
def served(run: Run, **keys: object) -> Iterator[tuple[ServedCell, Callable[[], RunRecord]]]:
    """Give a cell with open ports, all free ones, and what runs it to its end."""
    left, right = (
        ServedArmConfig(robot_port=port, sensor_port=0, http_port=0) for port in free_ports(2)
    )
    config = msgspec.structs.replace(ServeConfig(left=left, right=right), **keys)
    before = run.scenario
    run.scenario = msgspec.structs.replace(before, serve=config)
    try:
        cell = ServedCell(run)
        with cell.open() as lockstep:
            yield cell, lockstep.run
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
