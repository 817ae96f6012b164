"""One sensing arm's wrench as the controller reads it, in the bending frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dualbend.control.force_torque import WrenchSample
from dualbend.types import Vector


def horizontal_force(force_grip: Vector, alpha_rad: float) -> float:
    """Return the force along x_B [N]: F_x cos α + F_z sin α, from the force (3,) in G [N]."""
    return float(force_grip[0]) * math.cos(alpha_rad) + float(force_grip[2]) * math.sin(alpha_rad)


def vertical_force(force_grip: Vector, alpha_rad: float) -> float:
    """Return the force along z_B [N]: F_z cos α − F_x sin α, from the force (3,) in G [N]."""
    return float(force_grip[2]) * math.cos(alpha_rad) - float(force_grip[0]) * math.sin(alpha_rad)


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One sensing arm's cycle: the sample and its forces along x_B and z_B [N]."""

    sample: WrenchSample
    force_x_n: float
    filtered_force_x_n: float
    filtered_force_z_n: float

    @property
    def moment_y_nm(self) -> float:
        """Moment about the bending axis at the grip, before the low-pass."""
        return float(self.sample.torque_grip_nm[1])

    @property
    def filtered_moment_y_nm(self) -> float:
        """Moment about the bending axis at the grip, after the low-pass."""
        return float(self.sample.filtered_torque_grip_nm[1])


def net_wrench(
    readings: Mapping[int, Reading], half_distance_m: float, alpha_rad: float, yaw_rad: float
) -> Vector:
    """Return net force x, y, z [N] in the world and moment about the vertical [N m] (4,).

    Of both grips on the arms, filtered; the moment is about the vertical through the object's
    place, which lies midway between the grips.
    """
    total = np.zeros(4)
    for i, reading in readings.items():
        force = reading.sample.filtered_force_grip_n
        along, up = horizontal_force(force, alpha_rad), vertical_force(force, alpha_rad)
        # A moment turns from G to B as a force does.
        turn = vertical_force(reading.sample.filtered_torque_grip_nm, alpha_rad)
        fy = float(force[1])
        # The right arm's bending frame is the left one's turned by π.
        sign = 1.0 if i == 0 else -1.0
        total += sign * along, sign * fy, up, turn - half_distance_m * fy
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    x, y = total[:2].tolist()
    total[:2] = c * x - s * y, s * x + c * y
    return total
