"""Onset and frequency in the oscillation measure: least squares of laws, windows that agree."""

import numpy as np
import pytest

from dualbend.evaluation import oscillation as osc
from dualbend.types import Vector
from support.fits import windows

T = 0.028


@pytest.mark.parametrize(("rows", "degree"), [(40, 2), (61, 2), (62, 3), (90, 3)])
def test_a_law_is_least_squares_in_trend_step_and_wave(rows: int, degree: int) -> None:
    piece = 0.3 + np.random.default_rng(rows).normal(size=rows)
    times: Vector = np.arange(rows) * T
    onsets = np.array([5, 9])
    before = times - times[onsets][:, None]
    fit = windows(rate=-1.5, frequency=2.5).only(0)
    laws = osc._Laws(piece, times, before, fit)
    envelope = np.where(before >= 0.0, 1.0, 0.3)
    wave = np.exp((-1.5 + 5j * np.pi) * times)
    for row, left in enumerate(laws.left(envelope)):
        since = np.maximum(before[row], 0.0)
        columns = np.column_stack(
            [
                np.vander(times, degree + 1),
                *(1.0 - np.exp(-rate * since) for rate in (3.0, 10.0)),
                envelope[row] * wave.real,
                envelope[row] * wave.imag,
            ]
        )
        found = np.linalg.lstsq(columns, piece, rcond=None)[0]
        # Analytic: numpy's own least squares; a constant is one of the columns.
        assert left == pytest.approx(float(((piece - columns @ found) ** 2).mean()), rel=1e-6)
    # Rows less the columns: trend, two steps, two parts of a wave, its rate and frequency.
    assert laws.freedom == rows - (degree + 1) - 2 - 4


def test_a_rise_is_exponential_up_to_its_onset_and_begins_at_a_part() -> None:
    before = np.array([-1.0, -0.2, -0.1, 0.0, 0.5])
    # Analytic.
    np.testing.assert_allclose(osc._rise(before, 10.0, 0.0), np.exp([-10.0, -2.0, -1.0, 0.0, 0.0]))
    np.testing.assert_allclose(osc._rise(before, 10.0, 0.25), [0.0, 0.0, np.exp(-1.0), 1.0, 1.0])


STARTS = np.arange(60)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({}, 2.5),
        ({"frequency": 0.99, "rows": 90}, None),
        ({"frequency": 1.01, "rows": 90}, 1.01),
        ({"frequency": 7.1}, None),
        ({"rows": 28}, None),  # less than two periods
        ({"rows": 29}, 2.5),
        ({"rate": -2.6}, None),
        ({"rate": 2.4}, 2.5),
        ({"rest": 0.51}, None),
        ({"rest": 0.49}, 2.5),
        ({"error": 0.05 * np.sqrt(50) * 5.0 * np.pi * 1.01}, None),
        ({"error": 0.05 * np.sqrt(50) * 5.0 * np.pi * 0.99}, 2.5),
        ({"frequency": np.linspace(2.38, 2.62, 60)}, 2.5),
        ({"frequency": np.linspace(2.3, 2.7, 60)}, None),
        ({"start": np.array([3, 3, 3])}, None),  # all of one start
    ],
)
def test_a_frequency_is_that_on_which_windows_agree(
    changed: dict[str, object], told: float | None
) -> None:
    found = osc._frequency(windows(**{"start": STARTS, **changed}), T)
    assert found == (None if told is None else pytest.approx(told))


def test_only_windows_of_at_least_half_the_largest_are_asked() -> None:
    sizes = np.where(STARTS < 56, 1.0, 0.49)
    frequencies = np.where(STARTS < 56, 2.5, 5.0)
    found = osc._frequency(windows(start=STARTS, size=sizes, frequency=frequencies), T)
    assert found == pytest.approx(2.5)


def test_windows_that_rise_are_tried_first_then_those_of_the_smallest_error() -> None:
    grown = 1.1 / (50 * T)
    fits = windows(
        start=np.array([0, 2, 4, 2]),
        rate=np.array([0.6, grown, 0.6, grown]),
        error=np.array([0.02, 0.1, 0.01, 0.05]),
    )
    # Exact: those that grow by more than e, one of each start, then the others.
    assert osc._by_start(fits, np.ones(4, dtype=bool), T) == [3, 2, 0]
    # A start by itself is an accident, and the next ones are looked at.
    apart = windows(start=np.array([0, 40, 41]), rate=-1.0, error=np.array([0.01, 0.1, 0.05]))
    assert osc._by_start(apart, np.ones(3, dtype=bool), T) == [2, 1]
