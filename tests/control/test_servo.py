"""The joint servo on the joint it is made for, integrated by an independent solver."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.control.servo import (
    FrictionEstimate,
    FrictionEstimateConfig,
    IntegralAction,
    IntegralConfig,
    JointServo,
)

Array = NDArray[np.float64]
K = np.array([4.5e4, 0.57e4, 2.0e3])
J = np.array([3.1, 1.1, 0.2])
B = np.array([5.8, 4.0, 0.4])
COULOMB = np.array([26.0, 6.4, 1.1])


def make(*, ratio: float = 1.0, friction: bool = True, viscous: Array = B) -> JointServo:
    return JointServo(
        stiffness=K,
        inertia=J,
        viscous_friction=viscous,
        coulomb_friction=COULOMB * friction,
        damping_ratio=ratio,
    )


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.0])
def test_joint_and_servo_together_have_the_damping_ratio(ratio: float) -> None:
    servo = make(ratio=ratio)
    # Analytic: J s² + (c + B) s + k, so ζ = (c + B) / (2 √(k J)).
    np.testing.assert_allclose((servo.damping + B) / (2 * np.sqrt(K * J)), ratio, rtol=1e-14)


def test_a_joint_that_is_damped_enough_by_itself_gets_no_negative_damping() -> None:
    heavy = np.array([5.8, 1e6, 0.4])
    servo = make(ratio=0.5, viscous=heavy)
    assert servo.damping[1] == 0.0
    assert servo.damping[0] > 0.0


def test_a_load_is_felt_as_the_configured_stiffness() -> None:
    """At rest k (u − q) = load: the setpoint of a resting reference is the reference."""
    servo = make()
    q_ref = np.array([0.3, -1.0, 2.0])
    u = servo.setpoint(q_ref, np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(u, q_ref)  # no offset: tanh(0) = 0
    load = np.array([30.0, -8.0, 1.0])
    deflection = (u + load / servo.stiffness) - q_ref
    np.testing.assert_allclose(load / deflection, K, rtol=1e-9)  # analytic


def reference(cycles: int, steps: int, size_rad: float) -> tuple[Array, Array, Array]:
    """Return the response to a step of the setpoint at the first cycle, (time, 3) each."""
    response = CommandResponse(
        CommandResponseConfig(natural_frequency_hz=2.5, damping_ratio=1.0),
        3,
        steps,
        period_s=0.028,
    )
    response.reset(np.zeros(3))
    goal = size_rad * np.array([1.0, -1.0, 0.5])
    parts = [response.update(goal) for _ in range(cycles)]
    position, velocity, acceleration = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("position", "velocity", "acceleration")
    )
    return position, velocity, acceleration


def follow(servo: JointServo, step_s: float, cycles: int, inertia: Array) -> tuple[Array, Array]:
    """Integrate J q̈ + B q̇ = k (u − q) − c q̇ with u held over each step; return q and q_ref."""
    steps = round(0.028 / step_s)
    position, velocity, acceleration = reference(cycles, steps, 0.05)
    u = servo.setpoint(position, velocity, acceleration)

    def rate(_: float, state: Array, setpoint: Array) -> Array:
        q, v = state[:3], state[3:]
        torque = servo.stiffness * (setpoint - q) - servo.damping * v
        return np.concatenate((v, (torque - B * v) / inertia))

    state, states = np.zeros(6), []
    for row in u:
        solved = solve_ivp(rate, (0.0, step_s), state, args=(row,), rtol=1e-9, atol=1e-12)
        state = solved.y[:, -1]
        states.append(state[:3])
    return np.array(states), position


def test_the_feed_forward_follows_the_reference() -> None:
    servo = make(friction=False)
    errors = []
    for step_s in (0.0035, 0.00175):
        q, wanted = follow(servo, step_s, 12, J)
        errors.append(np.abs(q - wanted).max())
    # Discretisation-limited: the setpoint is the reference at the end of the step that holds it,
    # first order in the step. Without feed-forward the lag is c v/k ≈ 2 v/ω, 10 to 40 times more.
    assert errors[0] / errors[1] > 1.6
    assert errors[1] < 1e-3


def test_half_of_the_inertia_is_not_followed_as_well() -> None:
    """The acceleration's feed-forward does something: a wrong inertia makes an error."""
    servo = make(friction=False)
    right = np.abs(np.subtract(*follow(servo, 0.00175, 6, J))).max()
    wrong = np.abs(np.subtract(*follow(servo, 0.00175, 6, 3.0 * J))).max()
    assert wrong > 1.3 * right


def test_the_friction_is_fed_forward_with_the_sign_of_the_speed() -> None:
    servo = make()
    still = np.zeros(3)
    for speed in (1e-2, -1e-2, 1.0):
        velocity = np.full(3, speed)
        torque = K * (servo.setpoint(still, velocity, still)) - servo.damping * velocity
        # Analytic: what holds a constant speed is B v + T_c sign(v).
        np.testing.assert_allclose(torque, B * speed + math.copysign(1, speed) * COULOMB, rtol=1e-9)


def test_one_call_serves_all_rows_of_a_cycle() -> None:
    servo = make()
    rng = np.random.default_rng(3)
    position, velocity, acceleration = rng.standard_normal((3, 16, 3))
    rows = servo.setpoint(position, velocity, acceleration)
    one = [servo.setpoint(*row) for row in zip(position, velocity, acceleration, strict=True)]
    np.testing.assert_array_equal(rows, one)


LIMIT = np.array([97.6, 89.4, 21.3])


