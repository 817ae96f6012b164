"""What a protocol is to the served cell: a port of an arm's robot, or of its sensor."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from typing import Protocol

import msgspec
import numpy as np

from dualbend.errors import refusing
from dualbend.run.record import TableRow
from dualbend.types import Side, Vector


class Served(msgspec.Struct, frozen=True, kw_only=True):
    """What a robot's port knows of its arm from the start.

    Attributes
    ----------
    period_s : command period
    joints, slides : how many joints the arm has; whether one of them slides
    sensed : the arm has a wrist sensor
    tool_kg, tool_m : mass and centre (3,) of what the wrist bears, in the sensor's axes
    unknown : what becomes of a variable that the cell does not know
    forward : place (3,) [m] and axes (3, 3) of the grip in the arm's bending frame, of joint
        angles (joints,) [rad], of a slide [m]
    """

    side: Side
    period_s: float
    joints: int = 6
    slides: bool = False
    sensed: bool = True
    tool_kg: float = 0.0
    tool_m: Vector = np.zeros(3)
    unknown: str = "refused"
    forward: Callable[[Vector], tuple[Vector, Vector]]


class ArmState(msgspec.Struct, frozen=True, kw_only=True):
    """What a robot says of its arm at the start of a command cycle.

    Attributes
    ----------
    cycle : number of the cycle, from 0
    measured, nominal
        Grip poses (6,): x, y, z [m], roll, pitch, yaw [rad] in the arm's bending frame, as the
        encoders tell it, and as the path has it.
    origin : pose (6,) from which an answer is a deviation
    joints : measured joint angles (n,) [degrees], of a slide its position [mm]
    setpoint : the same, as the servos are sent to
    wrench : raw reading (6,) [N, N m] of the wrist sensor, in its axes; None: there is none
    force : what of it acts at the grip (6,), without the tool's weight, in the bending frame
    read_turn : roll, pitch, yaw [rad] of these axes, in the bending frame, when it was sampled
    """

    cycle: int
    measured: Vector
    nominal: Vector
    origin: Vector
    joints: Vector
    setpoint: Vector
    wrench: Vector | None = None
    force: Vector | None = None
    read_turn: Vector | None = None


class Port(Protocol):
    """A port of the cell.

    None of its methods raises for what comes from outside: it is counted.
    """

    side: Side

    def watch(self, selector: selectors.BaseSelector) -> None:
        """Register its sockets, each with what takes a packet that has come as the data."""

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
    late : the same, that an answer asked for which came after its cycle and acts in this one
    missed : the cycle goes on without an answer: what comes before the next question is late
    wrong_in_a_row : answers since the last right one that were of no use
    """

    answer: Vector | None
    late: Vector | None
    missed: bool
    wrong_in_a_row: int

    @property
    def refused(self) -> bool:
        """Whether the state is to be sent again: nobody was there, or may wait for it."""

    @property
    def gone_wrong(self) -> str:
        """What the controller did that ends the run; "": nothing."""

    @property
    def hint(self) -> str:
        """Why there may be no answer; "": nothing is known."""

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""

    def again(self) -> None:
        """Send the state again."""


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
