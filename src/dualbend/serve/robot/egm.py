"""ABB EGM: the robot sends EgmRobot to the user's controller and waits for an EgmSensor."""

from __future__ import annotations

import math
import struct
from contextlib import suppress

import numpy as np

from dualbend.control.alter import turn
from dualbend.serve.port import ArmState, Served
from dualbend.serve.robot.pose import axes_of, deviation_from, quaternion_of
from dualbend.serve.robot.protobuf import double, doubles, fields, message, whole
from dualbend.serve.robot.udp import LONGEST, UdpRobot
from dualbend.types import Vector

_DATA, _MOTORS_ON, _MCI_RUNNING, _RAPID_RUNNING = 2, 1, 3, 2
_MOST_LATE = 1000
"""Packets that are taken off the socket before a question: who floods it is not waited for."""
_LARGEST = 1e9
_MOST_OFF = 1e-3
"""Of a quaternion's length from 1."""


class EgmRobot(UdpRobot):
    """The robot's end of EGM position guidance, in poses or in joints.

    An answer carries its sender's own number, so it is the first packet after a question that
    answers it: what came before is taken off the socket first. The last of those is late.
    """

    protocol = "egm"
    units = (
        "ABB EGM: EgmSensor with planned.cartesian, the pose to go to, pos in mm and orient in the "
        "arm's bending frame, or planned.joints in degrees; planned of EgmRobot is the nominal "
        "pose, measuredForce the sensor's reading"
    )
    faults = ("malformed", "late")

    def __init__(self, served: Served, address: str, port: int) -> None:
        super().__init__(served, address, port)
        self._origin: Vector = np.zeros(6)

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""
        last, self._stale, self._origin = self._stale, b"", state.origin
        with suppress(OSError):  # nothing is left, or nobody is there
            for _ in range(_MOST_LATE):
                last = self._socket.recv(LONGEST)
                self._count["late"] += 1
        found = self.decode(last)
        self.late = None if isinstance(found, str) else found
        super().ask(state)

    def encode(self, state: ArmState) -> bytes:
        """Return the EgmRobot that tells the state of a cycle."""
        return encode(state, state.cycle * self.served.period_s)

    def decode(self, data: bytes) -> Vector | str:
        """Return the deviation (6,) of what an EgmSensor asks for from the origin."""
        found = decode(data)
        if isinstance(found, tuple):
            return deviation_from(self._origin, *found)
        if found is None or len(found) != self.served.joints or self.served.slides:
            return "malformed"
        return deviation_from(self._origin, *self.served.forward(np.radians(found)))


def encode(state: ArmState, time_s: float) -> bytes:
    """Return EgmRobot: header, feedBack, planned, states, measuredForce."""
    clock = message(4, whole(1, int(time_s)), whole(2, round(1e6 * (time_s % 1.0))))
    joints, setpoint = (
        message(1, *(double(1, angle) for angle in angles.tolist()))
        for angles in (state.joints, state.setpoint)
    )
    parts = [
        message(1, whole(1, state.cycle), whole(2, round(1e3 * time_s)), whole(3, _DATA)),
        message(2, joints, message(2, _pose(state.measured)), clock),
        message(3, setpoint, message(2, _pose(state.nominal)), clock),
        message(4, whole(1, _MOTORS_ON)),
        message(5, whole(1, _MCI_RUNNING)),
        whole(6, 1),
        message(8, whole(1, _RAPID_RUNNING)),
    ]
    if state.wrench is not None:
        force = (double(2, value) for value in state.wrench.tolist())
        parts.append(message(9, whole(1, 1), *force))
    return b"".join(parts)


def _pose(pose: Vector) -> bytes:
    """Return EgmPose of a pose (6,): position in mm, quaternion."""
    place = message(1, doubles(*(1e3 * pose[:3]).tolist()))
    return place + message(2, doubles(*quaternion_of(turn(pose[3:]))))


def decode(data: bytes) -> tuple[Vector, Vector] | list[float] | None:
    """Return what an EgmSensor asks for; None: nothing that is known.

    Place (3,) [m] and axes (3, 3) of ``planned.cartesian``, or the joint angles [degrees] of
    ``planned.joints``.
    """
    try:
        planned = _one(data, 2)
        if {number for number, _ in fields(planned)} == {1}:
            return _angles(_one(planned, 1))
        pose = _one(planned, 2)
        place, orient = _doubles(_one(pose, 1), 3), _doubles(_one(pose, 2), 4)
    except ValueError:
        return None
    length = math.sqrt(sum(u * u for u in orient))
    if not abs(length - 1.0) <= _MOST_OFF:
        return None
    return 1e-3 * np.array(place), axes_of([u / length for u in orient])


def _angles(data: bytes) -> list[float]:
    """Return the doubles of a repeated field 1, packed or not; ValueError where there are none."""
    found = list[float]()
    for number, value in fields(data):
        more = [value] if isinstance(value, float) else []
        if isinstance(value, bytes) and not len(value) % 8:
            more = [angle for (angle,) in struct.iter_unpack("<d", value)]
        if number != 1 or not more or not all(abs(angle) < _LARGEST for angle in more):
            raise ValueError(f"field {number}: needs numbers")
        found += more
    return found


def _one(data: bytes, number: int) -> bytes:
    """Return the message that is there once; ValueError where it is not."""
    found = [value for key, value in fields(data) if key == number]
    if len(found) != 1 or not isinstance(found[0], bytes):
        raise ValueError(f"field {number}: needs one message")
    return found[0]


def _doubles(data: bytes, count: int) -> list[float]:
    """Return the doubles that are fields 1 to count; ValueError where one is not, or twice."""
    found = dict[int, float]()
    for number, value in fields(data):
        if not isinstance(value, float) or not abs(value) < _LARGEST or number in found:
            raise ValueError(f"field {number}: needs a number")
        found[number] = value
    if set(found) != set(range(1, count + 1)):
        raise ValueError(f"needs {count} numbers")
    return [found[number] for number in range(1, count + 1)]
