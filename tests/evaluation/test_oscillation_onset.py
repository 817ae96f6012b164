"""The onset in the oscillation measure: whether what was before a window is what its law says."""

import math

import numpy as np
import pytest

from dualbend.evaluation import oscillation as osc
from dualbend.types import Vector
from support.fits import windows

T = 0.028


def record(before: complex, rate: float, frequency_hz: float, rows: int = 60) -> Vector:
    """Return 60 rows with the wave times ``before``, then ``rows`` of the wave, on a parabola."""
    times = np.arange(-60, rows) * T
    wave = np.exp((rate + 2j * np.pi * frequency_hz) * times + 0.3j)
    wave = np.where(times < -1e-9, before * wave, wave)
    return 0.3 + 0.2 * times - 0.1 * times**2 + wave.real


def window_of(rate: float, frequency_hz: float, rest: float = 1e-6, rows: int = 60) -> osc._Fits:
    fits = windows(start=60, rows=rows, rate=rate, frequency=frequency_hz, rest=rest)
    return fits.only(0)


@pytest.mark.parametrize("before", [0.0, 1.0, 0.5, 0.4 + 0.3j, -1.0])
@pytest.mark.parametrize("rows", [4, 10, 14])
def test_what_was_before_a_window_is_told_as_a_ratio(before: complex, rows: int) -> None:
    rate, frequency_hz = -0.8, 2.5
    ratio, error = osc._before(
        record(before, rate, frequency_hz),
        window_of(rate, frequency_hz),
        rows,
        complex(rate, 2.0 * np.pi * frequency_hz),
        T,
    )
    # Analytic: least squares of the signal's own terms.
    assert ratio == pytest.approx(before, abs=1e-6)
    assert 0.0 < error < 1e-3


def test_the_error_of_a_ratio_is_its_spread_under_noise() -> None:
    rate, frequency_hz, rows, noise = -0.8, 2.5, 10, 0.02
    fit, pole = window_of(rate, frequency_hz, rest=noise), complex(rate, 2 * np.pi * frequency_hz)
    clean = record(0.0, rate, frequency_hz)
    rng = np.random.default_rng(2)
    found = [
        osc._before(clean + noise * rng.normal(size=clean.size), fit, rows, pole, T)
        for _ in range(1500)
    ]
    ratios = np.array([ratio for ratio, _ in found])
    # Statistical, n = 1500: 2.6 % for a root mean square of both parts; the ratio's own
    # denominator is noisy too, by a few parts in a hundred.
    spread = math.sqrt((np.abs(ratios) ** 2).mean() / 2.0)
    assert np.mean([error for _, error in found]) == pytest.approx(spread, rel=0.1)


@pytest.mark.parametrize(
    ("rate", "before", "begins"),
    [
        # Decay begins at its onset: nothing was there.
        (-1.0, 0.0, True),
        (-1.0, 0.04, True),
        (-1.0, 0.06, False),
        (-1.0, 1.0, False),
        # Growth begins so too, or goes on from earlier, within 0.3 of its own law.
        (2.0, 0.0, True),
        (2.0, 1.0, True),
        (2.0, 1.28, True),
        (2.0, 0.72, True),
        # By less than √e in the window (0.3 1/s times 1.68 s): too little to be growth.
        (0.29, 1.0, False),
        (0.31, 1.0, True),
        (0.29, 0.0, True),
        # By more than e it may come out of what is no larger than itself by half.
        (0.7, 1.4, True),
        (0.7, 1.6, False),
        (0.58, 1.4, False),
        (0.58, 0.72, True),
        (0.58, 0.68, False),
    ],
)
def test_a_law_holds_from_its_onset_on(rate: float, before: float, begins: bool) -> None:
    moment = record(before, rate, 2.5)
    assert osc._begins(moment, window_of(rate, 2.5), T) is begins