def integral(config: IntegralConfig | None) -> IntegralAction:
    return IntegralAction(config, stiffness=K, torque_limit=LIMIT, period_s=0.028)


def test_the_integral_takes_a_steady_load_away_with_its_time_constant() -> None:
    """A spring under a load: e[n] = τ/k − z[n] and z[n+1] = z[n] + k_i T e[n]."""
    action, load = integral(IntegralConfig(rate_per_s=5.0)), 0.1 * LIMIT
    offset, errors = np.zeros(3), []
    for _ in range(40):
        errors.append(load / K - offset)
        offset = action.update(errors[-1]).copy()
    # Analytic: a geometric sequence of ratio 1 − k_i T.
    expected = load / K * (1.0 - 5.0 * 0.028) ** np.arange(40)[:, np.newaxis]
    np.testing.assert_allclose(errors, expected, rtol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_integral_stops_at_its_share_of_the_torque(sign: float) -> None:
    action = integral(IntegralConfig(rate_per_s=50.0, torque_fraction=0.3))
    for _ in range(1000):
        offset = action.update(np.full(3, sign))
    np.testing.assert_allclose(K * offset, sign * 0.3 * LIMIT, rtol=1e-12)  # analytic
    # It does not have to unwind what it could not apply: one error back is one step back.
    back = action.update(np.full(3, -sign * 1e-5))
    np.testing.assert_allclose(back, sign * (0.3 * LIMIT / K - 50.0 * 0.028 * 1e-5), rtol=1e-9)
    action.reset()
    np.testing.assert_array_equal(action.update(np.zeros(3)), 0.0)


def test_without_integral_action_nothing_is_added() -> None:
    action = integral(None)
    np.testing.assert_array_equal(action.update(np.ones(3)), 0.0)


SPEED = np.array([0.1, -0.02, 0.05])


def estimate(config: FrictionEstimateConfig | None, coulomb: Array = COULOMB) -> FrictionEstimate:
    return FrictionEstimate(config, stiffness=K, coulomb_friction=coulomb, period_s=0.028)


def driven(found: FrictionEstimate, true: Array, weight: Array, cycles: int, back: int) -> Array:
    """Drive joints forth and back, ``back`` cycles each, and return the ratios of all cycles.

    A joint lacks k (q_r − q) = (ρ − r) T_c sign(v) + w: ``true`` ρ, ``weight`` w / T_c.
    """
    ratios = []
    for n in range(cycles):
        speed = SPEED * (1.0 if n // back % 2 == 0 else -1.0)
        lacking = (true - found.ratio) * np.sign(speed) + weight
        ratios.append(found.update(lacking * COULOMB / K, speed).copy())
    return np.array(ratios)


TRUE = np.array([0.6, 1.4, 1.7])


@pytest.mark.parametrize("weight", [0.0, 0.3, -0.2])
def test_the_friction_estimate_comes_to_the_true_friction_whatever_the_weight(
    weight: float,
) -> None:
    found = estimate(FrictionEstimateConfig(rate_per_s=2.0))
    ratios = driven(found, TRUE, np.full(3, weight), 1200, 40)
    np.testing.assert_allclose(ratios[-1], TRUE, rtol=1e-3)  # converged
    found.reset()
    np.testing.assert_array_equal(found.ratio, 1.0)
    np.testing.assert_array_equal(driven(found, TRUE, np.full(3, weight), 1200, 40), ratios)


def test_one_direction_does_not_tell_friction_from_weight() -> None:
    found = estimate(FrictionEstimateConfig(rate_per_s=2.0))
    ratios = driven(found, TRUE, np.zeros(3), 60, 60)
    # Analytic: half of what is lacking goes to either, by a geometric sequence of 1 − 2 γ T.
    left = (1.0 - 4.0 * 0.028) ** np.arange(1, 61)[:, np.newaxis]
    np.testing.assert_allclose(ratios, 1.0 + 0.5 * (TRUE - 1.0) * (1.0 - left), rtol=1e-12)


def test_friction_is_told_by_moving_joints_only_and_within_bounds() -> None:
    config = FrictionEstimateConfig(slowest_rad_per_s=0.03, largest=1.5)
    no_friction = estimate(config, np.array([26.0, 6.4, 0.0]))
    ratio = no_friction.update(0.5 * COULOMB / K, SPEED)
    # The second joint is too slow, the third has no friction to be told.
    np.testing.assert_array_equal(ratio[1:], 1.0)
    assert ratio[0] > 1.0
    for sign, bound in ((1.0, 1.5), (-1.0, 0.0)):
        for n in range(1000):
            way = 1.0 if n % 2 else -1.0
            ratio = no_friction.update(np.full(3, way * sign), np.full(3, way * 0.1))
        assert ratio[0] == bound


def test_an_error_that_is_no_friction_counts_as_the_believed_one() -> None:
    small, large = (estimate(FrictionEstimateConfig()) for _ in range(2))
    np.testing.assert_allclose(
        large.update(100.0 * COULOMB / K, np.ones(3)), small.update(COULOMB / K, np.ones(3))
    )


def test_without_an_estimate_the_believed_friction_is_fed_forward() -> None:
    found, servo, still = estimate(None), make(), np.zeros(3)
    ratio = found.update(np.ones(3), SPEED)
    np.testing.assert_array_equal(ratio, 1.0)
    fed = servo.setpoint(still, SPEED, still, np.full(3, 1.5)) - servo.setpoint(still, SPEED, still)
    np.testing.assert_allclose(K * fed, 0.5 * COULOMB * np.sign(SPEED), rtol=1e-12)  # analytic
