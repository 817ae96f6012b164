"""Mutated packets on every kind of port of a served cell: counted, and nothing else happens.

``python tests/lanes/packets.py --count 200000 --seed 1``

Each packet is a right one with bytes changed, lost, doubled or put in, sent over a socket to a port
that is open. After each, what it can have done is looked at: an answer is a deviation of finite
numbers, or there is none; nothing raises; the port takes it in a time that is measured. Afterwards
the port still answers a right packet. A line for each kind; the exit code is 1 where one fails.
"""

from __future__ import annotations

import argparse
import selectors
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from dualbend.serve.port import Port
from dualbend.serve.robot.egm import EgmRobot
from dualbend.serve.robot.protobuf import doubles, message, whole
from dualbend.serve.robot.rsi import RsiRobot
from dualbend.serve.robot.ur.robot import UrRobot
from dualbend.serve.sensor.netft import NetFT
from support.rtde import COMMAND, free_robot_port
from support.served import arm_state, served_arm

HANGS_S = 30.0  # a machine that does much else stops a process for a second
RSI = (
    b'<Sen Type="ImFree"><RKorr X="0.5" Y="0" Z="-1e-1" A="0" B="+.25" C="0"/>'
    b"<DiO>125</DiO><IPOC>28</IPOC></Sen>"
)
HEADER, UPRIGHT = message(1, whole(1, 5), whole(3, 3)), doubles(1.0, 0.0, 0.0, 0.0)
EGM = [
    HEADER + message(2, message(2, message(1, doubles(-400.0, 0.0, 1250.0)), message(2, UPRIGHT))),
    HEADER + message(2, message(1, message(1, *([b"\x09" + struct.pack("<d", 10.0)] * 6)))),
]
RDT = [
    struct.pack(">HHI", 0x1234, command, count) for command in (0, 2, 3, 0x42) for count in (0, 1)
]


def package(kind: bytes, payload: bytes = b"") -> bytes:
    return struct.pack(">Hc", 3 + len(payload), kind) + payload


NAMES = b"timestamp,actual_TCP_pose,actual_TCP_force,runtime_state,output_int_register_0"
VERSION = package(b"V", b"\0\2")
SETUP = VERSION + package(b"I", COMMAND.encode())
RTDE = [
    (VERSION, package(b"v")),
    (VERSION, package(b"O", struct.pack(">d", 500.0) + NAMES) + package(b"S") + package(b"P")),
    (VERSION, package(b"I", COMMAND.encode())),
    (SETUP, package(b"U", struct.pack(">Bi6d", 1, 24, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0))),
    (SETUP, package(b"U", struct.pack(">Bi6d", 1, 16, *[0.0] * 6))),
]
"""What is sent before, and a packet."""
SCRIPT = [
    (
        b"",
        b"def rtde_control():\n  global reg_offset_int = # int register offset\n24\n"
        b"# HEADER_BEGIN\n# NODE_CONTROL_LOOP_ENDS\nend\n",
    )
]
DASHBOARD = [
    (b"", line)
    for line in (b"play\n", b"running\nstop\n", b"PolyscopeVersion\nquit\n", b"load x.urp\n")
]


def mutated(rng: np.random.Generator, right: bytes) -> bytes:
    """Return a packet with one to four bytes or parts changed."""
    data = bytearray(right)
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(len(data) + 1))
        end = at + int(rng.integers(1, 9))
        match rng.integers(6):
            case 0:
                data[at : at + 1] = rng.bytes(1)
            case 1:
                data[at : at + 1] = rng.choice([b"\0", b"\xff", b"\x7f", b"\x80"])
            case 2:
                del data[at:end]
            case 3:
                data[at:at] = data[at : at + int(rng.integers(1, 200))]
            case 4:
                data[at:at] = rng.bytes(int(rng.integers(1, 9)))
            case _:
                del data[at:]
    return bytes(data)


@dataclass
class Tried:
    """What has come of the packets of a kind."""

    packets: int = 0
    answers: int = 0
    slowest_s: float = 0.0
    selector: selectors.BaseSelector = field(default_factory=selectors.DefaultSelector)

    def take(self, until: Callable[[], bool]) -> None:
        """Let the port take what has come; RuntimeError where it hangs."""
        began = time.perf_counter()
        while not until():
            for key, _ in self.selector.select(0.001):
                key.data()
            if time.perf_counter() - began > HANGS_S:
                raise RuntimeError("hangs")
        self.slowest_s = max(self.slowest_s, time.perf_counter() - began)

    def note(self, port: Port, cycle: int) -> None:
        """Look at what a packet has done."""
        self.packets += 1
        answer = getattr(port, "answer", None)
        if answer is not None:
            self.answers += 1
            assert answer.shape == (6,)
            assert np.isfinite(answer).all()


def total(port: Port, *names: str) -> int:
    """Return the sum of counts."""
    return sum(int(count) for name, count in port.counted().items() if name in names)


UDP_COUNTS = ("answered", "oversized", "doubled", "malformed", "wrong_ipoc", "late")


