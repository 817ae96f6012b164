"""The paper's admittance as a controller of its own: nothing but sockets, RSI and Net F/T.

    δα[n] = 2 degrees per N m × the mean of the last two moments at the grip (fig8's gains)

Each cycle: the robot tells how the sensor was turned when it took its reading (RRead) and waits;
the sensor's record of the cycle, less the tool's weight, moved to the grip, makes the moment; RKorr
B answers.

Run: dualbend serve fig8 --client "python docs/examples/own_client.py"
"""

import math
import os
import re
import socket
import struct
from collections.abc import Sequence
from dataclasses import dataclass

GAIN_DEG_PER_NM, COUNTS, LEVER_M = 2.0, 1e6, 0.12


def told(what: str, left: str, right: str) -> list[list[float]]:
    """Return the numbers of both arms: those that `dualbend` tells, where it started this."""
    texts = [
        os.environ.get(f"DUALBEND_{s}_{what}", d) for s, d in (("LEFT", left), ("RIGHT", right))
    ]
    return [[float(number) for number in text.split()] for text in texts]


ROBOTS = [int(port) for (port,) in told("ROBOT_PORT", "49152", "49153")]
SENSORS = [int(port) for (port,) in told("SENSOR_PORT", "49162", "49163")]
TOOL = "0.61 0.047869 0 0"  # kg; its centre [m]: `dualbend serve` prints them
TOOLS = [(mass, x, z) for mass, x, _, z in told("TOOL", TOOL, TOOL)]


@dataclass
class Arm:
    """One arm's controller: its robot's port, its sensor's port, and what it remembers."""

    robot: socket.socket
    sensor: socket.socket
    tool: tuple[float, float, float]
    moment: float = math.nan
    record: int = 0

    def answer(self, telegram: bytes) -> bytes:
        """Return the correction of a cycle."""
        read = re.search(rb'<RRead A="[^"]*" B="([^"]*)" C="([^"]*)"', telegram)
        moment = self.moment_nm(*(math.radians(float(angle)) for angle in read.groups()))
        mean = moment if math.isnan(self.moment) else (moment + self.moment) / 2.0
        self.moment = moment
        ipoc = re.search(rb"<IPOC>(\d+)</IPOC>", telegram)[1].decode()
        turn = f'<RKorr X="0" Y="0" Z="0" A="0" B="{GAIN_DEG_PER_NM * mean:.9f}" C="0"/>'
        return f'<Sen Type="ImFree">{turn}<IPOC>{ipoc}</IPOC></Sen>'.encode()

    def moment_nm(self, b: float, c: float) -> float:
        """Return the moment about the grip, of the first record that is new; turned by B and C."""
        number = self.record
        while number == self.record:  # a record that was sent twice has its number twice
            _, number, _, _, _, fz, _, ty, _ = struct.unpack(">III6i", self.sensor.recv(64))
        self.record, (mass, x, z) = number, self.tool
        weight_x, weight_z = mass * 9.81 * math.sin(b), -mass * 9.81 * math.cos(b) * math.cos(c)
        moment = ty / COUNTS - (z * weight_x - x * weight_z)
        return moment + LEVER_M * (fz / COUNTS - weight_z)


def main(
    robots: Sequence[int] = ROBOTS,
    sensors: Sequence[int] = SENSORS,
    tools: Sequence[tuple[float, float, float]] = TOOLS,
) -> None:
    """Control both arms until the robots are silent for a while."""
    arms = []
    for port, sensor, tool in zip(robots, sensors, tools, strict=True):
        arm = Arm(*(socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)), tool)
        arm.robot.bind(("127.0.0.1", port))
        arm.sensor.connect(("127.0.0.1", sensor))
        arms.append(arm)
    while True:
        try:
            told = [arm.robot.recvfrom(8192) for arm in arms]
        except TimeoutError:
            return
        for arm, (telegram, robot) in zip(arms, told, strict=True):
            if not arm.record:  # the robot is there, so the sensor is: stream without end
                arm.sensor.send(struct.pack(">HHI", 0x1234, 2, 0))
                arm.robot.settimeout(5.0)
            arm.robot.sendto(arm.answer(telegram), robot)


if __name__ == "__main__":
    main()
