"""A client of UR's RTDE that is nothing but a socket."""

import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread

from dualbend.serve.cell import ServedCell
from support.served import free_ports

COMMAND = ",".join(["input_int_register_0", *(f"input_double_register_{i}" for i in range(6))])
Target = Callable[[list[float]], list[float]]
"""A pose to go to, of the numbers of a data package."""


def free_robot_port() -> int:
    """Return a TCP port of a robot, of whose script and dashboard the ports are free, too."""
    while True:
        (port,) = free_ports(1)
        with suppress(OSError):
            for one in (port, port - 1, port - 5):
                with socket.socket() as tried:
                    tried.bind(("127.0.0.1", one))
            return port


class Rtde:
    """One connection."""

    def __init__(self, port: int, address: str = "127.0.0.1") -> None:
        self.socket = socket.create_connection((address, port), 10.0)

    def send(self, kind: bytes, payload: bytes = b"") -> None:
        self.socket.sendall(struct.pack(">Hc", 3 + len(payload), kind) + payload)

    def receive(self) -> tuple[bytes, bytes]:
        size, kind = struct.unpack(">Hc", self._exactly(3))
        return kind, self._exactly(size - 3)

    def asked(self, kind: bytes, payload: bytes = b"") -> bytes:
        """Send a request and return what answers it."""
        self.send(kind, payload)
        while (found := self.receive())[0] != kind:
            pass
        return found[1]

    def negotiated(self) -> "Rtde":
        assert self.asked(b"V", struct.pack(">H", 2)) == b"\1"
        return self

    def outputs(self, names: str, frequency: float = 500.0) -> bytes:
        return self.asked(b"O", struct.pack(">d", frequency) + names.encode())

    def write(self, number: int, pose: list[float], recipe: int = 1) -> None:
        self.send(b"U", struct.pack(">Bi6d", recipe, number, *pose))

    def doubles(self) -> list[float]:
        """Return the numbers of the next data package, all of them doubles."""
        while (found := self.receive())[0] != b"U":
            pass
        return list(struct.unpack(f">{len(found[1][1:]) // 8}d", found[1][1:]))

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                raise ConnectionError
            data += more
        return data


def play(port: int) -> None:
    """Start the robot's program."""
    with socket.create_connection(("127.0.0.1", port - 5), 10.0) as dashboard:
        dashboard.sendall(b"play\n")
        said = b""
        while b"Starting program\n" not in said:
            said += dashboard.recv(1000)


@contextmanager
def steered(cell: ServedCell, target: Target, names: str = "target_TCP_pose") -> Iterator[None]:
    """Steer every robot of a cell by servoL, in threads; a target is asked for once a cycle."""

    def steer(port: int, address: str) -> None:
        with suppress(OSError):
            client = Rtde(port, address).negotiated()
            client.outputs(f"timestamp,{names}")
            client.asked(b"I", COMMAND.encode())
            play(port)
            client.asked(b"S")
            last = 0.0
            while True:
                time_s, *numbers = client.doubles()
                if time_s != last:
                    client.write(24, target(numbers))
                last = time_s

    for robot in cell.robots:
        where = robot.port, robot.address  # type: ignore[attr-defined]
        Thread(target=steer, args=where, daemon=True).start()
    yield
