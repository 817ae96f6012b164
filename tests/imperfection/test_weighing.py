"""A wrist sensor calibrated with a weight: what is then read, and how well that is known."""

from __future__ import annotations

import numpy as np
import pytest

from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.control.calibration import Calibration, calibrated, uncalibrated
from dualbend.control.force_torque import CalibrationConfig, ForceTorqueConfig
from dualbend.errors import InputError
from dualbend.imperfection.config import alone
from dualbend.imperfection.sensor import SensorErrors
from dualbend.imperfection.weighing import weighed
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.types import SIDES, Vector

SENSOR = ForceTorqueConfig()
TYPICAL = alone("typical")["all"].sensor
TOOL = 0.6, np.array([0.05, 0.0, 0.0])
END_FORCE_N, SLOPE_RAD = 33.0, 1.0
"""Of the sheet of ``learned`` in its hold."""


def attitudes(count: int = 12) -> Vector:
    """Return gravity (count, 3) in directions that are even on a sphere [m/s²]."""
    i = np.arange(count) + 0.5
    z, around = 1.0 - 2.0 * i / count, np.pi * (1.0 + 5**0.5) * i
    across = np.sqrt(1.0 - z * z)
    return GRAVITY_M_PER_S2 * np.column_stack((across * np.cos(around), across * np.sin(around), z))


def hold() -> tuple[Vector, Vector]:
    """Return the sheet's wrench at the sensor (6,) and gravity there (3,), in S."""
    turned = np.array([np.cos(SLOPE_RAD), 0.0, np.sin(SLOPE_RAD)])
    force = -END_FORCE_N * turned
    down = GRAVITY_M_PER_S2 * np.array([np.sin(SLOPE_RAD), 0.0, -np.cos(SLOPE_RAD)])
    return np.r_[force, np.cross([SENSOR.lever_arm_m, 0.0, 0.0], force)], down


def known(seed: int, config: CalibrationConfig, errors: SensorErrors = TYPICAL) -> Calibration:
    readings = weighed(config, SENSOR, errors, (seed, "left"), TOOL, attitudes())
    believed = errors.believed_tool(seed, "left", *TOOL)
    return calibrated(config, SENSOR, believed, attitudes(), readings)


def moment_error_nm(seed: int, found: Calibration) -> float:
    """Return what is told of a moment of 0 at the grip [N m], without noise and drift."""
    wrench, down = hold()
    (mass, centre), believed = TOOL, found.mass_kg
    told = (
        found.matrix
        @ TYPICAL.matrix(seed, "left", SENSOR)
        @ (wrench + mass * np.r_[down, np.cross(centre, down)])
    )
    sheet = told - believed * np.r_[down, np.cross(found.centre_m, down)]
    return float(sheet[4] + SENSOR.lever_arm_m * sheet[2])


@pytest.mark.slow
@pytest.mark.parametrize("weight_kg", [1.5, 0.0])
def test_a_moment_is_read_as_well_as_is_predicted(weight_kg: float) -> None:
    """Statistical: rms over 40 drawn sensors, whose relative error is 1/√80."""
    config = CalibrationConfig(weight_kg=weight_kg)
    found = [known(seed, config) for seed in range(40)]
    error = np.sqrt(np.mean([moment_error_nm(i, each) ** 2 for i, each in enumerate(found)]))
    predicted = found[0].moment_sd_nm(*hold(), SENSOR.lever_arm_m)
    assert error == pytest.approx(predicted, rel=0.3)
    if weight_kg:
        assert predicted < 2.5e-3


def test_the_data_sheet_alone_tells_a_moment_to_tens_of_millinewton_metres() -> None:
    """And the tool's weight, which is no force at the grip, takes a third of it away."""
    sheet = uncalibrated(SENSOR, TOOL).moment_sd_nm(*hold(), SENSOR.lever_arm_m)
    tool = known(1, CalibrationConfig(weight_kg=0.0)).moment_sd_nm(*hold(), SENSOR.lever_arm_m)
    assert 0.035 < sheet < 0.05
    assert 0.5 * sheet < tool < 0.8 * sheet


def test_without_errors_the_readings_stay_as_they_are() -> None:
    exact = ForceTorqueConfig(
        force_noise_n=0.0, torque_noise_nm=0.0, force_resolution_n=0.0, torque_resolution_nm=0.0
    )
    config = CalibrationConfig()
    readings = weighed(config, exact, SensorErrors(), (1, "left"), TOOL, attitudes())
    found = calibrated(config, exact, TOOL, attitudes(), readings)
    assert found.matrix == pytest.approx(np.eye(6), abs=1e-9)
    assert found.mass_kg == pytest.approx(TOOL[0])


def test_a_weight_beyond_the_sensor_is_refused() -> None:
    with pytest.raises(InputError, match=r"weight_kg = 6: .* end of its range, 65 N and 5 N m"):
        known(1, CalibrationConfig(weight_kg=6.0))


def test_a_weight_beyond_the_payload_is_refused() -> None:
    with pytest.raises(InputError, match=r"calibration.weight_kg = 2.00 kg are above its payload"):
        make_run(load_scenario("learned", ["sensor.calibration.weight_kg=2.0"]))


def test_both_arms_of_a_cell_are_calibrated_by_where_their_encoders_say_they_are() -> None:
    """Joint zeros and bases of the typical cell turn gravity by some tenths of a milliradian."""
    cell = make_run(load_scenario("learned")).cell
    for side in SIDES:
        truth = TYPICAL.matrix(cell.scenario.seed, side, SENSOR)
        left = cell.calibrations[side].matrix @ truth - np.eye(6)
        force = np.array([-0.5, 0.0, -0.8])
        wrench = END_FORCE_N * np.r_[force, np.cross([SENSOR.lever_arm_m, 0.0, 0.0], force)]
        at_grip = (left @ wrench)[4] + SENSOR.lever_arm_m * (left @ wrench)[2]
        before = ((truth - np.eye(6)) @ wrench)[[2, 4]] @ [SENSOR.lever_arm_m, 1.0]
        assert abs(at_grip) < 6e-3
        assert abs(at_grip) < 0.5 * abs(before)
