"""Rotations as the protocols write them, and whole poses as deviations."""

from __future__ import annotations

import math

import numpy as np

from dualbend.control.alter import angles_of, turn
from dualbend.types import Vector


def deviation_from(origin: Vector, place_m: Vector, axes: Vector) -> Vector:
    """Return the deviation (6,) that leads from a pose (6,) to a place (3,) and axes (3, 3)."""
    turned = angles_of(axes @ turn(origin[3:]).T)
    return np.concatenate((place_m - origin[:3], turned))


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


def axes_of(u: list[float]) -> Vector:
    """Return the axes (3, 3) of a unit quaternion."""
    w, x, y, z = u
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def rotation_vector_of(r: Vector) -> list[float]:
    """Return the rotation vector (3,) [rad] of axes (3, 3): axis times angle, at most π."""
    w, *along = quaternion_of(r)
    length = math.hypot(*along)
    scale = 2.0 * math.atan2(length, w) / length if length else 2.0
    return [scale * part for part in along]


def axes_about(vector: Vector) -> Vector:
    """Return the axes (3, 3) of a rotation vector (3,) [rad]."""
    angle = math.hypot(*vector.tolist())
    scale = math.sin(0.5 * angle) / angle if angle else 0.5
    return axes_of([math.cos(0.5 * angle), *(scale * vector).tolist()])
