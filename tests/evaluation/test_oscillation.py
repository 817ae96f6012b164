"""Growth rate, frequency and amplitude of oscillations that are known in closed form or drawn."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.evaluation.oscillation import Oscillation, oscillation_of
from dualbend.types import Vector
from support.synthetic_moments import KINDS, draw, right


def times(duration_s: float) -> Vector:
    return np.arange(0.0, duration_s, COMMAND_PERIOD_S)


def of(moment: Vector) -> Oscillation:
    return oscillation_of(moment, COMMAND_PERIOD_S)


def sinusoid(rate: float, frequency_hz: float, onset_s: float, duration_s: float = 8.0) -> Vector:
    """Return 50 mN m at the onset, or at the end where it grows, on a parabola (rows,)."""
    since = times(duration_s) - onset_s
    top = max(0.0, rate * since[-1])
    wave = 0.05 * np.exp(rate * since - top) * np.cos(2.0 * math.pi * frequency_hz * since + 1.0)
    return 0.01 + 1e-3 * since - 2e-4 * since**2 + np.where(since < 0.0, 0.0, wave)


@given(
    rate=st.floats(-8.0, 8.0),
    frequency_hz=st.floats(0.6, 6.0),
    onset_s=st.floats(0.0, 4.0),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_damped_sinusoid_without_noise_is_told_exactly_or_not_at_all(
    rate: float, frequency_hz: float, onset_s: float
) -> None:
    found = of(sinusoid(rate, frequency_hz, onset_s))
    if abs(rate) < 2.0 * frequency_hz:
        assert found.growth_per_s is not None, found.reason
    if found.growth_per_s is not None:
        # Discretisation-limited: a window may begin up to a row before the onset.
        assert found.growth_per_s == pytest.approx(rate, rel=0.1, abs=0.2)
        assert found.frequency_hz == pytest.approx(frequency_hz, rel=0.05)


@pytest.mark.parametrize("rate", [-2.0, 0.0, 2.0])
def test_a_damped_sinusoid_over_the_whole_record_is_exact(rate: float) -> None:
    found = of(sinusoid(rate, 2.5, 0.0))
    # Analytic: the model of a window is the signal.
    assert found.growth_per_s == pytest.approx(rate, abs=1e-6)
    assert found.frequency_hz == pytest.approx(2.5, rel=1e-6)
    assert found.reason == ""


@pytest.mark.parametrize("rate", [-0.5, -2.0, -10.0])
def test_a_decay_with_a_late_onset_never_grows(rate: float) -> None:
    """50 mN m at 2 Hz from 2 s of 10 s on, which filtering forward and backward makes grow."""
    found = of(sinusoid(rate, 2.0, 2.0, 10.0))
    assert found.growth_per_s is None or found.growth_per_s == pytest.approx(rate, rel=0.1)
    assert found.growth_per_s is not None or rate == -10.0, found.reason  # e⁻⁵ in a period


def test_growth_that_saturates_is_told_by_its_rise() -> None:
    since = times(10.0) - 2.0
    size = np.where(since < 0.0, 0.0, 5e-6 * np.exp(3.0 * np.minimum(since, 3.0)))
    found = of(size * np.sin(4.0 * math.pi * since))
    assert found.growth_per_s == pytest.approx(3.0, rel=0.01)  # analytic


def test_an_abrupt_rise_that_then_stays_is_no_steady_oscillation_from_its_onset() -> None:
    """Grows by 9 1/s for half a period: neither that nor the 0 1/s after it is told."""
    since = times(10.0) - 2.0
    size = np.where(since < 0.0, 0.0, 0.01 * np.exp(9.0 * np.minimum(since, 0.25)))
    assert of(size * np.cos(4.0 * math.pi * since)).growth_per_s is None


def test_an_oscillation_held_by_its_bounds_has_a_frequency_and_no_rate() -> None:
    """Rises by 9 1/s and is cut off: a wave with harmonics, whose amplitude is the bounds'."""
    since = times(10.0) - 2.0
    size = np.where(since < 0.0, 0.0, 0.01 * np.exp(9.0 * np.minimum(since, 0.6)))
    moment = np.clip(size * np.cos(4.0 * math.pi * since), -0.1, 0.1)
    found = oscillation_of(moment, COMMAND_PERIOD_S, np.abs(moment) >= 0.1)
    assert found.growth_per_s is None
    assert found.frequency_hz == pytest.approx(2.0, rel=0.01)  # discretisation-limited
    assert "at its bounds" in found.reason
    assert "at its bounds" not in of(moment).reason


