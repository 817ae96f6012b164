"""KUKA RSI: the robot sends its state to the user's controller and waits for a correction."""

from __future__ import annotations

from dualbend.errors import refusing
from dualbend.run.record import TableRow
from dualbend.serve.port import ArmState, udp_socket
from dualbend.serve.robot.telegram import LONGEST, decode, encode
from dualbend.types import Side, Vector


class RsiRobot:
    """The robot's end of RSI over UDP, which sends to the controller at an address and port.

    Answers come from there alone, whatever else is sent to this socket the system drops. IPOC
    counts the milliseconds of command periods. Raises InputError where there is no such address.
    """

    def __init__(self, side: Side, address: str, port: int, period_s: float) -> None:
        self.side: Side = side
        self.at = f"{address}:{port}"
        self.answer: Vector | None = None
        self.wrong_in_a_row, self.refused = 0, False
        self._tick = max(round(1e3 * period_s), 1)
        self._ipoc, self._packet = 0, b""
        self._count = dict.fromkeys(
            ("sent", "answered", "wrong_ipoc", "malformed", "oversized", "doubled"), 0
        )
        self._socket = udp_socket()
        with refusing(f"the {side} arm's controller at {self.at}", OSError, UnicodeError):
            self._socket.connect((address, port))

    def fileno(self) -> int:
        """Return the socket that is waited on."""
        return self._socket.fileno()

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""
        self.answer, self._ipoc = None, (state.cycle + 1) * self._tick
        self._packet = encode(
            state.measured, state.nominal, state.joints, self.wrong_in_a_row, self._ipoc
        )
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
        found = decode(data)
        if len(data) > LONGEST:
            self._wrong("oversized")
        elif found is None:
            self._wrong("malformed")
        elif found[0] != self._ipoc:
            self._wrong("wrong_ipoc")
        elif self.answer is not None:
            self._count["doubled"] += 1
        else:
            self.answer, self.wrong_in_a_row = found[1], 0
            self._count["answered"] += 1

    def _wrong(self, how: str) -> None:
        self._count[how] += 1
        self.wrong_in_a_row += 1

    def told(self) -> list[str]:
        """Return where the robot sends to, and in which units."""
        return [
            f"{self.side} robot: KUKA RSI, sends to UDP {self.at} and waits there for <Sen> with "
            "RKorr and IPOC; RIst, RSol, RKorr in mm and degrees in the arm's bending frame (B is "
            "its bending angle)"
        ]

    def counted(self) -> TableRow:
        """Return what went out and came in."""
        return {"port": f"{self.side} robot", "protocol": "rsi", "at": self.at, **self._count}

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
