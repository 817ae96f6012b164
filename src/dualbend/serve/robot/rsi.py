"""KUKA RSI: the robot sends its state to the user's controller and waits for a correction."""

from __future__ import annotations

from dualbend.serve.port import ArmState
from dualbend.serve.robot.telegram import decode, encode
from dualbend.serve.robot.udp import UdpRobot
from dualbend.types import Side, Vector


class RsiRobot(UdpRobot):
    """The robot's end of RSI; IPOC counts the milliseconds of command periods."""

    protocol = "rsi"
    units = (
        "KUKA RSI: <Sen> with RKorr and IPOC; RIst, RSol, RKorr in mm and degrees in the arm's "
        "bending frame (B is its bending angle)"
    )
    faults = ("malformed", "wrong_ipoc")

    def __init__(self, side: Side, address: str, port: int, period_s: float) -> None:
        super().__init__(side, address, port)
        self._tick, self._ipoc = max(round(1e3 * period_s), 1), 0

    def encode(self, state: ArmState) -> bytes:
        """Return the packet that tells the state of a cycle."""
        self._ipoc = (state.cycle + 1) * self._tick
        poses, turned = (state.measured, state.nominal), state.read_turn
        return encode(*poses, state.joints, self.wrong, self._ipoc, turned)

    def decode(self, data: bytes) -> Vector | str:
        """Return the deviation (6,) that an answer means, or which of the faults it has."""
        found = decode(data)
        if found is None:
            return "malformed"
        ipoc, deviation = found
        return deviation if ipoc == self._ipoc else "wrong_ipoc"
