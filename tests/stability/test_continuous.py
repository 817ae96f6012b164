"""The paper's loop (16)-(23) and the same with delay: Routh, roots, boundaries, margins."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.stability.continuous import (
    ContinuousLoop,
    dead_time_s,
    delayed_loop,
    k_for_every_damping,
    largest_stiffness,
    pade,
    paper_loop,
    smallest_k,
    unstable_damping,
)
from dualbend.stability.margins import loop_margins
from dualbend.stability.sampled import LoopElements, SampledLoop
from support.strip import STRIP8, STRIP9

OMEGA, TWO_XI_OMEGA, K_E = 4.0 * math.pi, 25.0, 11500.0


def loop(b: float, k: float, k_e: float = K_E, delay_s: float = 0.0) -> ContinuousLoop:
    return ContinuousLoop(
        b=b,
        k=k,
        stiffness=k_e,
        omega_rad_per_s=OMEGA,
        two_xi_omega=TWO_XI_OMEGA,
        delay_s=delay_s,
    )


def test_the_papers_numbers() -> None:
    # Closed form; the physics reference rounds 5.7645 to 5.77.
    assert smallest_k(7.0, K_E, OMEGA, TWO_XI_OMEGA) == pytest.approx(625.5, abs=0.05)
    low, high = unstable_damping(575.0, K_E, OMEGA, TWO_XI_OMEGA) or (math.nan, math.nan)
    assert low == pytest.approx(5.77, rel=2e-3)
    assert high == pytest.approx(363.0, abs=0.5)
    assert k_for_every_damping(K_E, OMEGA, TWO_XI_OMEGA) == pytest.approx(1449.0, abs=0.5)
    assert not loop(7.0, 575.0).routh_stable


@pytest.mark.parametrize("side", [0.999, 1.001])
def test_closed_boundaries_are_where_routh_changes(side: float) -> None:
    stable = side > 1.0
    # Analytic: each boundary is approached from both sides.
    k = smallest_k(7.0, K_E, OMEGA, TWO_XI_OMEGA)
    assert loop(7.0, k * side).routh_stable == stable
    low, high = unstable_damping(575.0, K_E, OMEGA, TWO_XI_OMEGA) or (math.nan, math.nan)
    assert loop(low / side, 575.0).routh_stable == stable
    assert loop(high * side, 575.0).routh_stable == stable
    k_e = float(largest_stiffness(np.array(7.0), np.array(575.0), OMEGA, TWO_XI_OMEGA))
    assert loop(7.0, 575.0, k_e / side).routh_stable == stable
    every = k_for_every_damping(K_E, OMEGA, TWO_XI_OMEGA)
    assert (unstable_damping(every * side, K_E, OMEGA, TWO_XI_OMEGA) is None) == stable


def test_routh_agrees_with_the_roots_of_1000_random_loops() -> None:
    rng = np.random.default_rng(23)
    verdicts = []
    for b, k, k_e, omega, xi in 10.0 ** rng.uniform(
        [-3, -2, -2, 0, -2], [3, 4, 6, 2, 1], (1000, 5)
    ):
        tried = ContinuousLoop(
            b=b, k=k, stiffness=k_e, omega_rad_per_s=omega, two_xi_omega=2.0 * xi * omega
        )
        roots = np.roots(tried.polynomial)
        worst = roots[np.argmax(roots.real)]
        # Rounding: a root within 1e-9 of the axis, relative to the largest one, has no verdict.
        if abs(worst.real) > 1e-9 * np.abs(roots).max():
            assert tried.routh_stable == (worst.real < 0.0), tried
        verdicts.append(tried.routh_stable)
    # Statistical, n = 1000: both verdicts are well represented.
    assert 200 < sum(verdicts) < 800


def test_without_delay_a_smaller_damping_never_destabilises() -> None:
    verdicts = [loop(b, 700.0).routh_stable for b in np.geomspace(6.0, 0.01, 40)]
    # Analytic: below the lower root of (23) every b is stable.
    assert verdicts == sorted(verdicts)
    assert verdicts[-1]


@pytest.mark.parametrize("delay_s", [0.0, 0.028, 0.1])
@pytest.mark.parametrize("k_e", [200.0, 2500.0])
def test_margins_are_boundaries(delay_s: float, k_e: float) -> None:
    tried = loop(20.0, 575.0, k_e, delay_s)
    found = tried.margins()
    edge = loop(20.0, 575.0, k_e * found.gain, delay_s)
    # Discretisation-limited: the sweep's 0.23 % steps, second order; Padé of order 4.
    assert abs(edge.mode().growth_per_s) < 1e-3
    assert edge.mode().frequency_hz == pytest.approx(found.crossover_hz, rel=1e-3)
    if math.isfinite(found.delay_s) and delay_s + found.delay_s > 0.0:
        late = loop(20.0, 575.0, k_e, delay_s + found.delay_s)
        assert abs(late.mode().growth_per_s) < 1e-3


def test_the_root_with_delay_solves_the_transcendental_equation() -> None:
    tried = loop(7.0, 575.0, 900.0, 0.12)
    mode = tried.mode()
    s = complex(mode.growth_per_s, 2.0 * math.pi * mode.frequency_hz)
    robot = OMEGA**2 / (s * s + TWO_XI_OMEGA * s + OMEGA**2)
    # Padé of order 4 at |sτ| < 2: 1e-5.
    assert abs(1.0 + 900.0 * robot * cmath.exp(-0.12 * s) / (7.0 * s + 575.0)) < 1e-4


def test_pade_is_all_pass_and_of_its_order() -> None:
    numerator, denominator = pade(0.1, 4)
    s = 1j * np.array([0.1, 1.0, 10.0])
    value = np.polyval(numerator, s) / np.polyval(denominator, s)
    # Analytic.
    np.testing.assert_allclose(np.abs(value), 1.0, rtol=1e-12)
    np.testing.assert_allclose(value, np.exp(-0.1 * s), atol=1e-8)


def test_delayed_loop_has_the_scenarios_delays_and_true_compliance() -> None:
    parts = LoopElements.from_scenario(load_scenario(STRIP8))
    # Golden: (2 + 1) cycles, 6 steps of 1.75 ms, half a cycle of a 2-tap FIR.
    assert dead_time_s(parts, 2.0) == pytest.approx(3 * 0.028 + 6 * 0.00175 + 0.014)
    continuous = delayed_loop(parts, "x", 1300.0)
    assert 1.0 / continuous.k == pytest.approx(parts.axis("x").static_compliance)
    paper = paper_loop(parts, "x", 1300.0)
    assert (paper.b, paper.k, paper.delay_s) == (7e3, 575e3, 0.0)


@pytest.mark.parametrize("scenario", [STRIP8, STRIP9])
@pytest.mark.parametrize("axis", ["x", "rotation"])
def test_delay_explains_the_sampled_loop_to_five_percent(scenario: str, axis: str) -> None:
    parts = LoopElements.from_scenario(load_scenario(scenario))
    name, acting = ("x", (True, False)) if axis == "x" else ("rotation", (False, True))
    sampled = SampledLoop(parts, np.eye(2), acting)
    exact = loop_margins(sampled, stable=True)
    found = delayed_loop(parts, name, 1.0, exact.crossover_hz).margins()  # type: ignore[arg-type]
    # Golden: at 2.2 Hz sampling is little else than its delay.
    assert found.gain == pytest.approx(exact.gain, rel=0.05)
    assert found.crossover_hz == pytest.approx(exact.crossover_hz, rel=0.05)


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="b = 0"):
        loop(0.0, 575.0)
    with pytest.raises(InputError, match="delay_s = -1"):
        loop(7.0, 575.0, delay_s=-1.0)
