"""What a wrist sensor tells while it is calibrated: of the tool, and of a weight in the gripper."""

from __future__ import annotations

import numpy as np

from dualbend.control.calibration import weight_of
from dualbend.control.force_torque import CalibrationConfig, ForceTorqueConfig, Sensor
from dualbend.errors import InputError
from dualbend.imperfection.draws import cut_normal, stream
from dualbend.imperfection.sensor import SensorErrors
from dualbend.types import Side, Vector

_STOP_S, _HOUR_S = 3.0, 3600.0
"""From one attitude to the next, at rest for the readings of a second."""


def weighed(
    config: CalibrationConfig,
    sensor: ForceTorqueConfig,
    errors: SensorErrors,
    arm: tuple[int, Side],
    tool: tuple[float, Vector],
    down: Vector,
) -> Vector:
    """Return the mean readings (grips, 2, attitudes, 6) with the empty gripper and the weight.

    ``arm``: seed and side; ``tool``: true mass [kg] and centre (3,) [m]; ``down`` (attitudes, 3):
    true gravity in S [m/s²]. The sensor is zeroed before the first and drifts from there on. The
    weight lies anew in each grip. InputError where it is too heavy for the sensor.
    """
    mass, centre = tool
    body = np.array([mass, *(mass * np.asarray(centre))])
    rng = stream(*arm, "calibration")
    shape = (config.grips, 2, len(down))
    places = cut_normal(rng, errors.weight_place_spread_m, (config.grips, 3))
    places[:, 0] += sensor.lever_arm_m
    held = np.zeros((config.grips, 2, 4))
    held[:, 1] = config.weight_kg * np.column_stack((np.ones(config.grips), places))
    wrench = np.einsum("aij,glj->glai", weight_of(down), body + held)
    wrench = wrench @ errors.matrix(*arm, sensor).T
    hours = _STOP_S / _HOUR_S
    walk = errors.walk * np.sqrt(hours) * rng.standard_normal((*shape, 6))
    steps = errors.drift_per_h(*arm) * hours + walk
    wrench += np.cumsum(steps.reshape(-1, 6), axis=0).reshape(wrench.shape)
    many = (*shape, config.readings)
    told, clipped = Sensor(sensor, [rng] * int(np.prod(many)), many).read(
        np.repeat(wrench[..., np.newaxis, :], config.readings, axis=-2)
    )
    if clipped.any():
        raise InputError(
            f"sensor.calibration.weight_kg = {config.weight_kg:g}: the sensor is at the end of its "
            f"range, {sensor.force_range_n:g} N and {sensor.torque_range_nm:g} N m: a lighter one"
        )
    return np.asarray(told.mean(axis=-2))
