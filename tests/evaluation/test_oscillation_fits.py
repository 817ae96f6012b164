"""The parts of the oscillation measure: one window's fit, and whether it tells a rate."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from dualbend.evaluation import oscillation as osc
from dualbend.evaluation import sinusoids
from dualbend.evaluation.oscillation import oscillation_of
from dualbend.types import Vector
from support.fits import windows

T = 0.028
RNG = np.random.default_rng(7)


def fitted(y: Vector, rate: float, frequency_hz: float) -> sinusoids.Fits:
    """Return the fit of one window (rows,) from a guess nearby."""
    bank = sinusoids._bank(y.size, T)
    guess = np.array([rate]), np.array([2.0 * np.pi * frequency_hz])
    return sinusoids._refined(bank.detrended(y[np.newaxis]), np.array([0]), bank, guess)


def middle_times(count: int) -> Vector:
    return (np.arange(count) - (count - 1) / 2.0) * T


def parabola(times: Vector) -> Vector:
    return 0.02 - 0.01 * times + 0.03 * times**2


# --- the amplitude ------------------------------------------------------------------------------


@pytest.mark.parametrize("half_periods", [1, 2, 4, 8])
def test_the_amplitude_is_that_of_a_high_pass_passed_twice(half_periods: int) -> None:
    """Of a burst that comes and goes slowly; in 36 rows, a second, are so many half periods."""
    frequency_hz = half_periods / 2.0 / (36 * T)
    wave = np.sin(2.0 * np.pi * frequency_hz * np.arange(4000) * T)
    found = osc._amplitude(0.1 * np.hanning(4000) * wave, T)
    # Analytic: a Butterworth of second order at 1 Hz, forward and backward, 1/(1 + f⁻⁴), f warped
    # by the bilinear transform.
    warped = math.tan(math.pi * frequency_hz * T) / math.tan(math.pi * T)
    assert found == pytest.approx(0.1 / (1.0 + warped**-4), rel=2e-3)


def test_a_record_tells_its_amplitude_from_one_second_on() -> None:
    short, enough = (oscillation_of(np.zeros(n), T) for n in (35, 36))
    assert short.amplitude_nm is None
    assert short.reason == "shorter than 1 s"
    assert enough.amplitude_nm == 0.0
    # The largest second counts: a burst of 40 rows in a quiet record.
    burst = np.zeros(400)
    burst[200:240] = 0.1 * np.sin(2.0 * np.pi * 4.0 * np.arange(40) * T)
    assert oscillation_of(burst, T).amplitude_nm == pytest.approx(0.1, rel=0.1)


# --- the fit of a window ------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "degree"), [(30, 2), (60, 2), (61, 3), (120, 3)])
def test_a_damped_sinusoid_on_a_polynomial_is_found_from_a_guess(count: int, degree: int) -> None:
    times = middle_times(count)
    assert sinusoids.degree(count * T) == degree
    trend = parabola(times) + (0.02 * times**3 if degree == 3 else 0.0)
    wave = 0.05 * np.exp(-1.3 * times) * np.cos(2.0 * np.pi * 2.4 * times + 0.7)
    fit = fitted(trend + wave, -0.9, 2.3)
    # Analytic: the model is the signal; five Gauss-Newton steps.
    assert fit.rate[0] == pytest.approx(-1.3, abs=1e-4)
    assert fit.frequency[0] == pytest.approx(2.4, abs=1e-5)
    assert fit.rows[0] == count
    assert fit.rest[0] < 1e-4 * fit.size[0]
    assert fit.bend[0] < 1e-2
    # Analytic: the root mean square of the oscillation, 1/√2 of its local amplitude.
    envelope = 0.05 * np.exp(-1.3 * times)
    assert fit.size[0] == pytest.approx(math.sqrt((envelope**2).mean() / 2.0), rel=1e-4)


@pytest.mark.parametrize(("rate", "frequency_hz"), [(-1.0, 2.5), (1.5, 1.7), (0.0, 4.0)])
@pytest.mark.parametrize("count", [50, 90])
def test_the_error_of_a_rate_is_four_standard_errors_by_cramer_and_rao(
    rate: float, frequency_hz: float, count: int
) -> None:
    times, degree = middle_times(count), sinusoids.degree(count * T)
    wave = 0.05 * np.exp((rate + 2j * np.pi * frequency_hz) * times + 0.4j)
    noise = 1e-4 * np.random.default_rng(count).normal(size=count)
    fit = fitted(parabola(times) + wave.real + noise, rate, frequency_hz)
    # Analytic: the Jacobian of all parameters, trend, amplitude and phase, rate and frequency.
    best = np.exp((fit.rate[0] + 2j * np.pi * fit.frequency[0]) * times)
    trend = np.vander(times, degree + 1)
    linear = np.column_stack([trend, best.real, -best.imag])
    y = parabola(times) + wave.real + noise
    found = np.linalg.lstsq(linear, y, rcond=None)[0]
    whole = best * complex(*found[-2:])
    jacobian = np.column_stack([linear, times * whole.real, -times * whole.imag])
    residual = y - linear @ found
    variance = residual @ residual / (count - (degree + 1) - 4)
    spread = math.sqrt(variance * np.linalg.inv(jacobian.T @ jacobian)[-2, -2])
    white = sinusoids._white(residual[np.newaxis])[0]
    coloured = 1.0 if white else math.sqrt(count)
    assert fit.error[0] == pytest.approx(4.0 * spread * coloured, rel=1e-3)
    assert fit.rest[0] == pytest.approx(math.sqrt((residual**2).mean()), rel=1e-4)


def test_what_is_slower_than_the_pieces_of_a_path_is_never_taken_for_noise() -> None:
    """Its residual is of the path: the error counts as if all rows said the same."""
    count = 90
    times = middle_times(count)
    ratios = []
    for seed in range(12):
        noise = 1e-4 * np.random.default_rng(seed).normal(size=count)
        slow, fast = (
            float(fitted(0.05 * np.cos(2.0 * np.pi * f * times) + noise, 0.0, f).error[0])
            for f in (0.99, 1.01)
        )
        ratios.append(slow / fast)
    # Analytic: √n, n = 90, of nearly the same wave; or 1 where the noise does not look white.
    told = np.isclose(ratios, math.sqrt(count), rtol=0.1)
    assert np.isclose(np.array(ratios)[~told], 1.0, rtol=0.1).all()
    assert told.sum() >= 6


@pytest.mark.parametrize("curved", [0.2, -0.1])
def test_the_bend_is_the_change_of_the_rate_between_middle_and_end(curved: float) -> None:
    count = 80
    times = middle_times(count)
    wave = 0.05 * np.exp(0.5 * times + curved * times**2) * np.cos(2.0 * np.pi * 3.0 * times)
    fit = fitted(wave, 0.5, 3.0)
    # Analytic, first order in the change: the rate is σ + 2 c t, so c n T from middle to end.
    assert fit.bend[0] == pytest.approx(abs(curved) * count * T, rel=0.1)


def test_a_plane_is_least_squares_in_two_regressors() -> None:
    a, b, y = RNG.normal(size=(3, 5, 20))
    plane = sinusoids._Plane(a, b)
    p, q = plane.fit(y)
    off = plane.off(y)
    for i in range(5):
        # Analytic: numpy's own least squares.
        expected = np.linalg.lstsq(np.column_stack([a[i], b[i]]), y[i], rcond=None)[0]
        np.testing.assert_allclose([p[i], q[i]], expected, rtol=1e-9)
        np.testing.assert_allclose([off[i] @ a[i], off[i] @ b[i]], 0.0, atol=1e-12)
    # Where there is no plane nothing is fitted.
    none = sinusoids._Plane(a, 2.0 * a)
    assert np.abs(np.stack(none.fit(y))).max() < 1e30


def test_the_trend_of_a_window_is_a_polynomial_and_the_grid_covers_what_is_looked_for() -> None:
    for count, degree in ((40, 2), (100, 3)):
        bank = sinusoids._bank(count, T)
        times = middle_times(count)
        np.testing.assert_allclose(bank.times, times, atol=1e-12)
        powers = np.stack([times**k for k in range(degree + 1)])
        np.testing.assert_allclose(bank.detrended(powers), 0.0, atol=1e-12)
        assert np.abs(bank.detrended((times ** (degree + 1))[np.newaxis])).max() > 1e-3
        frequencies = np.unique(bank.omega) / (2.0 * np.pi)
        # From one period in the window to beyond 7 Hz, in steps that a fit can start from.
        assert frequencies[0] == pytest.approx(1.0 / (count * T))
        assert frequencies[-1] > 7.0
        assert np.diff(frequencies).max() <= 0.4 / (count * T) + 1e-9
        assert bank.rate.min() < 0.0 < bank.rate.max()
        assert np.abs(bank.rate).max() * count * T < 7.0
        # Rates in steps of 0.75 1/s, or of one over the window where that is more, up to 12 1/s.
        steps = np.diff(np.unique(bank.rate))
        assert steps == pytest.approx(max(1.0 / (count * T), 0.75))
        assert np.abs(bank.rate).max() <= 12.0
        # Each plane holds the wave of its own pole.
        for i in RNG.integers(bank.rate.size, size=20).tolist():
            wave = np.exp((bank.rate[i] + 1j * bank.omega[i]) * times)
            for part in (wave.real, wave.imag):
                moved = bank.detrended(part[np.newaxis])[0]
                np.testing.assert_allclose(
                    bank.planes[i] @ (bank.planes[i].T @ moved), moved, atol=1e-9
                )
        # An orthonormal pair for each pole, free of the trend.
        products = np.einsum("pni,pnj->pij", bank.planes, bank.planes)
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(2), products.shape), atol=1e-9)
        assert np.abs(np.einsum("nk,pni->pki", bank.trend, bank.planes)).max() < 1e-9


def test_short_windows_are_looked_at_with_all_rates() -> None:
    bank = sinusoids._bank(12, T)
    assert np.unique(bank.rate)[[0, -1]] == pytest.approx([-12.0, 12.0], abs=1.0 / (12 * T))
    assert np.abs(bank.rate).max() <= 12.0


def test_windows_have_every_length_from_12_rows_to_four_seconds() -> None:
    """A law that holds for long is told by long windows, one that ends soon by short ones."""
    wave = np.cos(2.0 * np.pi * 3.1 * np.arange(160) * T)
    found = np.unique(sinusoids.fitted(wave, T).rows)
    # Exact: each 1.26 times the one before, in whole rows.
    assert found.tolist() == [round(12 * 1.26**i) for i in range(12)]


@pytest.mark.parametrize("count", [60, 200])
def test_white_noise_is_white_as_often_as_the_test_says(count: int) -> None:
    noise = np.random.default_rng(3).normal(size=(4000, count))
    # Statistical, n = 4000, four standard errors: Ljung and Box's Q of 12 lags is χ²₁₂, below 16.8.
    expected = float(chi2.cdf(1.4 * 12, 12))
    spread = 4.0 * math.sqrt(expected * (1.0 - expected) / 4000) + 3.0 / count
    assert sinusoids._white(noise).mean() == pytest.approx(expected, abs=spread)
    walk = np.cumsum(noise[:100], axis=1)
    assert not sinusoids._white(walk - walk.mean(axis=1, keepdims=True)).any()


def test_the_whiteness_of_a_series_by_hand() -> None:
    """Ljung and Box (1978): Q = n (n + 2) Σ ρ_k²/(n − k) over 12 lags, n/3 if that is less."""
    for count, lags in ((15, 5), (36, 12), (60, 12)):
        series = np.random.default_rng(count).normal(size=(200, count))
        told = sinusoids._white(series)
        for row, white in zip(series, told, strict=True):
            rho = [row[k:] @ row[:-k] / (row @ row) for k in range(1, lags + 1)]
            q = count * (count + 2) * sum(r**2 / (count - k) for k, r in enumerate(rho, start=1))
            assert white == (q < 1.4 * lags)


# --- which windows tell -------------------------------------------------------------------------


def telling(fits: sinusoids.Fits, period_s: float) -> tuple[NDArray[np.bool_], str]:
    return osc._telling(fits, osc._oscillating(fits, period_s), period_s)


NOISE, NOTHING = "too short or too noisy to tell a rate", "nothing oscillates well above"
BENT = "its amplitude is nowhere exponential for long enough"


@pytest.mark.parametrize(
    ("changed", "tells", "says"),
    [
        ({}, True, ""),
        # No slower than 0.45 Hz, no faster than 7 Hz.
        ({"frequency": 0.46, "rows": 90}, True, ""),
        ({"frequency": 0.44, "rows": 90}, False, NOTHING),
        ({"frequency": 6.9}, True, ""),
        ({"frequency": 7.1}, False, NOTHING),
        # At most e⁴ in a period, e⁶ in the window, at least one period of it.
        ({"rate": -4.0, "frequency": 1.01, "rows": 50}, True, ""),
        ({"rate": -4.1, "frequency": 1.01, "rows": 50}, False, NOTHING),
        ({"rate": 4.1, "rows": 51, "error": 0.3}, True, ""),
        ({"rate": 4.4, "rows": 51, "error": 0.3}, False, NOTHING),
        ({"frequency": 0.75, "rows": 48}, True, ""),
        ({"frequency": 0.75, "rows": 47}, False, NOTHING),
        # A residual below a quarter of the oscillation.
        ({"rest": 0.24}, True, ""),
        ({"rest": 0.49, "size": 2.0}, True, ""),
        ({"rest": 0.26}, False, NOTHING),
        # An error of at most 0.2 1/s or a tenth, a bend of half of that.
        ({"error": 0.19}, True, ""),
        ({"error": 0.21}, False, NOISE),
        ({"rate": -3.0, "error": 0.29}, True, ""),
        ({"rate": -3.0, "error": 0.31}, False, NOISE),
        ({"bend": 0.099}, True, ""),
        ({"bend": 0.101}, False, BENT),
        ({"rate": 3.0, "bend": 0.149}, True, ""),
        ({"rate": 3.0, "bend": 0.151}, False, BENT),
    ],
)
def test_a_window_tells_a_rate_up_to_each_of_its_bounds(
    changed: dict[str, Any], tells: bool, says: str
) -> None:
    told, reason = telling(windows(**changed), T)
    assert told.tolist() == [tells]
    assert reason.startswith(says)
    assert bool(reason) is not tells


@pytest.mark.parametrize(
    "edge",
    [{"rate": -3.0, "frequency": 0.75}, {"rate": -1.0, "frequency": 0.5}],
    ids=["e⁴ in a period and e⁶ in the window", "one period of it"],
)
def test_a_bound_itself_is_allowed(edge: dict[str, float]) -> None:
    # Exact in binary: four rows of half a second.
    told, _ = telling(windows(rows=4, **edge), 0.5)
    assert told.tolist() == [True]


def test_a_record_of_exactly_a_second_is_long_enough() -> None:
    found = oscillation_of(np.zeros(64), 1.0 / 64.0)
    assert found.amplitude_nm == 0.0


def test_an_oscillation_below_a_tenth_of_the_largest_does_not_count() -> None:
    told, _ = telling(windows(size=np.array([1.0, 0.11, 0.09])), T)
    assert told.tolist() == [True, True, False]
    # The largest of those that oscillate.
    told, _ = telling(windows(size=np.array([1.0, 0.11]), rest=np.array([0.9, 0.01])), T)
    assert told.tolist() == [False, True]
