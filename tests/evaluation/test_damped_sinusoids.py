"""Bounds of the fit of a damped sinusoid: which windows, how far from a guess, how fast."""

import math

import numpy as np
import pytest

from dualbend.evaluation import oscillation as osc
from dualbend.evaluation import sinusoids
from support.fits import windows

T = 0.028


def test_a_fit_moves_from_its_guess_by_bounded_steps_in_rate_and_frequency() -> None:
    """Noise pulls everywhere: per step at most 1/(nT) in σ and 1.5/(nT) in ω, four of which count.

    Of five poles that are compared the first is the guess.
    """
    count, number = 24, 3000
    bank = sinusoids._bank(count, T)
    moved = bank.detrended(np.random.default_rng(1).normal(size=(number, count)))
    guess = np.full(number, -1.0), np.full(number, 6.0 * math.pi)
    fit = sinusoids._refined(moved, np.arange(number), bank, guess)
    sigma = (fit.rate - guess[0]) * count * T
    omega = (2.0 * math.pi * fit.frequency - guess[1]) * count * T
    # Exact bounds, and with n = 3000 some come close to each.
    for shift, step in ((sigma, 1.0), (omega, 1.5)):
        assert 3.5 * step < shift.max() <= 4.0 * step * (1.0 + 1e-9)
        assert 3.5 * step < -shift.min() <= 4.0 * step * (1.0 + 1e-9)


def test_a_window_is_fitted_where_the_grid_tells_half_of_the_nearest_coarse_window() -> None:
    """Every eighth of a window one is compared with the grid; each start goes by the nearest."""
    count, stride = 48, 6
    moment = np.random.default_rng(4).normal(size=400)
    moment[150:300] += 3.0 * np.cos(2.0 * math.pi * 2.5 * np.arange(150) * T)
    bank = sinusoids._bank(count, T)
    shares = []
    for first in range(0, 400 - count + 1, stride):
        moved = bank.detrended(moment[first : first + count][np.newaxis])[0]
        most = max(float(((moved @ plane) ** 2).sum()) for plane in bank.planes)
        shares.append(most / float(moved @ moved))
    high = np.array(shares) > 0.5
    # Exact: from three rows before a coarse window to two after it.
    nearest = np.minimum((np.arange(400 - count + 1) + 3) // stride, high.size - 1)
    assert 0 < high.sum() < high.size
    found = sinusoids._of_length(moment, count, T).start
    assert found.tolist() == np.flatnonzero(high[nearest]).tolist()


def test_a_trend_is_cubic_from_a_window_of_1_7_s_on() -> None:
    assert [sinusoids.degree(s) for s in (1.69, 1.7, 1.71)] == [2, 3, 3]


def test_the_fit_of_the_longest_window_is_exact_at_the_fastest_rates() -> None:
    """e⁶ within 4.3 s: the ends of the wave are 400 apart."""
    count = round(0.336 * 1.26**11 / T)
    times = (np.arange(count) - (count - 1) / 2.0) * T
    bank = sinusoids._bank(count, T)
    rate = 6.0 / (count * T)
    moment = 0.05 * (np.exp((rate + 4j * math.pi) * times)).real
    guess = np.array([rate - 0.2]), np.array([4.0 * math.pi + 0.2])
    fit = sinusoids._refined(bank.detrended(moment[np.newaxis]), np.array([0]), bank, guess)
    # Analytic: the model is the signal.
    assert fit.rate[0] == pytest.approx(rate, abs=1e-6)
    assert 2.0 * math.pi * fit.frequency[0] == pytest.approx(4.0 * math.pi, abs=1e-6)


@pytest.mark.parametrize(("frequency_hz", "told"), [(6.9, True), (7.1, False)])
def test_no_oscillation_above_7_hz_is_told(frequency_hz: float, told: bool) -> None:
    """The fit finds it all the same, the grid goes beyond: what is told ends there."""
    times = np.arange(80) * T
    moment = 0.05 * np.exp(-0.5 * times) * np.cos(2.0 * math.pi * frequency_hz * times)
    fits = sinusoids._of_length(moment, 60, T)
    assert fits.frequency == pytest.approx(frequency_hz)
    assert osc._oscillating(fits, T).all() == told
    assert osc._oscillating(fits, T).any() == told
    # Exact, the bound itself belongs to it, at either end.
    assert osc._oscillating(windows(frequency=7.0), T).all()
    assert osc._frequency(windows(start=np.arange(60), frequency=7.0), T) == 7.0
    assert osc._frequency(windows(start=np.arange(60), frequency=1.0, rows=90), T) == 1.0


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_a_frequency_needs_a_residual_of_at_most_half_the_oscillation(size: float) -> None:
    for part, told in ((0.5, 2.5), (0.51, None)):
        fits = windows(start=np.arange(60), size=size, rest=part * size)
        assert osc._frequency(fits, T) == told  # exact


@pytest.mark.parametrize("other_hz", [2.1, 2.9])
def test_more_than_a_tenth_of_the_windows_must_not_differ(other_hz: float) -> None:
    """By 16 %: of 100 windows those at either end count beyond ten."""
    for number, told in ((9, 2.5), (12, None)):
        frequencies = np.where(np.arange(100) < number, other_hz, 2.5)
        found = osc._frequency(windows(start=np.arange(100), frequency=frequencies), T)
        assert found == told  # exact


def test_the_onset_of_at_most_six_windows_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not set in at once in six windows is not told by a seventh."""
    asked: list[int] = []

    def seventh(moment: object, fit: sinusoids.Fits, period_s: float) -> bool:
        asked.append(int(fit.start))
        return len(asked) == 7

    monkeypatch.setattr(osc, "_sets_in", seventh)
    times = np.arange(100) * T
    moment = np.exp(-0.5 * times) * np.cos(5.0 * math.pi * times)
    found = osc.oscillation_of(moment, T)
    assert len(set(asked)) == len(asked) == 6
    assert found.growth_per_s is None
    assert found.reason == "no exponential part reaches back to the onset"


def test_the_best_window_of_a_start_is_that_of_the_smallest_error_over_what_it_may_be() -> None:
    """A tenth of the rate: 0.105 of 0.24 1/s is less than 0.1 of 0.22 1/s."""
    fits = windows(
        start=np.array([0, 0, 1]),
        rate=np.array([-2.2, -2.4, -2.3]),
        error=np.array([0.1, 0.105, 0.2]),
    )
    assert osc._by_start(fits, np.ones(3, dtype=bool), T) == [1, 2]
