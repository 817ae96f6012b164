"""The sensor chain: errors of the sensor, the tool's weight, the lever arm."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.filters import IirConfig, LowPass, LowPassConfig, NoFilterConfig
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.errors import InputError
from dualbend.types import Vector

G = 9.81
TOOL_MASS, TOOL_COM = 1.3, np.array([0.01, -0.02, 0.05])
IDEAL = {
    "force_noise_n": 0.0,
    "torque_noise_nm": 0.0,
    "force_resolution_n": 0.0,
    "torque_resolution_nm": 0.0,
}
VECTOR = arrays(np.float64, 3, elements=st.floats(-50, 50))
# The sensor's z is the approach axis x_G.
ALONG_Z = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
SKEWED = Rotation.from_euler("xyz", [0.3, -0.8, 1.9]).as_matrix()


def make_chain(
    rotation_grip_sensor: ArrayLike = ALONG_Z,
    low_pass: LowPassConfig | None = None,
    seed: int = 0,
    **settings: float,
) -> WrenchChain:
    config = ForceTorqueConfig(**settings)
    return WrenchChain(
        Sensor(config, np.random.default_rng(seed)),
        ToolGravityCompensation(TOOL_MASS, TOOL_COM),
        LowPass(low_pass or NoFilterConfig(), period_s=COMMAND_PERIOD_S),
        rotation_grip_sensor,
    )


def held_weight(
    mass: float, offset_grip: Vector, r_ws: Vector, r_gs: Vector, lever_m: float = 0.12
) -> tuple[Vector, Vector, Vector]:
    """Return the true wrench in S; force and moment expected in G, by statics in the world."""
    r_wg = r_ws @ r_gs.T
    grip = r_wg @ [lever_m, 0.0, 0.0]
    down = np.array([0.0, 0.0, -G])
    points = [r_ws @ TOOL_COM, grip + r_wg @ offset_grip]
    forces = [TOOL_MASS * down, mass * down]
    moment = sum(np.cross(p, f) for p, f in zip(points, forces, strict=True))
    load = r_wg.T @ forces[1]
    true = np.concatenate([r_ws.T @ sum(forces), r_ws.T @ moment])
    return true, load, np.cross(offset_grip, load)


def poses(count: int, seed: int) -> Vector:
    return Rotation.random(count, rng=np.random.default_rng(seed)).as_matrix()


@pytest.mark.parametrize("r_gs", [ALONG_Z, SKEWED])
def test_known_weight_in_any_pose_ideal_sensor(r_gs: Vector) -> None:
    chain = make_chain(r_gs, **IDEAL)
    for r_ws in poses(10, 11):
        wrench, load, moment = held_weight(0.8, np.array([0.03, 0.0, -0.01]), r_ws, r_gs)
        sample = chain.update(wrench, r_ws)
        # Analytic: rounding only.
        assert np.allclose(sample.raw.force_n, load, atol=1e-9)
        assert np.allclose(sample.raw.torque_nm, moment, atol=1e-9)
        assert np.array_equal(sample.sensor.components, wrench)
        assert not sample.clipped.any()


def grip_errors(chain: WrenchChain, r_gs: Vector, count: int, repeats: int, seed: int) -> Vector:
    """Return the largest force and torque error over poses, each the mean of some readings."""
    worst = np.zeros(2)
    for r_ws in poses(count, seed):
        wrench, load, moment = held_weight(0.8, np.zeros(3), r_ws, r_gs)
        samples = [chain.update(wrench, r_ws) for _ in range(repeats)]
        means = [
            np.mean([s.raw.force_n for s in samples], axis=0) - load,
            np.mean([s.raw.torque_nm for s in samples], axis=0) - moment,
        ]
        worst = np.maximum(worst, [np.abs(m).max() for m in means])
    return worst


def test_known_weight_with_counts_of_the_default_sensor_misses_20_mn_by_rounding_alone() -> None:
    chain = make_chain(force_noise_n=0.0, torque_noise_nm=0.0)
    force, torque = grip_errors(chain, ALONG_Z, 200, 1, seed=12)
    # Analytic bound: half a count per axis; moment: half a count + lever × half a force count.
    assert force <= 0.025 + 1e-12
    assert torque <= 0.0015 + 0.12 * 0.025 + 1e-12
    # The bound is reached over poses (n = 200), so 0.02 N and 0.002 N m cannot be promised.
    assert force > 0.024
    assert torque > 0.004


def test_averaging_does_not_help_without_noise() -> None:
    quiet = {"force_noise_n": 0.0, "torque_noise_nm": 0.0}
    once = grip_errors(make_chain(**quiet), ALONG_Z, 5, 1, seed=13)
    # Analytic: the same rounding every time.
    assert np.allclose(grip_errors(make_chain(**quiet), ALONG_Z, 5, 50, seed=13), once, atol=1e-12)


def test_known_weight_within_20_mn_from_finer_counts() -> None:
    # Analytic: 0.04/2 N, and 0.001/2 + 0.12 · 0.02/2 = 0.0017 N m: the acceptance in one reading.
    chain = make_chain(
        force_noise_n=0.0, torque_noise_nm=0.0, force_resolution_n=0.02, torque_resolution_nm=0.001
    )
    force, torque = grip_errors(chain, ALONG_Z, 200, 1, seed=14)
    assert force <= 0.02
    assert torque <= 0.002


def test_known_weight_within_20_mn_from_the_default_sensor_by_averaging_its_noise() -> None:
    # Statistical: noise of one count dithers the rounding away; the mean of n = 400 readings has
    # standard errors of 0.0026 N and 0.00035 N m, so both bounds are beyond 5 sigma.
    force, torque = grip_errors(make_chain(), ALONG_Z, 10, 400, seed=15)
    assert force < 0.02
    assert torque < 0.002


@given(VECTOR, arrays(np.float64, 3, elements=st.floats(-4.9, 4.9)))
def test_rounding_is_at_most_half_a_count_to_a_whole_count(force: Vector, torque: Vector) -> None:
    sensor = Sensor(
        ForceTorqueConfig(force_noise_n=0.0, torque_noise_nm=0.0), np.random.default_rng(0)
    )
    wrench, count = np.concatenate([force, torque]), np.repeat([0.05, 0.003], 3)
    reading, _ = sensor.read(wrench)
    # Analytic, up to rounding of the division.
    assert (np.abs(reading - wrench) <= count / 2 + 1e-12).all()
    assert np.allclose(reading / count, np.round(reading / count), atol=1e-9)


@pytest.mark.parametrize("channel", ["force", "torque"])
def test_one_kind_of_channel_can_be_rounded_alone(channel: str) -> None:
    off = {"force_noise_n": 0.0, "torque_noise_nm": 0.0}
    off["torque_resolution_nm" if channel == "force" else "force_resolution_n"] = 0.0
    sensor = Sensor(ForceTorqueConfig(**off), np.random.default_rng(0))
    reading, _ = sensor.read(np.full(6, 1.0171))
    # Analytic: 1.0171 is nearest to 20 · 0.05 N and to 339 · 0.003 N m.
    force, torque = (1.0, 1.0171) if channel == "force" else (1.0171, 1.017)
    assert np.allclose(reading, np.repeat([force, torque], 3), atol=1e-12)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_axis_saturates_at_full_scale_and_says_so(axis: int, sign: float) -> None:
    sensor = Sensor(ForceTorqueConfig(**IDEAL), np.random.default_rng(0))
    limit = 65.0 if axis < 3 else 5.0
    wrench = np.zeros(6)
    for value, expected, saturated in (
        (limit, limit, False),
        (limit * 1.001, limit, True),
    ):
        wrench[axis] = sign * value
        reading, clipped = sensor.read(wrench)
        # Exact.
        assert clipped.tolist() == [saturated and i == axis for i in range(6)]
        assert reading[axis] == sign * expected


def test_full_scale_is_a_whole_number_of_counts() -> None:
    config = ForceTorqueConfig(force_noise_n=0.0, torque_noise_nm=0.0)
    reading, _ = Sensor(config, np.random.default_rng(0)).read(np.full(6, 99.0))
    # Analytic: floor(5 / 0.003) = 1666 counts.
    assert np.allclose(reading[3:], 1666 * 0.003, atol=1e-12)


def test_noise_and_bias_have_the_configured_moments() -> None:
    n = 4000
    config = ForceTorqueConfig(
        **IDEAL | {"force_noise_n": 0.05, "torque_noise_nm": 0.003},
        force_bias_n=(0.5, -0.4, 0.3),
        torque_bias_nm=(0.02, 0.0, -0.05),
    )
    sensor = Sensor(config, np.random.default_rng(21))
    values = np.array([sensor.read(np.zeros(6))[0] for _ in range(n)])
    sigma = np.repeat([0.05, 0.003], 3)
    bias = np.array([0.5, -0.4, 0.3, 0.02, 0.0, -0.05])
    # Statistical, n = 4000: five standard errors of a mean and of a standard deviation.
    assert np.all(np.abs(values.mean(axis=0) - bias) < 5 * sigma / math.sqrt(n))
    assert np.all(np.abs(values.std(axis=0) / sigma - 1) < 5 / math.sqrt(2 * n))
    # Statistical, n = 4000: channels are independent.
    assert np.abs(np.corrcoef(values.T) - np.eye(6)).max() < 5 / math.sqrt(n)


def test_noise_is_made_again_from_its_seed_and_not_drawn_when_off() -> None:
    one, two = (make_chain(seed=7) for _ in range(2))
    zero = np.zeros(6)
    for _ in range(3):
        first, second = (c.update(zero, np.eye(3)) for c in (one, two))
        # Exact.
        assert np.array_equal(first.raw.components, second.raw.components)
    rng = np.random.default_rng(7)
    Sensor(ForceTorqueConfig(**IDEAL), rng).read(zero)
    assert rng.standard_normal() == np.random.default_rng(7).standard_normal()


def test_force_at_the_grip_makes_no_moment_there() -> None:
    chain = make_chain(**IDEAL)
    weight = ToolGravityCompensation(TOOL_MASS, TOOL_COM).wrench(np.eye(3))
    force = np.array([3.0, -4.0, 5.0])
    # Lever along the sensor's z, which is x_G: the sensor feels r × F.
    torque = np.cross([0.0, 0.0, 0.12], force)
    sample = chain.update(np.concatenate([force, torque]) + weight, np.eye(3))
    # Analytic.
    assert np.allclose(sample.raw.torque_nm, 0.0, atol=1e-14)
    assert np.allclose(sample.raw.force_n, ALONG_Z @ force, atol=1e-14)


def test_a_calibration_takes_back_what_the_sensor_makes_of_a_wrench() -> None:
    """The tool's weight is taken off after it: the sensor errs on both."""
    wrong = np.eye(6) + 0.01 * np.random.default_rng(3).standard_normal((6, 6))
    wrench = np.array([3.0, -20.0, 8.0, 0.4, -0.2, 1.0])
    tool = ToolGravityCompensation(TOOL_MASS, TOOL_COM)
    read = wrong @ (wrench + tool.wrench(SKEWED))
    found = [
        WrenchChain(
            Sensor(ForceTorqueConfig(**IDEAL), np.random.default_rng(0)),
            tool,
            LowPass(NoFilterConfig(), period_s=COMMAND_PERIOD_S),
            np.eye(3),
            matrix,
        )
        .update(read, SKEWED)
        .raw.components
        for matrix in (None, np.linalg.inv(wrong))
    ]
    lever = np.array([ForceTorqueConfig().lever_arm_m, 0.0, 0.0])
    expected = np.r_[wrench[:3], wrench[3:] - np.cross(lever, wrench[:3])]
    assert found[1] == pytest.approx(expected, abs=1e-9)
    assert np.abs(found[0] - expected).max() > 0.05


