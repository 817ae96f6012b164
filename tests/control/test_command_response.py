"""The command response: exact against theory, the same in one step or many."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.errors import InputError
from dualbend.types import Vector

T = COMMAND_PERIOD_S
DAMPING = [0.3, 0.995, 1.0, 1.7]


def make(
    damping_ratio: float = 0.9, frequency_hz: float = 3.0, joints: int = 1, steps: int = 16
) -> CommandResponse:
    config = CommandResponseConfig(natural_frequency_hz=frequency_hz, damping_ratio=damping_ratio)
    return CommandResponse(config, joints, steps, period_s=T)


def run(response: CommandResponse, setpoints: ArrayLike) -> tuple[Vector, ...]:
    """Return position, velocity, acceleration over all cycles, each (cycles · steps, joints)."""
    cycles = [response.update(np.atleast_1d(u)) for u in np.asarray(setpoints)]
    return tuple(
        np.concatenate([getattr(c, name) for c in cycles])
        for name in ("position", "velocity", "acceleration")
    )


def step_response(time: Vector, omega: float, ratio: float) -> Vector:
    """Return the closed form of the unit step response for any damping."""
    decay = ratio * omega
    if ratio == 1.0:
        return 1 - np.exp(-decay * time) * (1 + omega * time)
    root = omega * np.emath.sqrt(1 - ratio**2)
    return (
        1 - np.exp(-decay * time) * (np.cos(root * time) + decay / root * np.sin(root * time))
    ).real


@pytest.mark.parametrize("ratio", DAMPING)
def test_free_response_from_a_step_of_rest_is_the_closed_form(ratio: float) -> None:
    response = make(ratio)
    response.reset(0.0)
    response._state[2] = 1.0  # The set-point has been 1 since just before the first cycle.
    position, _, _ = run(response, np.ones(40))
    time = T / 16 * np.arange(1, 641)
    # Analytic: rounding of 640 recursions only.
    assert np.allclose(position[:, 0], step_response(time, 6 * math.pi, ratio), atol=1e-12)


@pytest.mark.parametrize("ratio", DAMPING)
def test_interpolated_setpoints_agree_with_lsim(ratio: float) -> None:
    setpoints = np.random.default_rng(2).normal(size=30)
    omega = 6 * math.pi
    system = signal.lti([omega**2], [1, 2 * ratio * omega, omega**2])
    knots = np.concatenate([[0.0], setpoints])
    fine = T / 16 * np.arange(30 * 16 + 1)
    # Analytic: lsim interpolates its input linearly too, so it has no discretisation error here.
    _, output, states = signal.lsim(system, np.interp(fine, T * np.arange(31), knots), fine)
    position, velocity, _ = run(make(ratio), setpoints)
    assert np.allclose(position[:, 0], output[1:], atol=1e-11)
    assert np.allclose(velocity[:, 0], states[1:, 0] * omega**2, atol=1e-9)


@pytest.mark.parametrize("ratio", DAMPING)
def test_steps_of_a_cycle_compose_to_the_cycle(ratio: float) -> None:
    setpoints = np.random.default_rng(3).normal(size=25)
    whole = run(make(ratio, steps=1), setpoints)
    for steps in (4, 7, 32):
        fine = run(make(ratio, steps=steps), setpoints)
        for coarse, many in zip(whole, fine, strict=True):
            # Analytic (semigroup): the last of m steps is the one step, up to rounding.
            assert np.allclose(many[steps - 1 :: steps], coarse, atol=1e-10)


@given(
    st.floats(0.05, 3.0),
    st.floats(0.5, 15.0),
    st.lists(st.floats(-3, 3), min_size=1, max_size=8),
)
def test_acceleration_obeys_the_differential_equation(
    ratio: float, frequency: float, setpoints: list[float]
) -> None:
    steps = 8
    position, velocity, acceleration = run(make(ratio, frequency, steps=steps), setpoints)
    knots = np.concatenate([[0.0], setpoints])
    ramp = np.interp(np.arange(1, len(setpoints) * steps + 1) / steps, np.arange(knots.size), knots)
    omega = 2 * math.pi * frequency
    expected = omega**2 * (ramp - position[:, 0]) - 2 * ratio * omega * velocity[:, 0]
    # Analytic, relative to the largest term ω² · 3 rad.
    assert np.allclose(acceleration[:, 0], expected, atol=1e-11 * omega**2)


def difference_errors(steps: int) -> Vector:
    """Return how far central differences are from velocity and acceleration, second cycle."""
    position, velocity, acceleration = run(make(steps=steps), [0.3, 0.1, -0.4])
    # The ramp has kinks between cycles: no difference may reach over one.
    inside = slice(steps, 2 * steps - 1)
    errors = []
    for value, slope in ((position, velocity), (velocity, acceleration)):
        central = (value[2:] - value[:-2]) * steps / (2 * T)
        errors.append(np.abs(central[steps - 1 : 2 * steps - 2] - slope[inside]).max())
    return np.array(errors)


def test_velocity_and_acceleration_are_derivatives_of_the_position() -> None:
    # Discretisation-limited, order 2: half the step leaves a quarter of the error.
    assert np.allclose(difference_errors(32) / difference_errors(64), 4.0, rtol=0.1)


def test_a_ramp_is_followed_late_by_2_xi_over_omega() -> None:
    response = make(0.995, 2.0)
    rate = 0.5
    position, velocity, acceleration = run(response, rate * T * np.arange(1, 101))
    # Analytic steady state (e^−35 left of the transient): lag 2ξ/ω_n, no acceleration.
    assert position[-1, 0] == pytest.approx(rate * (100 * T - 2 * 0.995 / (4 * math.pi)), abs=1e-12)
    assert velocity[-1, 0] == pytest.approx(rate, abs=1e-12)
    assert acceleration[-1, 0] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("ratio", DAMPING)
def test_impulse_response_is_the_transfer_functions(ratio: float) -> None:
    response = make(ratio)
    impulse = np.zeros(60)
    impulse[0] = 1.0
    measured = []
    for setpoint in impulse:
        measured.append(response.position[0])  # Read before the set-point acts.
        response.update(np.array([setpoint]))
    # Analytic: the same recursion.
    expected = signal.lfilter(*response.transfer_function(), impulse)
    assert np.allclose(measured, expected, atol=1e-11)
    a, b, c, d = response.state_space()
    _, states_space = signal.dimpulse((a, b, c, d, T), n=60)
    assert np.allclose(measured, states_space[0][:, 0], atol=1e-13)


@pytest.mark.parametrize("ratio", DAMPING)
def test_poles_of_the_cycle_are_the_exponentials_of_the_continuous_ones(ratio: float) -> None:
    a, *_ = make(ratio).state_space()
    omega = 6 * math.pi
    poles = np.roots([1, 2 * ratio * omega, omega**2])
    expected = np.sort_complex(np.append(np.exp(poles * T), 0.0))
    # Analytic; a double pole is only found to the square root of the rounding.
    tolerance = 1e-6 if ratio == 1.0 else 1e-12
    assert np.allclose(np.sort_complex(np.linalg.eigvals(a)), expected, atol=tolerance)


def test_joints_do_not_see_each_other() -> None:
    together = make(joints=6)
    setpoints = np.random.default_rng(4).normal(size=(10, 6))
    position = np.concatenate([together.update(u).position for u in setpoints])
    for joint in range(6):
        # Analytic: rounding of another summation order at most.
        alone = run(make(), setpoints[:, joint])[0]
        assert np.allclose(position[:, joint], alone[:, 0], atol=1e-13)


def test_rest_stays_rest_and_the_shapes_are_steps_by_joints() -> None:
    response = make(joints=6, steps=32)
    rest = np.array([0.0, 1.7, -3.4, 0.0, 0.14, 0.2])
    response.update(np.ones(6))
    response.reset(rest)
    reference = response.update(rest)
    assert reference.position.shape == reference.velocity.shape == (32, 6)
    # Analytic: rounding of rad and of ω² rad.
    assert np.allclose(reference.position, rest, atol=1e-13)
    assert np.allclose(reference.velocity, 0.0, atol=1e-11)
    assert np.allclose(reference.acceleration, 0.0, atol=1e-10)


@pytest.mark.parametrize(
    "wrong", [{"natural_frequency_hz": 0.0}, {"damping_ratio": -0.1}, {"damping": 1.0}]
)
def test_wrong_settings_are_refused_by_name(wrong: dict[str, Any]) -> None:
    with pytest.raises(msgspec.ValidationError, match=next(iter(wrong))):
        msgspec.convert(wrong, CommandResponseConfig)


@pytest.mark.parametrize(("joints", "steps"), [(0, 4), (6, 0)])
def test_no_joint_or_no_step_is_refused(joints: int, steps: int) -> None:
    with pytest.raises(InputError, match="at least 1"):
        make(joints=joints, steps=steps)
