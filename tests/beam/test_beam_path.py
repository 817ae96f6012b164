"""Paths: what they share with the closed form, and what moment they cost by the rod."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualbend.beam import elastica as el
from dualbend.beam.path import ApproximatePath, ExactPath, PiecewiseLinearPath, TablePath
from dualbend.beam.rod.path_moment import worst_moment
from dualbend.errors import InputError
from support.sheets import PANEL

L = 0.6
PER_UNIT = L / PANEL.bending_stiffness_nm2
seeded = settings(max_examples=40, derandomize=True)


@given(target=st.floats(0.05, 2.2), pieces=st.integers(1, 20), part=st.floats(0.0, 0.9))
@seeded
def test_equal_pieces_follow_equation_6_put_right(target: float, pieces: int, part: float) -> None:
    start = part * target
    path = PiecewiseLinearPath.from_count(L, target, pieces, start_rad=start)
    # Analytic: α(k) = α₀ + (k/N)(α_d − α₀), both ends exact.
    assert path.knots == pytest.approx(start + np.arange(pieces + 1) / pieces * (target - start))
    assert (path.knots[0], path.knots[-1]) == (start, target)
    x, y = path.at(path.knots)
    assert x == pytest.approx(el.half_distance(path.knots, L), abs=1e-15)
    assert y == pytest.approx(el.rise(path.knots, L), abs=1e-15)


@given(target=st.floats(0.05, 2.2), interval=st.floats(0.02, 3.0))
@seeded
def test_last_piece_is_what_remains(target: float, interval: float) -> None:
    widths = np.diff(PiecewiseLinearPath.from_interval(L, target, interval).knots)
    # Analytic up to rounding.
    assert widths[:-1] == pytest.approx(interval, rel=1e-9)
    assert 0.0 < widths[-1] <= interval * (1 + 1e-6)
    assert widths.sum() == pytest.approx(target, rel=1e-12)


def test_an_interval_that_divides_leaves_no_sliver() -> None:
    path = PiecewiseLinearPath.from_interval(L, 1.2, 0.2)
    # Analytic: 1.2/0.2 is 5.999... in binary, yet six pieces.
    assert path.knots == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2], abs=1e-15)


def test_chords_lie_inside_the_curve_and_close_in_with_second_order() -> None:
    alpha = np.linspace(0.0, 1.2, 1201)
    gaps = []
    for pieces in (3, 6, 12, 24):
        x, _ = PiecewiseLinearPath.from_count(L, 1.2, pieces).at(alpha)
        gap = el.half_distance(alpha, L) - x
        # Analytic: x(α) is concave here, so a chord is never outside.
        assert gap.min() > -1e-15
        gaps.append(gap.max())
    orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
    # Discretisation: order 2.
    assert orders == pytest.approx(2.0, abs=0.1)


def test_moments_of_the_linear_pieces_are_those_of_figure_6() -> None:
    expected = {
        0.1: [0.201, 0.080, 0.048],
        0.2: [0.402, 0.157, 0.092, 0.062, 0.044, 0.032],
        0.4: [0.800, 0.295, 0.150],
    }
    for interval, peaks in expected.items():
        path = PiecewiseLinearPath.from_interval(L, 1.2, interval)
        worst = worst_moment(path, PANEL)
        found = worst.piece_moments_nm * PER_UNIT
        # Golden: three digits of an earlier model, in units of EI/L.
        assert found[: len(peaks)] == pytest.approx(peaks, abs=6e-4)
        assert worst.unsolved == 0
        assert worst.moment_nm == worst.piece_moments_nm[0]


def test_exact_path_has_no_moment_without_weight_and_a_small_one_with_it() -> None:
    path = ExactPath(L, 1.2, 0.05)
    # Analytic: zero, to rounding magnified by dM/dx at α = 0.05.
    assert worst_moment(path, PANEL).moment_nm * PER_UNIT < 1e-10
    heavy = worst_moment(path, PANEL, weight=True, stretch=True)
    # Golden (this model): 5.9 mN m near α = 0.14.
    assert heavy.moment_nm == pytest.approx(0.0059, abs=1e-4)


def worst_error(path: ApproximatePath) -> tuple[float, float]:
    """Return the largest |error| of x and of y [m] against the closed form."""
    alpha = np.linspace(path.start_rad, path.target_rad, 2001)
    x, y = path.at(alpha)
    return np.abs(x - el.half_distance(alpha, L)).max(), np.abs(y - el.rise(alpha, L)).max()


@pytest.mark.parametrize(
    ("degree", "x_error", "moment"), [(1, 7e-5, 2.6e-3), (2, 1.1e-7, 4e-6), (3, 8e-9, 3e-7)]
)
def test_polynomial_path_is_as_good_as_it_says(degree: int, x_error: float, moment: float) -> None:
    path = ApproximatePath(L, 1.2, degree=degree)
    dx, dy = worst_error(path)
    # Approximation-limited, the table of the class.
    assert dx / L < x_error
    assert dy / L < 3.3e-4
    assert worst_moment(path, PANEL).moment_nm * PER_UNIT < moment


def test_polynomial_starts_flat_and_improves_geometrically() -> None:
    errors = []
    for degree in range(1, 7):
        path = ApproximatePath(L, 1.2, degree=degree)
        # Analytic: x(0) = L/2, y(0) = 0.
        assert path.at(0.0) == (L / 2, 0.0)
        errors.append(worst_error(path)[1])
    # Approximation of an analytic function: each degree gains a factor of ten and more.
    assert np.all(np.array(errors[:-1]) / errors[1:] > 10.0)


def test_polynomial_leads_with_the_small_angle_coefficients() -> None:
    f, g = ApproximatePath(L, 1.0, degree=5).coefficients
    # Analytic: 1/8 and 1/π, approximation-limited at 1e-9.
    assert f[0] == pytest.approx(1 / 8, abs=1e-9)
    assert g[0] == pytest.approx(1 / math.pi, abs=1e-9)


@pytest.mark.parametrize(
    "path",
    [ExactPath(L, 1.0, 0.1), ApproximatePath(L, 1.0, 0.1), PiecewiseLinearPath(L, (0.1, 1.0))],
)
def test_paths_refuse_what_lies_off_them(path: ExactPath) -> None:
    x, y = path.at(0.5)
    assert isinstance(x, float)
    assert isinstance(y, float)
    assert path.at(np.array([0.1, 0.5, 1.0]))[0].shape == (3,)
    for alpha in (0.1 - 1e-9, 1.0 + 1e-9, math.nan):
        with pytest.raises(InputError, match="end slope"):
            path.at(alpha)


def test_refuses_impossible_paths() -> None:
    for make in (
        lambda: ExactPath(L, 2.5),
        lambda: ExactPath(L, 0.5, 0.5),
        lambda: ExactPath(-L, 0.5),
        lambda: PiecewiseLinearPath(L, (0.0, 0.5, 0.5)),
        lambda: PiecewiseLinearPath.from_count(L, 1.0, 0),
        lambda: PiecewiseLinearPath.from_interval(L, 1.0, -0.1),
        lambda: ApproximatePath(L, 1.0, degree=13),
        lambda: worst_moment(ExactPath(0.5, 1.0), PANEL),
        lambda: worst_moment(ExactPath(L, 1.0), PANEL, (0.2, 1.1)),
    ):
        with pytest.raises(InputError):
            make()


# --- a table ------------------------------------------------------------------------------------


def rows_of(alpha: np.ndarray) -> tuple[tuple[float, float, float], ...]:
    columns = (alpha, el.half_distance(alpha, L), el.rise(alpha, L))
    return tuple(zip(*(column.tolist() for column in columns), strict=True))


@given(target=st.floats(0.1, 2.2), pieces=st.integers(1, 12), at=st.floats(0.0, 1.0))
@seeded
def test_a_straight_table_of_knots_is_the_piecewise_path(
    target: float, pieces: int, at: float
) -> None:
    path = PiecewiseLinearPath.from_count(L, target, pieces)
    table = TablePath(L, rows_of(path.knots))
    # Analytic: the same interpolation.
    assert table.at(at * target) == pytest.approx(path.at(at * target), abs=1e-15)
    np.testing.assert_array_equal(table.knots, path.knots)


def test_a_smooth_table_converges_to_the_exact_path_with_fourth_order() -> None:
    """Away from the ends, where a natural spline has no curvature and the path has some."""
    inner = np.linspace(0.4, 0.6, 101)
    errors = []
    for rows in (11, 21, 41):
        table = TablePath(L, rows_of(np.linspace(0.0, 1.0, rows)), smooth=True)
        np.testing.assert_array_equal(table.knots, [0.0, 1.0])
        errors.append(float(np.abs(table.at(inner)[0] - el.half_distance(inner, L)).max()))
    # Discretisation-limited: observed order of a cubic spline.
    assert np.log2(np.divide(errors[:-1], errors[1:])).min() > 3.5


def test_a_part_of_a_table_keeps_the_knots_inside() -> None:
    table = TablePath(L, rows_of(np.array([0.0, 0.2, 0.4, 0.6])), False, 0.5, 0.1)
    assert table.knots == pytest.approx([0.1, 0.2, 0.4, 0.5])
    with pytest.raises(InputError, match="end slope"):
        table.at(0.55)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (((0.0, 0.3, 0.0),), "two or more rows"),
        (((0.0, 0.3, 0.0), (0.0, 0.3, 0.0)), "must grow"),
        (((0.0, 0.6, 0.0), (0.2, 0.59, 0.03)), "row 1: half distance"),
        (((0.0, 0.3, 0.0), (0.2, math.nan, 0.03)), "finite"),
    ],
)
def test_a_table_that_is_no_path_is_refused(
    rows: tuple[tuple[float, float, float], ...], text: str
) -> None:
    with pytest.raises(InputError, match=text):
        TablePath(L, rows)
