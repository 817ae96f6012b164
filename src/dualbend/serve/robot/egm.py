"""ABB EGM: the robot sends EgmRobot to the user's controller and waits for an EgmSensor."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from dualbend.control.alter import angles_of, turn
from dualbend.serve.port import ArmState
from dualbend.serve.robot.protobuf import double, doubles, fields, message, whole
from dualbend.serve.robot.udp import UdpRobot
from dualbend.types import Side, Vector

_DATA, _MOTORS_ON, _MCI_RUNNING, _RAPID_RUNNING = 2, 1, 3, 2
_MOST_LATE = 1000
"""Packets that are taken off the socket before a question: who floods it is not waited for."""
_MOST_OFF = 1e-3
"""Of a quaternion's length from 1."""


class EgmRobot(UdpRobot):
    """The robot's end of EGM position guidance in poses.

    An answer carries its sender's own number, so it is the first packet after a question that
    answers it: what came before is taken off the socket first.
    """

    protocol = "egm"
    units = (
        "ABB EGM: EgmSensor with planned.cartesian, the pose to go to, pos in mm and orient in the "
        "arm's bending frame; planned of EgmRobot is the nominal pose, measuredForce the sensor's "
        "reading"
    )
    faults = ("malformed", "late")

    def __init__(self, side: Side, address: str, port: int, period_s: float) -> None:
        super().__init__(side, address, port)
        self._period_s = period_s
        self._nominal: Vector = np.zeros(6)

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""
        with suppress(OSError):  # nothing is left, or nobody is there
            for _ in range(_MOST_LATE):
                self._socket.recv(1)
                self._count["late"] += 1
        super().ask(state)

    def encode(self, state: ArmState) -> bytes:
        """Return the EgmRobot that tells the state of a cycle."""
        self._nominal = state.nominal
        return encode(state, state.cycle * self._period_s)

    def decode(self, data: bytes) -> Vector | str:
        """Return the deviation (6,) of the pose that an EgmSensor asks for from the nominal one."""
        found = decode(data)
        if found is None:
            return "malformed"
        place_m, axes = found
        turned = angles_of(axes @ turn(self._nominal[3:]).T)
        return np.concatenate((place_m - self._nominal[:3], turned))


def encode(state: ArmState, time_s: float) -> bytes:
    """Return EgmRobot: header, feedBack, planned, states, measuredForce."""
    clock = message(4, whole(1, int(time_s)), whole(2, round(1e6 * (time_s % 1.0))))
    joints = message(1, *(double(1, angle) for angle in state.joints.tolist()))
    parts = [
        message(1, whole(1, state.cycle), whole(2, round(1e3 * time_s)), whole(3, _DATA)),
        message(2, joints, message(2, _pose(state.measured)), clock),
        message(3, message(2, _pose(state.nominal)), clock),
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


def decode(data: bytes) -> tuple[Vector, Vector] | None:
    """Return place (3,) [m] and axes (3, 3) of an EgmSensor; None: it asks for no pose."""
    try:
        planned = _one(data, 2)
        pose = _one(planned, 2)
        place, orient = _doubles(_one(pose, 1), 3), _doubles(_one(pose, 2), 4)
    except ValueError:
        return None
    length = math.sqrt(sum(u * u for u in orient))
    if not abs(length - 1.0) <= _MOST_OFF:
        return None
    return 1e-3 * np.array(place), _axes([u / length for u in orient])


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
        if not isinstance(value, float) or not abs(value) < 1e9 or number in found:
            raise ValueError(f"field {number}: needs a number")
        found[number] = value
    if set(found) != set(range(1, count + 1)):
        raise ValueError(f"needs {count} numbers")
    return [found[number] for number in range(1, count + 1)]


def quaternion_of(r: Vector) -> list[float]:
    """Return u0, u1, u2, u3 of axes (3, 3), u0 ≥ 0."""
    squares = [
        1.0 + r[0, 0] + r[1, 1] + r[2, 2],
        1.0 + r[0, 0] - r[1, 1] - r[2, 2],
        1.0 - r[0, 0] + r[1, 1] - r[2, 2],
        1.0 - r[0, 0] - r[1, 1] + r[2, 2],
    ]
    a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    d, e, f = r[1, 0] + r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2]
    # Of the four forms that of the largest element, which loses no digits.
    forms = ((None, a, b, c), (a, None, d, e), (b, d, None, f), (c, e, f, None))
    largest = int(np.argmax(squares))
    root = math.sqrt(squares[largest])
    u = [0.5 * root if part is None else 0.5 * float(part) / root for part in forms[largest]]
    return u if u[0] >= 0.0 else [-part for part in u]


def _axes(u: list[float]) -> Vector:
    """Return the axes (3, 3) of a unit quaternion."""
    w, x, y, z = u
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
