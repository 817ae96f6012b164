"""The closed form: against arithmetic of 50 digits, its limits, its inverses and its own energy."""

import math
from decimal import Decimal, getcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualbend.beam import elastica as el
from dualbend.errors import InputError

L, EI = 0.6, 0.575
FAR = el.END_SLOPE_GRIPPERS_MEET
slopes = st.floats(1e-9, FAR)
seeded = settings(max_examples=60, derandomize=True)


def high_precision(alpha: float) -> tuple[Decimal, Decimal, Decimal]:
    """Return (K, E/K, sin(α/2)) with 50 digits, by the arithmetic-geometric mean."""
    getcontext().prec = 60
    half, term, sine, n = Decimal(alpha) / 2, Decimal(alpha) / 2, Decimal(0), 1
    while abs(term) > Decimal(10) ** -58:
        sine, term = sine + term, -term * half * half / ((n + 1) * (n + 2))
        n += 2
    a, b, c, power, total = Decimal(1), (1 - sine * sine).sqrt(), sine, Decimal(1) / 2, Decimal(0)
    while abs(c) > Decimal(10) ** -55:
        total, power = total + power * c * c, power * 2
        a, b, c = (a + b) / 2, (a * b).sqrt(), (a - b) / 2
    pi = Decimal("3.14159265358979323846264338327950288419716939937510582097494")
    return pi / (2 * a), 1 - total, sine


@given(alpha=slopes)
@seeded
def test_closed_form_is_right_to_rounding(alpha: float) -> None:
    K, ratio, k = high_precision(alpha)
    # Analytic, tolerance of a few roundings (8 eps).
    eight_eps = 8 * np.finfo(float).eps
    assert el.end_force(alpha, EI, L) == pytest.approx(
        float((2 * K) ** 2) * EI / L**2, rel=eight_eps
    )
    assert el.half_distance(alpha, L) == pytest.approx(
        float(ratio - Decimal("0.5")) * L, rel=eight_eps, abs=eight_eps * L
    )
    assert el.shortening(alpha, L) == pytest.approx(float(1 - ratio) * L, rel=eight_eps)
    assert el.rise(alpha, L) == pytest.approx(float(k / K) * L, rel=eight_eps)
    assert el.curvature_max(alpha, L) == pytest.approx(float(4 * k * K) / L, rel=eight_eps)
    assert el.surface_strain(alpha, L, 1e-3) == pytest.approx(
        float(2 * k * K) / L * 1e-3, rel=eight_eps
    )


def test_flat_limit_is_the_euler_load() -> None:
    # Analytic: K(0) = E(0) = π/2.
    assert el.end_force(0.0, EI, L) == pytest.approx(math.pi**2 * EI / L**2, rel=1e-15)
    assert el.half_distance(0.0, L) == L / 2
    assert el.rise(0.0, L) == 0.0
    assert el.shortening(0.0, L) == 0.0


@given(alpha=st.floats(1e-8, 1e-2))
@seeded
def test_shallow_sheet_has_the_small_angle_shortening_and_rise(alpha: float) -> None:
    # Analytic: L/2 − x = α² L/8 (1 + O(α²)), y = α L/π (1 + O(α²)).
    assert el.shortening(alpha, L) == pytest.approx(alpha**2 * L / 8, rel=alpha**2 + 1e-14)
    assert el.rise(alpha, L) == pytest.approx(alpha * L / math.pi, rel=alpha**2 + 1e-14)


@given(alpha=slopes)
@seeded
def test_inverses_return_the_end_slope(alpha: float) -> None:
    # Analytic: rounding only, times the conditioning of each inverse.
    assert el.end_slope_from_shortening(el.shortening(alpha, L), L) == pytest.approx(
        alpha, rel=1e-13
    )
    x = el.half_distance(alpha, L)
    magnified = 4 * 1.2e-16 / alpha + 1e-13
    assert el.end_slope_from_half_distance(x, L) == pytest.approx(alpha, abs=2 * magnified)


def test_rise_is_largest_where_stated() -> None:
    top = el.END_SLOPE_HIGHEST_RISE
    # Analytic: a maximum, so quadratic in the distance to it.
    assert el.rise(top - 1e-3, L) < el.rise(top, L) > el.rise(top + 1e-3, L)


