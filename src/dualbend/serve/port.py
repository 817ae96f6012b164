"""What a protocol is to the served cell: a port of an arm's robot, or of its sensor."""

from __future__ import annotations

import socket
from typing import Protocol

import msgspec

from dualbend.errors import refusing
from dualbend.run.record import TableRow
from dualbend.types import Side, Vector


class ArmState(msgspec.Struct, frozen=True, kw_only=True):
    """What a robot says of its arm at the start of a command cycle.

    Attributes
    ----------
    cycle : number of the cycle, from 0
    measured, nominal
        Grip poses (6,): x, y, z [m], roll, pitch, yaw [rad] in the arm's bending frame, as the
        encoders tell it, and as the path has it.
    joints : measured joint angles (n,) [degrees], of a slide its position [mm]
    wrench : raw reading (6,) [N, N m] of the wrist sensor, in its axes; None: there is none
    read_turn : roll, pitch, yaw [rad] of these axes, in the bending frame, when it was sampled
    """

    cycle: int
    measured: Vector
    nominal: Vector
    joints: Vector
    wrench: Vector | None
    read_turn: Vector | None = None


class Port(Protocol):
    """A socket that the lock step waits on.

    None of its methods raises for what comes from outside: it is counted.
    """

    side: Side

    def fileno(self) -> int:
        """Return the socket that is waited on."""

    def receive(self) -> None:
        """Take one packet that has come."""

    def told(self) -> list[str]:
        """Return what listens where and in which units, a line each."""

    def counted(self) -> TableRow:
        """Return what went out and came in."""

    def close(self) -> None:
        """Free the port."""


class RobotPort(Port, Protocol):
    """The robot of an arm: it tells its state and is answered with a deviation.

    Attributes
    ----------
    answer : deviation (6,) of the cycle, x, y, z [m], roll, pitch, yaw [rad]; None: not yet
    wrong_in_a_row : answers since the last right one that were of no use
    refused : the last packet found nobody
    """

    answer: Vector | None
    wrong_in_a_row: int
    refused: bool

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""

    def again(self) -> None:
        """Send the state again, to a controller that was not there."""


class SensorPort(Port, Protocol):
    """The sensor of an arm: it sends its reading to who asked for it."""

    def publish(self, cycle: int, wrench: Vector, *, clipped: bool) -> None:
        """Tell the reading (6,) [N, N m] of a cycle, about the sensor's origin, in its axes."""

    def again(self) -> None:
        """Tell the reading again: whoever waits for it may have missed it."""


def udp_socket() -> socket.socket:
    """Return a UDP socket that never blocks."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    return made


def bound(made: socket.socket, address: str, port: int, key: str) -> int:
    """Bind a socket and return its port; InputError names the key where it cannot be."""
    with refusing(f"{key} = {port} at {address}: cannot be opened", OSError, UnicodeError):
        made.bind((address, port))
    return int(made.getsockname()[1])