def test_tool_weight_points_down_at_its_centre_of_mass() -> None:
    tool = ToolGravityCompensation(TOOL_MASS, TOOL_COM)
    for r_ws in poses(5, 3):
        weight = tool.wrench(r_ws)
        # Analytic: m g along −z of the world, at the centre of mass.
        assert np.allclose(r_ws @ weight[:3], [0, 0, -TOOL_MASS * G], atol=1e-13)
        assert np.allclose(weight[3:], np.cross(TOOL_COM, weight[:3]), atol=1e-14)


def test_first_reading_starts_no_transient() -> None:
    for load in (16.0, -5.0):
        chain = make_chain(low_pass=IirConfig(), **IDEAL)
        for _ in range(5):
            sample = chain.update(np.repeat([load, 0.1], 3), np.eye(3))
            # Analytic: a constant passes a filter of unit DC gain unchanged.
            assert np.allclose(sample.filtered.components, sample.raw.components, atol=1e-12)
    step = chain.update(np.repeat([50.0, 0.0], 3), np.eye(3))
    assert not np.allclose(step.filtered.force_n, step.raw.force_n, atol=1.0)


@pytest.mark.parametrize(
    ("latency_ms", "step_s", "steps"),
    [(0.0, 0.001, 0), (7.0, 0.875e-3, 8), (10.0, 0.00175, 6), (2.5, 0.001, 3), (0.4, 0.001, 0)],
)
def test_latency_is_the_nearest_whole_number_of_steps(
    latency_ms: float, step_s: float, steps: int
) -> None:
    # Analytic: 10 / 1.75 = 5.71; 2.5 is rounded up.
    assert ForceTorqueConfig(latency_ms=latency_ms).latency_steps(step_s) == steps


