"""Which sample of which cycle a controller sees, and how a deviation goes back."""

import math

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.control.compliance.admittance import Admittance, NoComplianceConfig
from dualbend.control.compliance.object import ObjectAdmittance, ObjectComplianceConfig
from dualbend.control.compliance.predictor import ResponseModel
from dualbend.control.controller import ControlledPath, ControllerFailed, Observation
from dualbend.control.filters import FirConfig, IirConfig, LowPass, NoFilterConfig
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.control.wrist import WristSensors
from dualbend.types import PlanarPose, Vector

T = COMMAND_PERIOD_S


@pytest.mark.parametrize("age_steps", [1, 6, 15, 16, 17, 31, 32, 40])
@pytest.mark.parametrize("delay_cycles", [0, 2])
def test_the_models_reading_is_as_old_as_the_sensors(age_steps: int, delay_cycles: int) -> None:
    """Of the response to ramps, the sample so many physics steps before the cycle begins."""
    steps, cycles = 16, 8
    config = CommandResponseConfig(natural_frequency_hz=3.0, damping_ratio=0.7)
    model = ResponseModel(
        response=config,
        low_pass=NoFilterConfig(),
        delay_cycles=delay_cycles,
        steps=steps,
        age_steps=age_steps,
        channels=2,
        period_s=T,
    )
    rest = np.array([0.2, -0.1])
    model.reset(rest)
    response = CommandResponse(config, 2, steps, period_s=T)
    response.reset(rest)
    setpoints = rest + np.random.default_rng(2).normal(size=(cycles, 2))
    late = np.concatenate((np.tile(rest, (delay_cycles, 1)), setpoints))[:cycles]
    answers = [response.update(each) for each in late]
    position = np.concatenate([[rest], *(answer.position for answer in answers)])
    acceleration = np.concatenate([np.zeros((1, 2)), *(answer.acceleration for answer in answers)])
    for n, setpoint in enumerate(setpoints):
        seen = max(n * steps - age_steps, 0)
        found = model.read()
        # Exact: the same samples.
        np.testing.assert_array_equal(found[0], position[seen])
        np.testing.assert_array_equal(found[1], acceleration[seen])
        model.send(setpoint)


@pytest.mark.parametrize("speed", [1e-3, 0.02])
def test_a_deviation_goes_back_at_a_constant_speed_and_all_of_it_in_the_same_time(
    speed: float,
) -> None:
    config = ObjectComplianceConfig(deadband_n=0.0, limit_m=4e-3, limit_rad=0.02)
    admittance = ObjectAdmittance(config, np.array([0.0, 1.0]), np.ones((2, 3)), period_s=T)
    admittance.update(np.array([9.0, -9.0, 9.0]), 0.0)
    start = admittance.deviation
    np.testing.assert_array_equal(start, [4e-3, -4e-3, 0.02])
    cycles = math.ceil(4e-3 / (speed * T))
    for n in range(1, cycles + 2):
        admittance.relax(speed)
        # Analytic: linear in time, 4 mm at the given speed, the turn from its bound meanwhile.
        left = max(0.0, 1.0 - n * speed * T / 4e-3)
        np.testing.assert_allclose(admittance.deviation, left * start, atol=1e-16)


def observe(wrist: WristSensors, wrench: Vector) -> Observation:
    pose = PlanarPose(np.zeros((2, 3)))
    return Observation.of(
        wrist.read(wrench, np.stack([np.eye(3)] * 2)),
        time_s=0.0,
        phase="bend",
        joints_rad=np.zeros(12),
        measured=pose,
        nominal=pose,
    )


def test_raw_is_this_cycles_wrench_and_filtered_the_mean_of_two() -> None:
    config = ForceTorqueConfig(
        force_noise_n=0.0,
        torque_noise_nm=0.0,
        force_resolution_n=0.0,
        torque_resolution_nm=0.0,
        lever_arm_m=0.0,
    )
    chain = WrenchChain(
        Sensor(config, [np.random.default_rng(0)], (1,)),
        ToolGravityCompensation([0.0], np.zeros((1, 3))),
        LowPass(FirConfig(taps=2, window="boxcar"), period_s=T, shape=(1,)),
        np.eye(3),
    )
    wrist = WristSensors(chain, [1])
    first, second = np.arange(12.0).reshape(2, 6) / 8, np.full((2, 6), -0.5)
    observe(wrist, first)
    seen = observe(wrist, second)
    # Analytic: two taps are the mean of two samples; the left arm has no sensor.
    np.testing.assert_allclose(seen.raw.components[1], second[1], rtol=1e-14)
    np.testing.assert_allclose(seen.filtered.components[1], (first[1] + second[1]) / 2, rtol=1e-14)
    assert np.isnan(seen.raw.components[0]).all()
    assert np.isnan(seen.filtered.components[0]).all()


