"""Where an onset is looked for, and what speaks for it: places, thresholds and exact cases."""

import math

import numpy as np
import pytest

from dualbend.evaluation import oscillation as osc
from dualbend.types import Vector
from support.fits import windows

T = 0.02


def wave(rows: int, rate: float = -1.0, frequency_hz: float = 2.5) -> Vector:
    """Return a damped sinusoid of about 1 N m rms (rows,)."""
    times = np.arange(rows) * T
    whole = np.exp((rate + 2j * math.pi * frequency_hz) * times)
    return np.asarray(math.sqrt(2.0) * whole.real)


def alternating(rows: int) -> Vector:
    """Return ±1 by turns, half the sampling frequency: of no law, and its own rms (rows,)."""
    return np.where(np.arange(rows) % 2, -1.0, 1.0)


# --- the pieces ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frequency_hz", "rows", "half", "long"),
    [
        (2.5, 90, 10, 40),  # half a period of 0.4 s in rows of 20 ms; two periods
        (1.25, 90, 20, 80),
        (1.25, 50, 20, 50),  # no longer than the window
        (6.9, 90, 8, 32),  # a half period of 3.6 rows counts as 8
    ],
)
def test_the_pieces_go_back_from_a_window_by_quarters_of_a_period(
    frequency_hz: float, rows: int, half: int, long: int
) -> None:
    fit = windows(start=200, rows=rows, frequency=frequency_hz).only(0)
    middles = range(200, 200 - long, -(half // 2))
    pieces = list(osc._pieces(fit, T))
    # Exact.
    assert [(first, stop) for first, stop, _ in pieces] == [
        (middle - 2 * half, middle + long) for middle in middles
    ]
    for middle, (_, _, onsets) in zip(middles, pieces, strict=True):
        assert onsets.tolist() == list(range(middle - 3 * half // 2, middle + half // 4))


def test_the_pieces_end_where_the_record_begins() -> None:
    pieces = list(osc._pieces(windows(start=17, rows=90, frequency=2.5).only(0), T))
    # Exact: middles 17, 12, 7; the third row is too early for one, the first for an onset.
    assert [(first, stop) for first, stop, _ in pieces] == [(0, 57), (0, 52), (0, 47)]
    assert [int(onsets[0]) for _, _, onsets in pieces] == [2, 1, 1]
    assert [int(onsets[-1]) for _, _, onsets in pieces] == [18, 13, 8]
    starts = [len(list(osc._pieces(windows(start=s).only(0), T))) for s in (2, 3)]
    assert starts == [0, 1]


# --- likelihood ratios --------------------------------------------------------------------------


@pytest.mark.parametrize(("ratio", "told"), [(50.1, True), (49.9, False)])
def test_an_onset_is_told_where_all_else_is_e_to_the_25_less_likely(
    ratio: float, told: bool
) -> None:
    """2 ln Λ = n ln(S₁/S₀) = 50: of n = 20, the rise leaves e^2.5 times the square."""
    own = np.array([4.0, 3.0, 1.0, 2.0])
    rising = math.exp(ratio / 20)
    assert osc._at_once(own, 40.0, rising, 20, 2.0) is told
    # Four times the observations, four times the evidence.
    assert osc._at_once(own, 40.0, rising, 80, 2.0) is True


@pytest.mark.parametrize(("ratio", "told"), [(40.1, None), (39.9, False)])
def test_a_rise_is_told_where_all_else_is_e_to_the_20_less_likely(
    ratio: float, told: bool | None
) -> None:
    own, rising = np.array([4.0, 3.0, 1.0, 2.0]), math.exp(-ratio / 20)
    assert osc._at_once(own, 40.0, rising, 20, 2.0) is told
    # The law throughout is an alternative as well.
    assert osc._at_once(20.0 * own, 1.0, rising, 20, 2.0) is told
    # A rise that does not explain the piece itself says nothing.
    assert osc._at_once(own, 40.0, rising, 20, 0.9 * math.sqrt(rising)) is False
    assert osc._at_once(own, 40.0, rising, 20, 1.1 * math.sqrt(rising)) is told


def test_an_onset_must_explain_the_piece_better_than_the_law_throughout() -> None:
    own = np.array([40.0, 30.0, 4.0, 20.0])
    # Exact: a residual of 2 N m, its square 4.
    assert osc._at_once(own, 4.1, 1e9, 20, 2.1) is True
    assert osc._at_once(own, 4.1, 1e9, 20, 1.9) is False
    assert osc._at_once(own, 4.0, 1e9, 20, 2.1) is False
    assert osc._at_once(own, 4.1, 1e9, 20, 2.0) is False


@pytest.mark.parametrize(
    ("best", "told"), [(0, False), (1, False), (2, True), (3, True), (4, True), (5, False)]
)
def test_an_onset_at_the_end_of_those_tried_may_lie_beyond_them(best: int, told: bool) -> None:
    own = np.full(6, 2.0)
    own[best] = 1.0
    assert osc._at_once(own, 9.0, 1e9, 20, 9.0) is told


# --- exact moments ------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [10, 30, 47])
@pytest.mark.parametrize(
    ("rest", "residual", "told"),
    [
        (0.01, 0.0, True),
        (0.01, 0.029, True),  # 3 % of the wave
        (0.01, 0.032, False),
        (0.03, 0.044, True),  # or 1.5 times the window's own residual
        (0.03, 0.047, False),
    ],
)
def test_a_law_that_holds_back_to_the_start_of_the_record_is_its_onset(
    start: int, rest: float, residual: float, told: bool
) -> None:
    fit = windows(start=start, rows=90, rest=rest).only(0)
    moment = wave(200) + residual * alternating(200)
    # Analytic: what alternates is all that any law leaves.
    assert osc._sets_in(moment, fit, T) is told


def test_a_law_that_fails_in_a_window_does_not_hold_back_to_the_start() -> None:
    """The record's first 60 rows are of the law: its last piece holds, not the window's own."""
    fit = windows(start=50, rows=90, rate=0.0).only(0)
    moment = wave(200, rate=0.0) + 0.01 * alternating(200)
    assert osc._sets_in(moment, fit, T) is True
    moment[62:74] += 0.3 * alternating(12)
    # Analytic: 0.3² 12/60 of the first piece, above 0.03².
    assert osc._sets_in(moment, fit, T) is False


@pytest.mark.parametrize("row", [60, 75])
@pytest.mark.parametrize("step", [0.0, 1.0])
def test_an_onset_at_once_is_told_with_and_without_a_step_of_the_mean(
    row: int, step: float
) -> None:
    since = np.arange(240 - row) * T
    moment = 1e-3 * np.random.default_rng(row).normal(size=240)
    moment[row:] += wave(240 - row) + step * (1.0 - np.exp(-10.0 * since))
    fit = windows(start=row + 6, rows=90).only(0)
    assert osc._sets_in(moment, fit, T) is True


@pytest.mark.parametrize("rate", [0.8, 1.2, 2.0, 3.2, 5.0, 8.0, 10.0])
@pytest.mark.parametrize("part", [0.0, 0.25])
def test_a_rise_before_a_steady_oscillation_is_no_onset_at_once(rate: float, part: float) -> None:
    """From nothing, or cut in at a quarter, up to row 80, and steady from there on."""
    before: Vector = (np.arange(240, dtype=np.float64) - 80.0) * T
    steady = wave(240, rate=0.0) * osc._rise(before, rate, part)
    noise = 1e-3 * np.random.default_rng(5).normal(size=240)
    fit = windows(start=84, rows=90, rate=0.0).only(0)
    assert not osc._sets_in(steady + noise, fit, T)


def test_each_rise_from_nothing_is_close_to_one_that_a_window_is_compared_with() -> None:
    before: Vector = np.linspace(-8.0, 0.0, 2001)
    compared = [osc._rise(before, *rise) for rise in osc._RISES]
    for rate in np.geomspace(0.8, 10.0, 40):
        rise = np.exp(rate * before)
        # Analytic: of rates r and k r the largest difference is (k-1) k^(-k/(k-1)), 0.13 of √2:
        # as far from the nearest where neighbours differ by a factor of two.
        assert min(float(np.abs(rise - other).max()) for other in compared) < 0.13


def test_rises_that_begin_at_a_quarter_are_compared_by_factors_of_at_most_two() -> None:
    # Exact: what a rise cut in at a quarter begins from, a row of 1 ms before its onset or more.
    before: Vector = np.arange(-4000.0, 1.0) / 1000.0
    first = [osc._rise(before, *rise)[osc._rise(before, *rise) > 0.0][0] for rise in osc._RISES]
    rates = np.unique([r for (r, _), f in zip(osc._RISES, first, strict=True) if 0.2 < f < 0.3])
    assert rates[0] <= 1.5 and rates[-1] >= 10.0
    assert (rates[1:] <= 2.0 * rates[:-1]).all()


def test_a_rise_from_its_whole_is_an_onset_at_once() -> None:
    before = np.array([-0.1, -1e-9, 0.0, 0.5])
    assert osc._rise(before, 5.0, 1.0).tolist() == [0.0, 0.0, 1.0, 1.0]  # exact


@pytest.mark.parametrize(("start", "told"), [(4, True), (5, False)])
def test_a_window_from_the_first_five_rows_needs_no_other_onset(start: int, told: bool) -> None:
    """What the pieces hold is of no law: white noise."""
    noise = np.random.default_rng(2).normal(size=200)
    assert osc._sets_in(noise, windows(start=start, rows=90).only(0), T) is told


def test_a_window_that_grows_by_e_is_its_own_evidence() -> None:
    noise = np.random.default_rng(2).normal(size=200)
    for grown, told in ((1.01, True), (0.99, False)):
        fit = windows(start=60, rows=50, rate=grown / (50 * T)).only(0)
        assert osc._sets_in(noise, fit, T) is told


@pytest.mark.parametrize(("row", "told"), [(3, True), (4, True), (5, False), (6, False)])
def test_an_onset_in_the_first_five_rows_is_that_of_the_record(row: int, told: bool) -> None:
    """Later ones need a likelihood ratio, and a window of 12 rows has too few for one."""
    moment = 0.025 * alternating(100)
    moment[row:] += wave(100 - row, rate=0.0)
    fit = windows(start=7, rows=12, rate=0.0).only(0)
    assert osc._sets_in(moment, fit, T) is told
