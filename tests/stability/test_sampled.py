"""The sampled loop: the state space is what the streaming objects do; margins are boundaries."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize, signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import Admittance, AdmittanceConfig
from dualbend.control.compliance.base import AdmittanceForm, AxisConfig
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import FirConfig, IirConfig, LowPass, LowPassConfig, NoFilterConfig
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.stability.margins import (
    frequency_grid,
    hunting_amplitude,
    jitter_cycles,
    late_cycles,
    loop_margins,
)
from dualbend.stability.mode import describe_mode
from dualbend.stability.sampled import LoopElements, SampledLoop
from support.state_space import simulate
from support.strip import STRIP6, STRIP8

Vector = NDArray[np.float64]
STEPS = 8
LIMIT = 1e9
"""No deviation is clamped: the state space is linear."""

PAPER_ROBOT = CommandResponseConfig(
    natural_frequency_hz=2.0, damping_ratio=25.0 / (2.0 * 4.0 * math.pi)
)


def elements(
    *,
    delay: int = 1,
    age: int = 1,
    low_pass: LowPassConfig | None = None,
    form: AdmittanceForm = "printed",
    b: float = 7.0,
    k: float = 575.0,
    robot: CommandResponseConfig = PAPER_ROBOT,
) -> LoopElements:
    config = AdmittanceConfig(
        x=AxisConfig(b=b, k=k, form=form),
        rotation=AxisConfig(b=2.0 * b, k=0.3 * k, form=form),
        units="si",
        limit_x_m=LIMIT,
        limit_rotation_rad=LIMIT,
    )
    return LoopElements(
        response=CommandResponse(robot, 1, STEPS, period_s=COMMAND_PERIOD_S),
        low_pass=LowPass(low_pass or NoFilterConfig(), 1, period_s=COMMAND_PERIOD_S),
        delay=TransportDelay(delay, 1),
        admittance=Admittance(config, period_s=COMMAND_PERIOD_S),
        age_steps=age,
    )


NO_TOOL = np.zeros((2, 2))


def stream(
    parts: LoopElements,
    stiffness: Vector,
    disturbance: Vector,
    inertia: Vector = NO_TOOL,
    behind: float = 0.0,
    late: NDArray[np.int64] | None = None,
) -> Vector:
    """Run the loop's own objects around a linear spring, with an aged reading of the position.

    What is read is ``behind`` in its direction of motion; ``late``: how many cycles ago the command
    was made that each cycle executes.
    """
    response = CommandResponse(parts.response.config, 2, STEPS, period_s=COMMAND_PERIOD_S)
    low_pass = LowPass.stacked([parts.low_pass] * 2)
    delay = TransportDelay(parts.delay.cycles, 2)
    admittance = Admittance(parts.admittance.config, period_s=COMMAND_PERIOD_S)
    positions = [np.zeros(2)] * (2 + parts.age_steps)
    accelerations = list(positions)
    out = []
    for wrench in disturbance:
        at = -1 - parts.age_steps
        moved = positions[at] - behind * np.sign(positions[at] - positions[at - 1])
        reading = wrench - stiffness @ moved - inertia @ accelerations[at]
        deviation = admittance.update(low_pass.update(reading[:, np.newaxis])[:, 0], 1.0)
        out.append(deviation)
        sent = deviation if late is None else out[-1 - min(late[len(out) - 1], len(out) - 1)]
        reference = response.update(delay.update(sent))
        positions.extend(reference.position)
        accelerations.extend(reference.acceleration)
    return np.array(out)


@pytest.mark.parametrize("low_pass", [None, FirConfig(taps=3), IirConfig()])
@pytest.mark.parametrize(("delay", "age"), [(0, 0), (0, 1), (2, 5), (1, STEPS), (3, 2 * STEPS + 3)])
@pytest.mark.parametrize("form", ["printed", "impulse-invariant", "static"])
def test_state_space_responds_as_the_streaming_objects_do(
    low_pass: LowPassConfig | None, delay: int, age: int, form: AdmittanceForm
) -> None:
    parts = elements(delay=delay, age=age, low_pass=low_pass, form=form)
    stiffness = np.array([[6.0, 1.5], [2.0, 3.0]])
    disturbance = np.random.default_rng(4).normal(size=(120, 2))
    inertia = np.array([[0.02, 0.004], [0.003, 0.01]])
    expected = stream(parts, stiffness, disturbance, inertia)
    # Rounding only.
    np.testing.assert_allclose(
        simulate(SampledLoop(parts, stiffness, inertia=inertia).closed, disturbance),
        expected,
        rtol=0.0,
        atol=1e-12 * np.abs(expected).max(),
    )


def test_axis_alone_is_the_diagonal_of_the_stiffness() -> None:
    parts = elements(delay=1, age=3)
    coupled = np.array([[6.0, 1.5], [2.0, 3.0]])
    disturbance = np.random.default_rng(5).normal(size=(60, 2))
    expected = stream(parts, np.diag(np.diag(coupled)), disturbance)
    alone = simulate(SampledLoop(parts, coupled, (False, True)).closed, disturbance[:, 1:])
    # Rounding only.
    np.testing.assert_allclose(alone[:, 0], expected[:, 1], rtol=1e-11, atol=1e-15)


def test_growth_and_frequency_are_those_of_the_streamed_oscillation() -> None:
    parts, stiffness = elements(delay=2, age=3), np.diag([30.0, 0.0])
    impulse = np.zeros((220, 2))
    impulse[0, 0] = 1.0
    streamed = stream(parts, stiffness, impulse)[:, 0]
    mode = SampledLoop(parts, stiffness, (True, False)).mode()
    assert not mode.stable
    peaks = signal.find_peaks(streamed[80:])[0] + 80
    times = peaks * COMMAND_PERIOD_S
    rate = np.polyfit(times, np.log(streamed[peaks]), 1)[0]
    # Discretisation-limited: a peak is known to half a period of 28 ms.
    assert mode.growth_per_s == pytest.approx(rate, rel=2e-2)
    assert mode.frequency_hz == pytest.approx(1.0 / np.mean(np.diff(times)), rel=2e-2)


def largest_stiffness(parts: LoopElements) -> float:
    def excess(stiffness: float) -> float:
        loop = SampledLoop(parts, np.diag([stiffness, 0.0]), (True, False))
        return loop.mode().spectral_radius - 1.0

    return float(optimize.brentq(excess, 1.0, 1e4, xtol=1e-9))


@pytest.mark.parametrize(
    ("form", "limits"),
    [
        ("printed", (39.9, 22.2, 16.4, 13.5)),
        ("impulse-invariant", (1425.0, 793.0, 584.0, 481.0)),
    ],
)
def test_largest_stable_stiffness_of_the_interpolated_loop(
    form: AdmittanceForm, limits: tuple[float, ...]
) -> None:
    found = [largest_stiffness(elements(delay=d, age=0, form=form)) for d in range(4)]
    # Published table of the physics reference, three digits.
    np.testing.assert_allclose(found, limits, rtol=5e-3)


def held_limit(b: float, delay: int) -> float:
    """Return the same with a zero-order hold, from the characteristic polynomial."""
    c, w2 = 25.0, (4.0 * math.pi) ** 2
    num, den, _ = signal.cont2discrete(([w2], [1.0, c, w2]), COMMAND_PERIOD_S, "zoh")
    pole = math.exp(-575.0 * COMMAND_PERIOD_S / b)
    # 1 + k_e (1/b) z/(z − a) z^−d G(z) = 0, times z^d (z − a) den.
    opened = np.polymul(np.polymul([1.0, -pole], den), [1.0, *[0.0] * delay])
    closing = np.polymul(num[0], [1.0 / b, 0.0])

    def excess(stiffness: float) -> float:
        roots = np.roots(np.polyadd(opened, stiffness * closing))
        return float(np.abs(roots).max()) - 1.0

    return float(optimize.brentq(excess, 1.0, 1e4))


def test_a_zero_order_hold_would_bear_more_and_small_damping_bears_less() -> None:
    # Published table of the physics reference, three digits.
    np.testing.assert_allclose(
        [held_limit(7.0, d) for d in range(4)], (73.5, 27.7, 18.5, 14.6), rtol=5e-3
    )
    assert held_limit(14.0, 0) == pytest.approx(91.0, rel=5e-3)
    # Given as 44: two digits.
    assert held_limit(3.5, 0) == pytest.approx(44.0, abs=0.5)


@pytest.mark.parametrize("acting", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("scale", [0.3, 5.0])
def test_gain_margin_is_the_factor_that_puts_an_eigenvalue_on_the_circle(
    acting: tuple[bool, bool], scale: float
) -> None:
    parts = elements(delay=2, age=3, low_pass=FirConfig(taps=2))
    stiffness = scale * np.array([[10.0, 4.0], [6.0, 9.0]])
    loop = SampledLoop(parts, stiffness, acting)
    found = loop_margins(loop, stable=loop.mode().stable)
    assert (found.gain > 1.0) == loop.mode().stable
    mode = SampledLoop(parts, found.gain * stiffness, acting).mode()
    # Discretisation-limited: second order in the sweep's 0.45 % steps.
    assert mode.spectral_radius == pytest.approx(1.0, abs=1e-5)
    assert mode.frequency_hz == pytest.approx(found.crossover_hz, rel=1e-3)


@pytest.mark.parametrize("acting", [(True, False), (True, True)])
def test_delay_margin_is_the_transport_that_the_loop_still_bears(
    acting: tuple[bool, bool],
) -> None:
    stiffness = np.array([[14.5, 1.0], [1.0, 9.0]])
    loops = [SampledLoop(elements(delay=d), stiffness, acting) for d in range(12)]
    margin = loop_margins(loops[0], stable=True)
    borne = math.floor(margin.delay_s / COMMAND_PERIOD_S)
    # Whole cycles bracket the margin; analytic.
    assert 1 <= borne < 11
    assert [loop.mode().stable for loop in loops[: borne + 2]] == [True] * (borne + 1) + [False]
    late = loop_margins(loops[borne + 1], stable=False)
    assert -COMMAND_PERIOD_S < late.delay_s < 0.0
    # Every cycle more takes one period off; to the sweep's interpolation.
    assert margin.delay_s - late.delay_s == pytest.approx((borne + 1) * COMMAND_PERIOD_S, rel=1e-4)


def test_stiffness_of_the_wrong_sign_diverges_without_oscillation() -> None:
    loop = SampledLoop(elements(), np.diag([-2.0 * 6.3, 0.0]), (True, False))
    mode = loop.mode()
    found = loop_margins(loop, stable=mode.stable)
    compliance = elements().axis("x").static_compliance
    # Analytic: static deviation per deviation is −K c; the boundary is where it is 1.
    assert found.gain == pytest.approx(1.0 / (2.0 * 6.3 * compliance), rel=1e-9)
    assert mode.stable == (found.gain > 1.0)
    assert not mode.stable
    assert mode.frequency_hz == 0.0


def test_modes_in_time() -> None:
    mode = describe_mode(
        np.exp(complex(-2.0, 2.0 * math.pi * 3.0) * COMMAND_PERIOD_S), COMMAND_PERIOD_S
    )
    # Analytic.
    assert mode.growth_per_s == pytest.approx(-2.0)
    assert mode.frequency_hz == pytest.approx(3.0)
    assert mode.damping_ratio == pytest.approx(2.0 / math.hypot(2.0, 6.0 * math.pi))
    assert describe_mode(0.0, COMMAND_PERIOD_S).growth_per_s == -math.inf


@pytest.mark.parametrize(("latency_ms", "age"), [(0.0, 1), (9.9, 6), (28.0, 16), (60.0, 34)])
def test_a_scenario_gives_the_age_that_the_simulation_has(latency_ms: float, age: int) -> None:
    scenario = load_scenario(STRIP8, [f"sensor.latency_ms={latency_ms}"])
    parts = LoopElements.from_scenario(scenario)
    # Golden: at 1.75 ms, and never younger than one step.
    assert parts.age_steps == age
    assert parts.delay.cycles == scenario.robot.alter.delay_cycles
    assert parts.response.steps == 16
    assert parts.acting("coupled", 0.1) == (False, False)
    assert parts.acting("x", 0.2) == (True, False)


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="younger"):
        elements(age=-1)
    with pytest.raises(InputError, match="no admittance axis"):
        SampledLoop(elements(), np.eye(2), (False, False))
    with pytest.raises(InputError, match=r"finite \(2, 2\)"):
        SampledLoop(elements(), np.eye(3))
    with pytest.raises(InputError, match=r"compliance\.x is off"):
        LoopElements.from_scenario(load_scenario(STRIP6)).axis("x")


def test_of_an_integrator_the_jitter_that_it_bears_is_known() -> None:
    z_inverse = frequency_grid(COMMAND_PERIOD_S)[1][1:]
    for gain in (0.1, 0.5, 1.2):
        loop = (gain * z_inverse / (1.0 - z_inverse))[:, np.newaxis, np.newaxis]
        # Analytic: (1 − z⁻¹) T = g z⁻¹ (1 − z⁻¹)/(1 − (1 − g) z⁻¹), largest at z = −1.
        found = late_cycles(loop, z_inverse)
        assert found == pytest.approx((2.0 - gain) / (2.0 * gain), rel=1e-6)
    both = np.array([[0.5, 0.2], [0.3, 0.4]]) * loop
    units = np.diag([1.0, 1e3])
    # Analytic: it does not depend on the axes' units.
    other = units @ both @ np.linalg.inv(units)
    assert late_cycles(other, z_inverse) == pytest.approx(late_cycles(both, z_inverse), rel=1e-9)
    apart = np.diag([0.5, 0.0]) * loop
    assert late_cycles(apart, z_inverse) == pytest.approx(late_cycles(0.5 * loop, z_inverse))


def test_a_loop_bears_the_jitter_that_is_said() -> None:
    parts = elements(delay=2, age=3)
    stiffness = np.diag([0.35 * largest_stiffness(parts), 0.0])
    loop = SampledLoop(parts, stiffness, (True, False))
    most = int(jitter_cycles(loop))
    # Sufficient only: what a constant delay may be more is at least as much.
    assert 1 <= most <= loop_margins(loop, stable=True).delay_s / COMMAND_PERIOD_S
    push = np.zeros((600, 2))
    push[0, 0] = 1.0
    for seed in range(5):
        late = np.random.default_rng(seed).integers(0, most, 600, endpoint=True)
        streamed = np.abs(stream(parts, stiffness, push, late=late)[:, 0])
        assert streamed[-100:].max() < 1e-6 * streamed.max()


@pytest.mark.parametrize("part", [0.4, 0.7, 0.9])
def test_friction_keeps_a_stable_loop_moving_as_far_as_is_said(part: float) -> None:
    parts, behind = elements(delay=2, age=3), 1e-3
    stiffness = np.diag([part * largest_stiffness(parts), 0.0])
    loop = SampledLoop(parts, stiffness, (True, False))
    push = np.zeros((1200, 2))
    push[0, 0] = 5.0
    swings = stream(parts, stiffness, push, behind=behind)[-300:, 0]
    still = stream(parts, stiffness, push)[-300:, 0]
    hz = np.count_nonzero(np.diff(np.sign(swings - swings.mean()))) / (2 * 299 * COMMAND_PERIOD_S)
    omega, natural = 2 * math.pi * hz, 2 * math.pi * PAPER_ROBOT.natural_frequency_hz
    passed = natural**2 / abs(natural**2 - omega**2 + 25.0j * omega)
    # A describing function: the harmonics are left out.
    amplitude = passed * math.sqrt(2.0) * swings.std()
    assert hunting_amplitude(loop, behind) == pytest.approx(amplitude, rel=0.1)
    assert np.ptp(still) < 1e-3 * np.ptp(swings)
    assert hunting_amplitude(loop, 0.0) == 0.0
