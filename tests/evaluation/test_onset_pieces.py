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


def test_a_law_that_fails_before_the_window_does_not_hold_at_the_start() -> None:
    """The record's first 30 rows are of the law; then it is off by a kick of 12 rows."""
    fit = windows(start=46, rows=90).only(0)
    moment = wave(200)
    moment[32:44] += 0.3 * alternating(12)
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


@pytest.mark.parametrize(("rate", "part"), osc._RISES)
def test_no_rise_is_an_onset_at_once(rate: float, part: float) -> None:
    """A steady oscillation that rose, by each of the laws of a rise, before row 80."""
    before: Vector = (np.arange(240, dtype=np.float64) - 80.0) * T
    steady = wave(240, rate=0.0) * osc._rise(before, rate, part)
    noise = 1e-3 * np.random.default_rng(5).normal(size=240)
    fit = windows(start=84, rows=90, rate=0.0).only(0)
    assert osc._sets_in(steady + noise, fit, T) is None


def test_rises_from_nothing_cover_what_a_window_sees_within_a_factor_of_two_in_rate() -> None:
    rates = np.unique([rate for rate, part in osc._RISES])
    assert rates[0] < 1.0 and rates[-1] >= 10.0
    assert (rates[1:] < 2.0 * rates[:-1]).all()


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
