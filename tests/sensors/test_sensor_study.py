"""The study of what a cell may know of its sensors: what two arms tell of each other."""

import numpy as np
import pytest

from dualbend.control.calibration import uncalibrated
from dualbend.control.force_torque import ForceTorqueConfig
from sensors.known import balance_sd_nm, load_at

SENSOR = ForceTorqueConfig()
PATH = np.linspace(0.1, 1.0, 10), np.linspace(28.0, 33.0, 10), np.linspace(0.4, 0.34, 10)


def test_both_arms_of_a_sheet_tell_half_of_an_error_at_best() -> None:
    """Errors that are alike on both arms balance: 1/√2 of it stays; forces tell a part of that."""
    wrench, _ = load_at(PATH[0][-1], PATH[1][-1], SENSOR.lever_arm_m)
    # Of a tool that is known: none.
    sheet = uncalibrated(SENSOR, (1e-9, np.zeros(3)))
    alone = sheet.moment_sd_nm(wrench, np.zeros(3), SENSOR.lever_arm_m)
    assert 0.4 * alone < balance_sd_nm(SENSOR, PATH) < alone / np.sqrt(2.0)


def test_a_force_at_the_grip_has_no_moment_there() -> None:
    wrench, down = load_at(0.7, 30.0, SENSOR.lever_arm_m)
    assert wrench[4] + SENSOR.lever_arm_m * wrench[2] == pytest.approx(0.0)
    assert np.linalg.norm(wrench[:3]) == pytest.approx(30.0)
    assert np.linalg.norm(down) == pytest.approx(9.81)
