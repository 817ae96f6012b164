"""The low-pass filter: what runs is what its transfer function says."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.filters import (
    FirConfig,
    IirConfig,
    LowPass,
    LowPassConfig,
    NoFilterConfig,
)
from dualbend.errors import InputError

CONFIGS = [
    NoFilterConfig(),
    *(FirConfig(taps=n) for n in (1, 2, 3, 5, 8)),
    *(FirConfig(taps=n, window="boxcar", cutoff_hz=6.0) for n in (3, 4)),
    *(IirConfig(order=n) for n in (1, 2, 4)),
]
BY_NAME = pytest.mark.parametrize("config", CONFIGS, ids=str)


@BY_NAME
def test_response_to_noise_and_impulse_is_the_transfer_functions(config: LowPassConfig) -> None:
    low_pass = LowPass(config, channels=3, period_s=COMMAND_PERIOD_S)
    samples = np.random.default_rng(1).normal(size=(80, 3))
    samples[:40] = 0.0
    samples[0] = (1.0, -2.0, 0.5)
    expected = signal.lfilter(*low_pass.transfer_function(), samples, axis=0)
    # Analytic: rounding only.
    assert np.allclose([low_pass.update(row) for row in samples], expected, atol=1e-14)


@BY_NAME
def test_unit_gain_at_dc_and_no_transient_from_a_steady_value(config: LowPassConfig) -> None:
    low_pass = LowPass(config, period_s=COMMAND_PERIOD_S)
    value = np.array([16.0, -3.0, 0.2, 0.0, 0.4, -1e3])
    low_pass.update(np.full(6, 7.0))
    low_pass.reset(value)
    outputs = [low_pass.update(value) for _ in range(50)]
    # Analytic: rounding only.
    assert np.allclose(outputs, np.tile(value, (50, 1)), rtol=1e-13)
    assert math.isclose(low_pass.gain(0.0), 1.0, rel_tol=1e-13)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_steady_memory_is_the_one_of_lfilter_zi(order: int) -> None:
    low_pass = LowPass(IirConfig(order=order), channels=1, period_s=COMMAND_PERIOD_S)
    low_pass.reset(1.0)
    # Analytic: two ways to the same linear system.
    assert np.allclose(
        low_pass._signal[1:, 0], signal.lfilter_zi(*low_pass.transfer_function()), atol=1e-11
    )


@given(
    st.sampled_from(CONFIGS),
    st.lists(st.tuples(st.floats(-100, 100), st.floats(-100, 100)), min_size=1, max_size=12),
)
def test_superposition(config: LowPassConfig, samples: list[tuple[float, float]]) -> None:
    one, two, both = (LowPass(config, channels=1, period_s=COMMAND_PERIOD_S) for _ in range(3))
    for first, second in samples:
        total = one.update(np.array([first])) + 2.0 * two.update(np.array([second]))
        # Analytic: rounding relative to inputs of 100.
        assert np.allclose(both.update(np.array([first + 2.0 * second])), total, atol=1e-10)


def test_a_returned_sample_stays_what_it_was() -> None:
    low_pass = LowPass(FirConfig(), channels=2, period_s=COMMAND_PERIOD_S)
    first = low_pass.update(np.ones(2))
    kept = first.copy()
    low_pass.update(np.full(2, 9.0))
    # Exact.
    assert np.array_equal(first, kept)


@pytest.mark.parametrize("taps", [2, 3, 5, 8])
def test_fir_is_linear_phase_with_half_its_length_as_delay(taps: int) -> None:
    low_pass = LowPass(FirConfig(taps=taps), period_s=COMMAND_PERIOD_S)
    for frequency in (0.0, 1.0, 5.0):
        # Analytic: (n − 1)/2 periods at every frequency.
        assert math.isclose(
            low_pass.group_delay_s(frequency), (taps - 1) / 2 * COMMAND_PERIOD_S, rel_tol=1e-9
        )


@pytest.mark.parametrize(("order", "delay_ms"), [(1, 11.582), (2, 16.379), (4, 30.265)])
def test_butterworth_delay_at_dc(order: int, delay_ms: float) -> None:
    low_pass = LowPass(IirConfig(order=order), period_s=COMMAND_PERIOD_S)
    # Analytic: bilinear transform, T/2 · Σ sin(pole angles) / tan(π f T).
    angles = math.pi * (2 * np.arange(1, order + 1) - 1) / (2 * order)
    delay = (
        COMMAND_PERIOD_S / 2 * np.sum(np.sin(angles)) / math.tan(math.pi * 10 * COMMAND_PERIOD_S)
    )
    assert math.isclose(low_pass.group_delay_s(0.0), delay, rel_tol=1e-9)
    # Golden: the same number, to the digits that the documentation quotes.
    assert 1e3 * delay == pytest.approx(delay_ms, abs=5e-4)


def test_fir_delays_more_than_the_butterworth_that_it_replaced() -> None:
    fir, iir = (
        LowPass(FirConfig(taps=3), period_s=COMMAND_PERIOD_S),
        LowPass(IirConfig(order=2), period_s=COMMAND_PERIOD_S),
    )
    # Analytic inequality in the pass band that matters for the loop.
    assert all(fir.group_delay_s(f) > iir.group_delay_s(f) for f in np.linspace(0, 5, 11))


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("cutoff_hz", [2.0, 10.0, 17.0])
def test_butterworth_has_the_corner_it_is_asked_for(order: int, cutoff_hz: float) -> None:
    config = IirConfig(order=order, cutoff_hz=cutoff_hz)
    # Analytic: the design pre-warps; limited by the root finder.
    assert LowPass(config, period_s=COMMAND_PERIOD_S).minus_3db_hz == pytest.approx(
        cutoff_hz, abs=1e-8
    )


def test_two_taps_have_their_corner_at_a_quarter_of_the_rate_whatever_is_asked() -> None:
    for cutoff_hz in (3.0, 10.0):
        low_pass = LowPass(FirConfig(taps=2, cutoff_hz=cutoff_hz), period_s=COMMAND_PERIOD_S)
        # Analytic: the mean of two samples, |H| = cos(π f T).
        assert low_pass.minus_3db_hz == pytest.approx(0.25 / COMMAND_PERIOD_S, abs=1e-8)


def test_three_hamming_taps_never_reach_minus_3_db() -> None:
    low_pass = LowPass(FirConfig(taps=3, cutoff_hz=10.0), period_s=COMMAND_PERIOD_S)
    end, middle, _ = low_pass.transfer_function()[0]
    assert low_pass.minus_3db_hz is None
    # Analytic: a symmetric 3-tap filter has H = middle + 2 end cos(2π f T).
    assert low_pass.gain(0.5 / COMMAND_PERIOD_S) == pytest.approx(middle - 2 * end, abs=1e-14)
    # Golden: what the documentation quotes.
    assert low_pass.gain(0.5 / COMMAND_PERIOD_S) == pytest.approx(0.836, abs=5e-4)
    assert low_pass.gain(10.0) == pytest.approx(0.903, abs=5e-4)


@pytest.mark.parametrize(
    ("taps", "window", "corner_hz"), [(5, "hamming", 7.92), (3, "boxcar", 6.31)]
)
def test_corner_of_short_fir_filters(taps: int, window: str, corner_hz: float) -> None:
    # Golden: what the documentation quotes for a design cut-off of 10 Hz.
    corner = LowPass(FirConfig(taps=taps, window=window), period_s=COMMAND_PERIOD_S).minus_3db_hz
    assert corner == pytest.approx(corner_hz, abs=5e-3)


@pytest.mark.parametrize("kind", [FirConfig, IirConfig])
@pytest.mark.parametrize("period_s", [COMMAND_PERIOD_S, 0.008])
def test_cutoff_at_nyquist_is_refused_with_value_and_limit(
    kind: type[FirConfig | IirConfig], period_s: float
) -> None:
    limit_hz = 0.5 / period_s
    LowPass(kind(cutoff_hz=limit_hz * (1.0 - 1e-9)), period_s=period_s)
    with pytest.raises(InputError, match=rf"cutoff_hz = .*below {limit_hz:.3f} Hz"):
        LowPass(kind(cutoff_hz=limit_hz), period_s=period_s)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        ("fir", {"taps": 0}),
        ("iir", {"order": 0}),
        ("iir", {"cutoff_hz": 0.0}),
        ("fir", {"window": "hann"}),
        ("fir", {"tapps": 3}),
        ("fir", {"order": 2}),
        ("none", {"cutoff_hz": 10.0}),
    ],
)
def test_wrong_settings_are_refused_by_name(kind: str, wrong: dict[str, Any]) -> None:
    with pytest.raises(msgspec.ValidationError, match=next(iter(wrong))):
        msgspec.convert({"kind": kind, **wrong}, LowPassConfig)
