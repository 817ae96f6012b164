"""A robot that sends its state over UDP and reads the answer that comes back to its socket."""

from __future__ import annotations

import selectors
from typing import ClassVar

from dualbend.errors import refusing
from dualbend.run.record import TableRow
from dualbend.serve.port import ArmState, Served, udp_socket
from dualbend.types import Vector

LONGEST = 8192
"""Bytes of an answer that is read."""


class UdpRobot:
    """A :class:`dualbend.serve.port.RobotPort` that sends to a controller at an address and port.

    A subclass says what is sent and what an answer means. Answers come from that address and port
    alone: whatever else is sent to this socket the system drops. Raises InputError where there is
    no such address.
    """

    protocol: ClassVar[str]
    units: ClassVar[str]
    faults: ClassVar[tuple[str, ...]]

    def __init__(self, served: Served, address: str, port: int) -> None:
        self.side, self.served = served.side, served
        self.at = f"{address}:{port}"
        self.answer: Vector | None = None
        self.late: Vector | None = None
        self.missed, self._stale = False, b""
        self.wrong_in_a_row, self.gone_wrong, self.hint, self._refused = 0, "", "", False
        self._packet = b""
        self._count = dict.fromkeys(("sent", "answered", "oversized", "doubled", *self.faults), 0)
        self._socket = udp_socket()
        with refusing(f"the {self.side} arm's controller at {self.at}", OSError, UnicodeError):
            self._socket.connect((address, port))

    def encode(self, state: ArmState) -> bytes:
        """Return the packet that tells the state of a cycle."""
        raise NotImplementedError

    def decode(self, data: bytes) -> Vector | str:
        """Return the deviation (6,) that an answer means, or which of the faults it has."""
        raise NotImplementedError

    def watch(self, selector: selectors.BaseSelector) -> None:
        """Register what is waited on."""
        selector.register(self._socket, selectors.EVENT_READ, self.receive)

    @property
    def refused(self) -> bool:
        """Whether nobody was there and the answer is missing: a controller sees a state once."""
        return self._refused and self.answer is None

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""
        self.answer, self.missed, self._packet = None, False, self.encode(state)
        self.again()

    def again(self) -> None:
        """Send the state again, to a controller that was not there."""
        self._refused = False
        try:
            self._socket.send(self._packet)
        except OSError:  # also what the last packet met
            self._refused = True
        else:
            self._count["sent"] += 1

    def receive(self) -> None:
        """Take one answer, if it is one to this cycle."""
        try:
            data = self._socket.recv(LONGEST + 1)
        except BlockingIOError:
            return
        except OSError:  # nobody is at the port
            self._refused = True
            return
        found: Vector | str = "oversized" if len(data) > LONGEST else self.decode(data)
        if isinstance(found, str):
            self._count[found] += 1
            self.wrong_in_a_row += 1
        elif self.missed:
            self._count["late"] += 1
            self._stale = data
        elif self.answer is not None:
            self._count["doubled"] += 1
        else:
            self.answer, self.wrong_in_a_row = found, 0
            self._count["answered"] += 1

    @property
    def wrong(self) -> int:
        """Number of answers until now that were of no use."""
        return sum(self._count[name] for name in ("oversized", *self.faults))

    def told(self) -> list[str]:
        """Return where the robot sends to, and in which units."""
        return [f"{self.side} robot: sends to UDP {self.at} and waits for the answer; {self.units}"]

    def counted(self) -> TableRow:
        """Return what went out and came in."""
        about = {"port": f"{self.side} robot", "protocol": self.protocol, "at": self.at}
        return {**about, **self._count}

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