@pytest.mark.parametrize("factor", [1e-3, -1.0, 1e3])
def test_size_and_sign_of_the_moment_do_not_matter(factor: float) -> None:
    moment = draw(np.random.default_rng(3), "decays").moment
    known, found = of(moment), of(factor * moment)
    assert found.growth_per_s == pytest.approx(known.growth_per_s, rel=1e-6)  # analytic
    assert known.amplitude_nm is not None
    assert found.amplitude_nm == pytest.approx(abs(factor) * known.amplitude_nm, rel=1e-6)


def test_a_later_onset_has_the_same_rate() -> None:
    moment = sinusoid(-1.5, 3.0, 1.0)
    later = of(np.concatenate([np.full(20, moment[0]), moment]))
    assert later.growth_per_s == pytest.approx(of(moment).growth_per_s, rel=1e-6)  # analytic


def test_another_period_of_the_same_samples_scales_the_rate() -> None:
    """Samples twice as far apart: half the rate and half the frequency."""
    t = 2.0 * times(8.0)
    moment = np.exp(-0.5 * t) * np.cos(2.0 * math.pi * t)
    found = oscillation_of(moment, 2.0 * COMMAND_PERIOD_S)
    assert found.growth_per_s == pytest.approx(-0.5, abs=1e-6)  # analytic
    assert found.frequency_hz == pytest.approx(1.0, rel=1e-6)


def test_the_arches_of_a_path_are_no_oscillation() -> None:
    t = times(10.0)
    found = of(0.04 * np.abs(np.sin(np.pi * t / 2.0)) / (1.0 + t))
    assert found.growth_per_s is None
    assert found.reason


def test_noise_is_no_oscillation() -> None:
    noise = np.random.default_rng(5).normal(0.0, 6.7e-3, (20, 360))
    assert all(of(row).growth_per_s is None for row in noise)  # statistical, n = 20


def test_a_short_record_tells_nothing_and_why() -> None:
    assert of(np.zeros(10)) == Oscillation(amplitude_nm=None, reason="shorter than 1 s")


def test_a_constant_moment_has_no_oscillation() -> None:
    found = of(np.full(200, 0.02))
    assert found.amplitude_nm == pytest.approx(0.0, abs=1e-12)
    assert found.growth_per_s is None


@pytest.mark.parametrize("frequency_hz", [2.0, 3.0, 5.0])
def test_amplitude_of_a_sine(frequency_hz: float) -> None:
    found = of(0.1 * np.sin(2.0 * math.pi * frequency_hz * times(10.0)))
    # Discretisation-limited: the window is no whole period.
    assert found.amplitude_nm == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
def test_drawn_oscillations_are_told_rightly_or_not_at_all() -> None:
    rng = np.random.default_rng(7)
    said: Counter[bool | None] = Counter()
    clear: Counter[bool | None] = Counter()
    for number in range(64):
        case = draw(rng, KINDS[number % len(KINDS)])
        found = of(case.moment).growth_per_s
        said[right(found, case)] += 1
        clear.update([right(found, case)] if case.clear else [])
    assert said[False] == 0, said  # statistical, n = 64; the lane: 2 of 3000
    assert 2 * clear[True] > clear.total(), clear  # statistical: three in five in the lane


@pytest.mark.parametrize("period_s", [0.001, 0.002, 0.008])
def test_the_rate_of_a_signal_is_not_that_of_its_sampling(period_s: float) -> None:
    """An exponential that is sampled more often is the same: analytic, to the steps of a row."""
    since = np.arange(0.0, 6.0, period_s)
    moment = 0.05 * np.exp(-1.5 * since) * np.cos(2.0 * math.pi * 3.0 * since + 1.0)
    found = oscillation_of(moment, period_s)
    assert found.growth_per_s == pytest.approx(-1.5, abs=1e-6)
    assert found.frequency_hz == pytest.approx(3.0, rel=1e-6)
