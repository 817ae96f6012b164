"""A robot that sends its state over UDP and reads the answer that comes back to its socket."""

from __future__ import annotations

from typing import ClassVar

from dualbend.errors import refusing
from dualbend.run.record import TableRow
from dualbend.serve.port import ArmState, udp_socket
from dualbend.types import Side, Vector

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

    def __init__(self, side: Side, address: str, port: int) -> None:
        self.side: Side = side
        self.at = f"{address}:{port}"
        self.answer: Vector | None = None
        self.wrong_in_a_row, self.refused = 0, False
        self._packet = b""
        self._count = dict.fromkeys(("sent", "answered", "oversized", "doubled", *self.faults), 0)
        self._socket = udp_socket()
        with refusing(f"the {side} arm's controller at {self.at}", OSError, UnicodeError):
            self._socket.connect((address, port))

    def encode(self, state: ArmState) -> bytes:
        """Return the packet that tells the state of a cycle."""
        raise NotImplementedError

    def decode(self, data: bytes) -> Vector | str:
        """Return the deviation (6,) that an answer means, or which of the faults it has."""
        raise NotImplementedError

    def fileno(self) -> int:
        """Return the socket that is waited on."""
        return self._socket.fileno()

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""
        self.answer, self._packet = None, self.encode(state)
        self.again()

    def again(self) -> None:
        """Send the state again, to a controller that was not there."""
        self.refused = False
        try:
            self._socket.send(self._packet)
        except OSError:  # also what the last packet met
            self.refused = True
        else:
            self._count["sent"] += 1

    def receive(self) -> None:
        """Take one answer, if it is one to this cycle."""
        try:
            data = self._socket.recv(LONGEST + 1)
        except BlockingIOError:
            return
        except OSError:  # nobody is at the port
            self.refused = True
            return
        found: Vector | str = "oversized" if len(data) > LONGEST else self.decode(data)
        if isinstance(found, str):
            self._count[found] += 1
            self.wrong_in_a_row += 1
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
