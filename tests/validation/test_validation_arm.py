"""The arm's table, the held weight, the identified response: and that errors would be seen."""

import math

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.force_torque import ForceTorqueConfig
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.validation.cases import arm as va
from dualbend.validation.cases import cell as vc

WEIGHT_N = va.PAYLOAD_KG * 9.81


def exact_sensor(**changes: float) -> ForceTorqueConfig:
    none = {
        "force_noise_n": 0.0,
        "torque_noise_nm": 0.0,
        "force_resolution_n": 0.0,
        "torque_resolution_nm": 0.0,
    }
    return ForceTorqueConfig(**{**none, **changes})


def test_table_rows_pass_at_rounding() -> None:
    rows = list(va.table_rows(configurations=3))
    assert len(rows) == 3
    assert all(row.passed and row.error < 1e-12 for row in rows)  # analytic: rounding only


def test_held_weight_is_read_to_rounding_by_an_exact_sensor() -> None:
    force, moment = va.held_weight_errors(exact_sensor(), poses=2)
    assert force < 1e-6  # analytic; the servos leave accelerations below 1e-7 m/s²
    assert moment < 1e-6


def test_resolution_alone_stays_within_half_a_count_an_axis() -> None:
    sensor = exact_sensor(force_resolution_n=0.05, torque_resolution_nm=0.003)
    force, moment = va.held_weight_errors(sensor, poses=3)
    # Analytic bounds: half a count on each of three axes; a moment also gets lever × force.
    assert 0.0 < force <= math.sqrt(3.0) * 0.025
    assert 0.0 < moment <= math.sqrt(3.0) * (0.0015 + 0.12 * 0.025)


def test_wrong_lever_arm_would_be_seen() -> None:
    _, moment = va.held_weight_errors(exact_sensor(lever_arm_m=0.11), poses=4)
    # Analytic: 10 mm times the weight across the approach axis; some pose has most of it across.
    assert 0.5 * 0.01 * WEIGHT_N < moment <= 0.01 * WEIGHT_N


def test_biased_sensor_would_be_seen() -> None:
    sensor = ForceTorqueConfig(
        force_noise_n=0.0,
        torque_noise_nm=0.0,
        force_resolution_n=0.0,
        torque_resolution_nm=0.0,
        force_bias_n=(0.1, 0.0, 0.0),
    )
    force, _ = va.held_weight_errors(sensor, poses=1)
    assert force == pytest.approx(0.1, rel=1e-4)  # analytic


@pytest.mark.parametrize(("frequency_hz", "ratio"), [(2.0, 0.995), (3.0, 0.7), (2.5, 1.4)])
def test_fit_finds_the_response_that_made_the_record(frequency_hz: float, ratio: float) -> None:
    config = CommandResponseConfig(natural_frequency_hz=frequency_hz, damping_ratio=ratio)
    response = CommandResponse(config, 1, 16, period_s=COMMAND_PERIOD_S)
    response.reset([0.3])
    record = [0.3] + [float(response.update(np.array([0.31])).position[-1, 0]) for _ in range(44)]
    omega, found = vc.fit_response(np.array(record), 0.3, COMMAND_PERIOD_S)
    # Analytic: two exact solutions of one equation; the solver's own tolerance.
    assert omega == pytest.approx(2.0 * math.pi * frequency_hz, rel=1e-4)
    assert found == pytest.approx(ratio, rel=1e-4)


def test_end_effector_turns_as_configured() -> None:
    omega, ratio, config = vc.identify_response(2)
    # Dry friction and coupled inertia, which the feed-forward does not know, leave 1-3 %.
    assert omega == pytest.approx(2.0 * math.pi * config.natural_frequency_hz, rel=0.05)
    assert ratio == pytest.approx(config.damping_ratio, rel=0.05)


def test_pushed_grip_gives_way_as_the_joints_stiffness_says() -> None:
    rows = list(vc.stiffness_rows())
    assert len(rows) == 3
    # First order in the deflection: half a millimetre turns the Jacobian by less than 1 %.
    assert all(row.passed and row.error < 0.01 for row in rows)


def test_both_grippers_together_carry_the_sheet() -> None:
    rows = list(vc.weight_rows((0.5,)))
    # Statics at rest, exact but for what still moves.
    assert [row.error < 1e-5 for row in rows] == [True, True]