def udp_robot(
    made: type[RsiRobot] | type[EgmRobot], right: list[bytes], rng: np.random.Generator, count: int
) -> Tried:
    """Answer a UDP robot; every packet that is not empty is one of its counts."""
    tried = Tried()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
        controller.bind(("127.0.0.1", 0))
        robot = made(served_arm(), "127.0.0.1", controller.getsockname()[1])
        robot.watch(tried.selector)
        for _ in range(count):
            robot.ask(arm_state(0))
            _, at = controller.recvfrom(8192)
            before = total(robot, *UDP_COUNTS)
            controller.sendto(mutated(rng, right[rng.integers(len(right))]), at)
            tried.take(lambda before=before: total(robot, *UDP_COUNTS) > before)
            tried.note(robot, 0)
        robot.ask(arm_state(0))
        controller.sendto(right[0], at)
        tried.take(lambda: robot.answer is not None)
        robot.close()
    return tried


def sensor(rng: np.random.Generator, count: int) -> Tried:
    """Ask a Net F/T; every packet is a request or malformed."""
    tried, port = Tried(), NetFT("left", "127.0.0.1", 0, 0, 0.028)
    port.watch(tried.selector)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", port.port))
        client.setblocking(False)
        for cycle in range(count):
            before = total(port, "requests", "malformed")
            client.send(mutated(rng, RDT[rng.integers(len(RDT))]))
            tried.take(lambda before=before: total(port, "requests", "malformed") > before)
            port.publish(cycle, rng.normal(size=6), clipped=False)
            tried.note(port, cycle)
            drained(client)
        client.send(RDT[3])
        before = total(port, "sent")
        tried.take(lambda: total(port, "sent") > before)
    port.close()
    return tried


def drained(client: socket.socket) -> None:
    """Read what has come."""
    try:
        while client.recv(65536):
            pass
    except BlockingIOError:
        pass


@contextmanager
def connected(port: int, tried: Tried) -> Iterator[socket.socket]:
    """Give a connection that the port has accepted."""
    with socket.create_connection(("127.0.0.1", port), 5.0) as client:
        yield client
        client.shutdown(socket.SHUT_WR)
        client.settimeout(0.0)
        gone = False

        def ended() -> bool:
            nonlocal gone
            try:
                while not gone:
                    gone = not client.recv(65536)
            except BlockingIOError:
                pass
            except OSError:
                gone = True
            return gone

        tried.take(ended)


def ur(
    offset: int, right: list[tuple[bytes, bytes]], rng: np.random.Generator, count: int
) -> Tried:
    """Talk to one of a UR robot's ports, a connection a packet, which is taken to its end."""
    tried = Tried()
    robot = UrRobot(served_arm(), "127.0.0.1", free_robot_port())
    robot.watch(tried.selector)
    for cycle in range(count):
        robot.program.play()
        robot.ask(arm_state(cycle))
        with connected(robot.port + offset, tried) as client:
            before, packet = right[rng.integers(len(right))]
            client.sendall(before + mutated(rng, packet))
        tried.note(robot, cycle)
    robot.program.play()
    robot.ask(arm_state(count))
    with connected(robot.port, tried) as client:
        client.sendall(b"".join(RTDE[3]))
    assert robot.answer is not None
    robot.close()
    return tried


def page(rng: np.random.Generator, count: int) -> Tried:
    """Ask for a Net F/T's page, which a thread of its own answers."""
    tried, port = Tried(), NetFT("left", "127.0.0.1", 0, 0, 0.028)
    right = b"GET /netftapi2.xml HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"
    for cycle in range(count):
        with connected(port.http_port, tried) as client:
            client.sendall(mutated(rng, right))
        tried.note(port, cycle)
    with socket.create_connection(("127.0.0.1", port.http_port), 5.0) as client:
        client.sendall(right)
        assert client.recv(1000).startswith(b"HTTP/1.0 200")
    port.close()
    return tried


KINDS: dict[str, Callable[[np.random.Generator, int], Tried]] = {
    "RSI": lambda rng, count: udp_robot(RsiRobot, [RSI], rng, count),
    "EGM": lambda rng, count: udp_robot(EgmRobot, EGM, rng, count),
    "Net F/T": sensor,
    "Net F/T page": page,
    "RTDE": lambda rng, count: ur(0, RTDE, rng, count),
    "UR script": lambda rng, count: ur(-1, SCRIPT, rng, count),
    "UR dashboard": lambda rng, count: ur(-5, DASHBOARD, rng, count),
}


def main() -> int:
    """Try all kinds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=KINDS)
    asked = parser.parse_args()
    for name, tried_by in KINDS.items():
        if asked.only in (None, name):
            began = time.perf_counter()
            tried = tried_by(np.random.default_rng(asked.seed), asked.count)
            print(
                f"{name}: {tried.packets} packets, {tried.answers} of them answers, slowest "
                f"{1e3 * tried.slowest_s:.1f} ms, {time.perf_counter() - began:.0f} s in all",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