def test_a_step_as_long_as_the_period_is_one_step() -> None:
    assert steps_per_cycle(T, T) == 1
    for step_s in (1.5 * T, 3.0 * T, 1e6 * T):
        with pytest.raises(ValueError, match=r"\(1 steps\)"):
            steps_per_cycle(step_s, T)


def test_without_a_compliance_nothing_moves_whatever_the_load() -> None:
    config = NoComplianceConfig()
    assert (config.x, config.rotation, config.reference, config.predictor) == (None,) * 4
    assert (config.limit_x_m, config.limit_rotation_rad) == (0.0, 0.0)
    assert (config.tare, config.beyond, config.units) == (False, "", "paper")
    admittance = Admittance(config, period_s=T)
    for load in ([1e3, -1e3], [-7.0, 0.2]):
        assert not admittance.update(np.array(load)).any()
        assert not admittance.saturated.any()


def test_the_defaults_are_what_their_sources_say() -> None:
    response, sensor = CommandResponseConfig(), ForceTorqueConfig()
    omega = 2.0 * math.pi * response.natural_frequency_hz
    # The paper, section V: 2 Hz, 2ξω_n = 25 rad/s (to its two digits).
    assert omega == pytest.approx(4.0 * math.pi)
    assert 2.0 * response.damping_ratio * omega == pytest.approx(25.0, abs=0.05)
    # ATI Gamma SI-65-5: full scale, and counts of 1/20 N and 1/333 N m.
    assert (sensor.force_range_n, sensor.torque_range_nm) == (65.0, 5.0)
    assert 1.0 / sensor.force_resolution_n == pytest.approx(20.0)
    assert 1.0 / sensor.torque_resolution_nm == pytest.approx(333.33, rel=1e-3)
    # A load beyond it reads as the last whole count: 1300 of force, 1666 of torque.
    reading, clipped = Sensor(sensor, np.random.default_rng(0)).read(np.full(6, 100.0))
    np.testing.assert_allclose(reading, [65.0] * 3 + [4.998] * 3, rtol=1e-12)
    assert clipped.all()
    # Noise of one count rms.
    assert sensor.force_noise_n == sensor.force_resolution_n
    assert sensor.torque_noise_nm == sensor.torque_resolution_nm
    # The filters' module: 3 taps delay by a cycle, a Butterworth of order 2 by 16.4 ms.
    delays = [
        LowPass(config, period_s=T).group_delay_s(0.0) for config in (FirConfig(), IirConfig())
    ]
    assert delays == pytest.approx([0.028, 0.0164], abs=5e-5)


def test_a_controller_that_fails_is_told_with_the_line_that_failed() -> None:
    def careless(_: Observation) -> Vector:
        return np.zeros(12) / nothing()

    def singular(_: Observation) -> Vector:
        return np.linalg.inv(np.zeros((2, 2)))

    def nothing() -> float:
        raise KeyError("no such gain")

    line = nothing.__code__.co_firstlineno + 1
    config = ForceTorqueConfig(force_noise_n=0.0, torque_noise_nm=0.0)
    chain = WrenchChain(
        Sensor(config, [np.random.default_rng(0)], (1,)),
        ToolGravityCompensation([0.0], np.zeros((1, 3))),
        LowPass(NoFilterConfig(), period_s=T, shape=(1,)),
        np.eye(3),
    )
    observation = observe(WristSensors(chain, [0]), np.zeros((2, 6)))
    path = ControlledPath(careless, delay_cycles=(0, 0), mode="world")
    # Exact: the innermost frame, where it was raised.
    expected = rf"KeyError: 'no such gain' \(test_time_in_the_loop\.py:{line}\)"
    with pytest.raises(ControllerFailed, match=expected):
        path.command(observation)
    with pytest.raises(ControllerFailed, match=r"Singular matrix \(_?linalg\.py:\d+\)"):
        ControlledPath(singular, delay_cycles=(0, 0), mode="world").command(observation)
