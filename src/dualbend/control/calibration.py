"""Calibration of a wrist sensor in the cell: what it tells of weights that are known.

A sensor reads C w + d of a wrench w. The tool is weighed in some attitudes, alone and with a known
weight whose centre is at the grip's: the loads of the weight are forces at the grip in all
directions, as the sheet's are. What the readings do not tell, the data sheet does: the estimate is
the most probable one, of C, of the tool's mass and centre, and of what the weight is off the grip.
Its covariance says how well a moment is read, and so below what no control by these readings goes.
Source: Tarantola, Inverse problem theory, SIAM 2005, section 3.2, the linear Gaussian case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dualbend.control.force_torque import CalibrationConfig, ForceTorqueConfig
from dualbend.types import Vector

ACCURACY = 0.005
"""Standard deviation of scale, and of cross-talk per full scale, as data sheets of 1 % have it."""

_TOOL_SHARE, _TOOL_CENTRE_M = 0.01, 1e-3
_ZERO_SHARE = 0.05
_PLACE_M = 1e-4
"""Standard deviations of what is believed: tool's mass and centre, zero per full scale, place."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What is known of a sensor and its tool.

    ``matrix`` (6, 6): from a reading to the wrench; ``mass_kg`` and ``centre_m`` (3,) of the tool,
    in S; ``covariance``: of C row by row, of the tool's mass and first moment (40, 40).
    """

    matrix: Vector
    mass_kg: float
    centre_m: Vector
    covariance: Vector

    def moment_sd_nm(self, wrench: Vector, down: Vector, lever_m: float) -> float:
        """Return the standard deviation of the moment about y that is read at the grip [N m].

        ``wrench`` (6,): true load at the sensor without the tool's weight, in S; ``down`` (3,):
        gravity there [m/s²]; ``lever_m`` from the sensor to the grip.
        """
        to_moment = np.array([0.0, 0.0, lever_m, 0.0, 1.0, 0.0])
        weights = weight_of(down)
        whole = wrench + weights @ np.array([self.mass_kg, *(self.mass_kg * self.centre_m)])
        told = np.concatenate([np.kron(to_moment, whole), -to_moment @ weights])
        return float(np.sqrt(told @ self.covariance @ told))


def weight_of(down: Vector) -> Vector:
    """Return the wrench per mass and per first moment (..., 6, 4) of a body in gravity (..., 3)."""
    found = np.zeros((*down.shape[:-1], 6, 4))
    found[..., :3, 0] = down
    found[..., 3:, 1:] = np.cross(np.eye(3), down[..., np.newaxis, :]).swapaxes(-1, -2)
    return found


def calibrated(
    config: CalibrationConfig,
    sensor: ForceTorqueConfig,
    tool: tuple[float, Vector],
    down: Vector,
    readings: Vector,
) -> Calibration:
    """Return what is known of a sensor after its readings (grips, 2, attitudes, 6), of empty first.

    ``tool``: mass [kg] and centre (3,) [m] as believed before; ``down`` (attitudes, 3): gravity in
    S as the encoders tell it [m/s²]. Each grip has a zero of its own: a sensor drifts.
    """
    grips, _, attitudes, _ = readings.shape
    mass, centre = tool
    full = np.repeat(sensor.full_scale, 3)
    body = np.array([mass, *(mass * np.asarray(centre))])
    held = config.weight_kg * np.array([1.0, sensor.lever_arm_m, 0.0, 0.0])
    zeros, places = 40 + 6 * np.arange(grips), 40 + 6 * grips + 3 * np.arange(grips)
    sd = np.concatenate(
        [
            (ACCURACY * np.divide.outer(full, full)).ravel(),
            [_TOOL_SHARE * mass, *[_TOOL_CENTRE_M * mass] * 3],
            np.tile(_ZERO_SHARE * full, grips),
            np.full(3 * grips, _PLACE_M),
        ]
    )
    precision, told = np.diag(sd**-2.0), np.zeros_like(sd)
    for (grip, loaded, attitude), reading in zip(
        np.ndindex(grips, 2, attitudes), readings.reshape(-1, 6), strict=True
    ):
        weights = weight_of(down[attitude])
        wrench = weights @ (body + loaded * held)
        slope = np.zeros((6, sd.size))
        slope[:, :36] = np.kron(np.eye(6), wrench)
        slope[:, 36:40] = weights
        slope[:, zeros[grip] : zeros[grip] + 6] = np.eye(6)
        slope[:, places[grip] : places[grip] + 3] = loaded * config.weight_kg * weights[:, 1:]
        weighted = slope.T / _variance(sensor, config.readings)
        precision += weighted @ slope
        told += weighted @ (reading - wrench)
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    found = covariance @ told
    mass, *moment = (body + found[36:40]).tolist()
    return Calibration(
        matrix=np.linalg.inv(np.eye(6) + found[:36].reshape(6, 6)),
        mass_kg=mass,
        centre_m=np.array(moment) / mass,
        covariance=covariance[:40, :40],
    )


def uncalibrated(sensor: ForceTorqueConfig, tool: tuple[float, Vector]) -> Calibration:
    """Return what the data sheet alone says of a sensor."""
    nothing = CalibrationConfig(weight_kg=0.0)
    return calibrated(nothing, sensor, tool, np.zeros((0, 3)), np.zeros((1, 2, 0, 6)))


def _variance(sensor: ForceTorqueConfig, readings: int) -> Vector:
    """Return the variance (6,) of a mean of readings: noise and rounding, at least tiny."""
    noise = np.array([sensor.force_noise_n, sensor.torque_noise_nm])
    count = np.array([sensor.force_resolution_n, sensor.torque_resolution_nm])
    least = 1e-5 * np.array(sensor.full_scale)
    each = (noise**2 + count**2 / 12.0) / readings + least**2
    return np.repeat(each, 3)