def test_a_window_at_the_start_of_the_record_has_nothing_before_it() -> None:
    moment = record(0.0, -1.0, 2.5)[60:]
    fit = windows(start=0, rows=60, rate=-1.0, frequency=2.5, rest=1e-6).only(0)
    assert osc._begins(moment, fit, T)


@pytest.mark.parametrize(
    ("start", "frequency_hz", "looked"),
    [(60, 2.5, [4, 4, 5, 7, 14]), (60, 1.0, [5, 9, 12, 18, 36]), (6, 1.0, [5, 6, 6, 6, 6])],
)
def test_it_is_looked_up_to_a_period_back(
    start: int, frequency_hz: float, looked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def before(_: Vector, __: osc._Fits, rows: int, *___: object) -> tuple[complex, float]:
        seen.append(rows)
        return 0.0, 0.0

    monkeypatch.setattr(osc, "_before", before)
    fit = windows(start=start, frequency=frequency_hz).only(0)
    assert osc._begins(np.zeros(200), fit, T)
    # Exact: 0.15, 0.25, 0.35, 0.5 and 1 period, at least four rows, no more than there are.
    assert seen == looked


@pytest.mark.parametrize(("start", "looks"), [(3, True), (2, False)])
def test_three_rows_are_enough_to_look_at(
    start: int, looks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(osc, "_before", lambda *_: (1.0, 0.0))
    # A decay after something as large is none from its onset; after nothing seen it is.
    assert osc._begins(np.zeros(200), windows(start=start).only(0), T) is not looks


DECAYS, RISES, GROWS = -1.0, 0.8 / (50 * T), 1.2 / (50 * T)
"""Rates [1/s]: of a window that decays, grows by e^0.8 (less than e), and by more than e."""


@pytest.mark.parametrize(
    ("rate", "ratio", "error", "begins"),
    [
        # Nothing before: c with its error below 0.2, and hardly more than twice that error.
        (DECAYS, 0.0, 0.19, True),
        (DECAYS, 0.0, 0.21, False),
        (DECAYS, 0.1, 0.05, True),
        (DECAYS, 0.1, 0.02, False),
        (DECAYS, 0.04, 0.0, True),
        (DECAYS, 0.06, 0.0, False),
        (DECAYS, -0.1, 0.02, False),
        # Its own law: c within 0.3 and two errors of 1.
        (RISES, 1.35, 0.04, True),
        (RISES, 1.35, 0.02, False),
        (RISES, 0.65, 0.04, True),
        (RISES, 0.65, 0.02, False),
        (RISES, 0.29j + 1.0, 0.0, True),
        (RISES, 0.31j + 1.0, 0.0, False),
        # Out of the noise: c less two errors below 1.5.
        (GROWS, 1.9, 0.21, True),
        (GROWS, 1.9, 0.19, False),
        (GROWS, -1.4, 0.0, True),
        (GROWS, -1.6, 0.0, False),
        (RISES, -1.4, 0.0, False),
    ],
)
def test_what_was_before_is_judged_with_its_error(
    rate: float, ratio: complex, error: float, begins: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(osc, "_before", lambda *_: (ratio, error))
    assert osc._begins(np.zeros(200), windows(start=60, rate=rate).only(0), T) is begins


@pytest.mark.parametrize(("rate", "begins"), [(GROWS, True), (RISES, False)])
def test_a_whole_period_back_growth_may_come_out_of_anything(
    rate: float, begins: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(osc, "_before", lambda _, __, rows, *___: (9.0 if rows > 10 else 0.5, 0.0))
    assert osc._begins(np.zeros(200), windows(start=60, rate=rate).only(0), T) is begins


@pytest.mark.parametrize("large", [4, 5, 7])
def test_nearer_than_a_period_nothing_may_be_larger_than_growth_itself(
    large: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 4, 4, 5, 7 and 14 rows back, all but the last count."""
    monkeypatch.setattr(
        osc, "_before", lambda _, __, rows, *___: (9.0 if rows == large else 0.5, 0.0)
    )
    assert not osc._begins(np.zeros(200), windows(start=60, rate=GROWS).only(0), T)