def test_another_number_of_noise_sources_than_sensors_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"rng: 1 sources.*\(2, 3\): need 6"):
        Sensor(ForceTorqueConfig(), rng, (2, 3))


@pytest.mark.parametrize("matrix", [np.eye(2), 2 * np.eye(3), np.diag([1.0, 1.0, -1.0])])
def test_what_is_no_rotation_is_refused(matrix: Vector) -> None:
    with pytest.raises(InputError, match="rotation_grip_sensor"):
        make_chain(matrix)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("force_noise_n", -0.1),
        ("torque_resolution_nm", -1.0),
        ("force_range_n", 0.0),
        ("latency_ms", -1.0),
        ("lever_arm_m", -0.1),
        ("force_bias_n", [1.0, 2.0]),
        ("noise", 0.1),
    ],
)
def test_wrong_settings_are_refused_by_name(key: str, value: object) -> None:
    with pytest.raises(msgspec.ValidationError, match=key):
        msgspec.convert({key: value}, ForceTorqueConfig)


def test_range_below_resolution_is_refused() -> None:
    with pytest.raises(
        msgspec.ValidationError, match=r"torque_range_nm = 0\.001.*resolution, 0\.003"
    ):
        msgspec.convert({"torque_range_nm": 0.001}, ForceTorqueConfig)
