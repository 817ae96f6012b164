"""KUKA RSI: the robot sends its state to the user's controller and waits for a correction."""

from __future__ import annotations

from dualbend.serve.port import ArmState, Served
from dualbend.serve.robot.telegram import decode, encode
from dualbend.serve.robot.udp import UdpRobot
from dualbend.types import Vector


class RsiRobot(UdpRobot):
    """The robot's end of RSI; IPOC counts the milliseconds of command periods."""

    protocol = "rsi"
    units = (
        "KUKA RSI: <Sen> with RKorr and IPOC; RIst, RSol, RKorr in mm and degrees in the arm's "
        "bending frame (B is its bending angle)"
    )
    faults = ("malformed", "wrong_ipoc", "late")

    def __init__(self, served: Served, address: str, port: int) -> None:
        super().__init__(served, address, port)
        self._tick, self._ipoc = max(round(1e3 * served.period_s), 1), 0

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
        if ipoc == self._ipoc:
            return deviation
        return "late" if 0 < ipoc < self._ipoc and not ipoc % self._tick else "wrong_ipoc"