def test_grippers_meet_at_the_end_of_the_range() -> None:
    # Analytic root: E/K = 1/2; 2.2813 rad is the known closed figure-of-eight half.
    assert el.half_distance(FAR, L) == pytest.approx(0.0, abs=1e-15)
    assert pytest.approx(2.2813, abs=1e-4) == FAR


@pytest.mark.parametrize("alpha", [0.2, 1.0, 2.0, FAR])
def test_shape_is_a_curve_of_its_slope_and_meets_the_end_formulas(alpha: float) -> None:
    s = np.linspace(0.0, L, 4001)
    x, z, theta = el.shape(alpha, L, s)
    # Analytic: end points, middle, symmetry.
    assert x[0] == pytest.approx(-el.half_distance(alpha, L), abs=1e-15)
    assert z[2000] == pytest.approx(-el.rise(alpha, L), abs=1e-15)
    assert z[[0, -1]] == pytest.approx(0.0, abs=1e-15)
    assert theta[[0, 2000, -1]] == pytest.approx([alpha, 0.0, -alpha], abs=1e-14)
    # Discretisation-limited: central differences, second order in 0.15 mm.
    h = s[1] - s[0]
    assert np.gradient(x, s)[1:-1] == pytest.approx(np.cos(theta)[1:-1], abs=1e2 * h**2)
    assert np.gradient(z, s)[1:-1] == pytest.approx(-np.sin(theta)[1:-1], abs=1e2 * h**2)
    # The moment EI dθ/ds balances the end force on the lever −z.
    moment = EI * np.gradient(theta, s)[1:-1]
    force = el.end_force(alpha, EI, L)
    assert moment == pytest.approx(force * z[1:-1], abs=1e3 * h**2)


@pytest.mark.parametrize("alpha", [0.3, 1.0, 2.0])
def test_work_of_the_end_force_is_the_bending_energy(alpha: float) -> None:
    # Without end moments dU = P d(shortening of the chord). Quadrature-limited: Gauss, 60 points.
    node, weight = np.polynomial.legendre.leggauss(60)
    a = alpha * (node + 1) / 2
    h = 1e-5
    rate = (el.shortening(a + h, L) - el.shortening(a - h, L)) / (2 * h)
    work = float(np.sum(weight * alpha / 2 * el.end_force(a, EI, L) * 2 * rate))
    s = L * (node + 1) / 2
    bend = el.end_force(alpha, EI, L) * el.shape(alpha, L, s)[1] / EI
    energy = 0.5 * EI * float(np.sum(weight * L / 2 * bend**2))
    assert work == pytest.approx(energy, rel=1e-8)


@given(alpha=slopes, scale=st.floats(0.1, 10.0))
@seeded
def test_scales_with_length_and_stiffness(alpha: float, scale: float) -> None:
    # Analytic scaling laws: x ~ L, κ ~ 1/L, P ~ EI/L².
    assert el.half_distance(alpha, scale * L) == pytest.approx(
        scale * el.half_distance(alpha, L), rel=1e-13, abs=1e-16
    )
    assert el.curvature_max(alpha, scale * L) * scale == pytest.approx(
        el.curvature_max(alpha, L), rel=1e-14
    )
    assert el.end_force(alpha, EI * scale**2, L * scale) == pytest.approx(
        el.end_force(alpha, EI, L), rel=1e-14
    )


def test_arrays_and_floats_agree() -> None:
    alpha = np.array([[0.0, 0.5], [1.0, 2.0]])
    x = el.half_distance(alpha, L)
    assert x.shape == (2, 2)
    # Analytic: the same arithmetic.
    assert x[1, 0] == el.half_distance(1.0, L)
    assert isinstance(el.half_distance(1.0, L), float)


@pytest.mark.parametrize("alpha", [-1e-9, FAR + 1e-9, math.nan, math.inf])
def test_refuses_end_slopes_off_the_range_and_names_it(alpha: float) -> None:
    for function in (el.half_distance, el.rise, el.shortening, el.curvature_max):
        with pytest.raises(InputError, match=r"α.*\[0, 2\.28"):
            function(alpha, L)
    with pytest.raises(InputError, match="α"):
        el.half_distance(np.array([0.1, alpha]), L)


def test_refuses_positions_that_no_sheet_reaches() -> None:
    with pytest.raises(InputError, match="half distance"):
        el.end_slope_from_half_distance(0.31, L)
    with pytest.raises(InputError, match="L must"):
        el.half_distance(0.1, -1.0)
