"""The rod where it is nearly flat, taut, heavy, or not to be had: limits with known answers."""

import math

import numpy as np
import pytest

from dualbend.beam import elastica as el
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.state import RESIDUAL_TOLERANCE
from dualbend.errors import InputError
from support.sheets import PANEL

L, EI, EA = 0.6, 0.575, 7.0e6


def test_flat_sheet_that_cannot_stretch_gives_the_limit_and_says_so() -> None:
    state = rod.solve_symmetric(EI, L, 0.0, L / 2)
    assert state.converged
    assert "indeterminate" in state.reason
    # Analytic limit: the Euler load, no moment.
    assert state.end_force_n == pytest.approx(math.pi**2 * EI / L**2, rel=1e-14)
    assert state.end_moment_nm == 0.0
    assert math.isnan(state.symmetric_stiffness().force_per_distance_n_per_m)


@pytest.mark.parametrize("less", [1e-4, 1e-3])
def test_flat_clamps_pushed_together_buckle_at_four_euler_loads(less: float) -> None:
    state = rod.solve_symmetric(EI, L, 0.0, L / 2 - less)
    shortened = 2 * less / L
    # Analytic, first order in the shortening c: P = 4π² EI/L² (1 + c/2 + ...), sag = 2 L √c / π.
    four = 4 * math.pi**2 * EI / L**2
    assert state.converged
    assert state.end_force_n == pytest.approx(four, rel=shortened)
    assert state.rise_m == pytest.approx(2 * L / math.pi * math.sqrt(shortened), rel=shortened)
    # The clamp moment of the mode 1 − cos: P times half the sag.
    assert state.end_moment_nm == pytest.approx(four * state.rise_m / 2, rel=2 * shortened)


@pytest.mark.parametrize("way", [-1e-7, 1e-6, 3e-4])
def test_flat_sheet_that_stretches_is_a_spring(way: float) -> None:
    state = rod.solve_symmetric(EI, L, 0.0, L / 2 + way, axial_stiffness_n=EA)
    assert state.converged
    # Analytic: P = −EA · 2 Δx/L, and straight.
    assert state.end_force_n == pytest.approx(-EA * 2 * way / L, rel=1e-8)
    assert state.end_moment_nm == pytest.approx(0.0, abs=1e-12)
    # 2EA/L at the flat sheet (both ends move), analytic.
    k = state.symmetric_stiffness()
    assert k.force_per_distance_n_per_m == pytest.approx(-2 * EA / L, rel=1e-9)


def test_flat_clamped_weight_is_the_textbook_beam_without_tension() -> None:
    q = 1e-3
    # As wide apart as the sag needs without end force: ∫½ w'² ds of w = q s² (L − s)²/(24 EI).
    shortened = (q / EI) ** 2 * L**7 / 60480
    state = rod.solve_symmetric(EI, L, 0.0, (L - shortened) / 2, q, axial_stiffness_n=EA)
    # Analytic, small deflection: M = q L²/12, sag q L⁴/(384 EI), no end force.
    assert state.end_moment_nm == pytest.approx(q * L**2 / 12, rel=1e-3)
    assert state.rise_m == pytest.approx(q * L**4 / (384 * EI), rel=1e-3)
    assert abs(state.end_force_n) < 1e-3 * math.pi**2 * EI / L**2


def test_held_flat_sheet_is_drawn_taut_by_its_weight() -> None:
    q, stiff = PANEL.weight_per_length_n_per_m, PANEL.bending_stiffness_nm2
    state = rod.solve_symmetric(stiff, L, 0.0, L / 2, q, axial_stiffness_n=PANEL.axial_stiffness_n)
    assert state.converged
    # Analytic bounds: in tension, so less moment than q L²/12 = 0.0795 N m and less sag.
    assert state.end_force_n < 0.0
    assert 0.0 < state.end_moment_nm < q * L**2 / 12
    assert state.rise_m < q * L**4 / (384 * stiff)


def test_heavy_limp_sheet_hangs_as_a_catenary() -> None:
    limp, q = 1e-4, 10.0
    x = 0.2
    # Inextensible chain: a sinh(x/a) = L/2, tension q a: the weight draws the grippers together.
    a = 0.1
    for _ in range(60):
        a -= (a * math.sinh(x / a) - L / 2) / (math.sinh(x / a) - x / a * math.cosh(x / a))
    alpha = math.atan(L / 2 / a)
    state = rod.solve_symmetric(limp, L, alpha, x, q)
    assert state.converged, state.reason
    # Analytic limit of EI → 0: boundary layers of √(EI/qa) ≈ 9 mm, so within 3 %.
    assert state.end_force_n == pytest.approx(-q * a, rel=0.03)
    assert state.rise_m == pytest.approx(a * (math.cosh(x / a) - 1), rel=0.03)


def test_what_is_too_limp_to_resolve_says_so_and_keeps_the_best_that_was_found() -> None:
    """Boundary layers of √(EI/qa) ≈ 0.9 mm on 0.6 m are more than 96 functions resolve."""
    x, a = 0.2, 0.1
    for _ in range(60):
        a -= (a * math.sinh(x / a) - L / 2) / (math.sinh(x / a) - x / a * math.cosh(x / a))
    state = rod.solve_symmetric(1e-6, L, 0.9 * math.atan(L / 2 / a), x, 10.0)
    assert not state.converged
    assert state.reason == "not resolved by 96 trial functions"
    assert state.residual > RESIDUAL_TOLERANCE
    # Analytic limit of EI → 0: the chain's tension, within EI/(q a³) = 0.1 %.
    assert state.end_force_n == pytest.approx(-10.0 * a, rel=1e-3)


@pytest.mark.parametrize("angle", [math.pi, -math.pi])
def test_a_grip_that_points_backwards_is_refused(angle: float) -> None:
    with pytest.raises(InputError, match=r"left angle_rad must lie within ±π"):
        rod.solve_planar(EI, L, (-0.2, 0.0, angle), (0.2, 0.0, 0.3))


def test_weight_of_a_hanging_sheet_lowers_the_end_force() -> None:
    stiff, q, alpha = PANEL.bending_stiffness_nm2, PANEL.weight_per_length_n_per_m, 0.2
    x = el.half_distance(alpha, L)
    bare = rod.solve_symmetric(stiff, L, alpha, x)
    heavy = rod.solve_symmetric(stiff, L, alpha, x, q)
    change = heavy.end_force_n - bare.end_force_n
    # Analytic estimate: projecting EI θ'' + P θ + q (L/2 − s) = 0 on θ = α cos πs/L gives
    # −4 q L/(π² α); the shape gives way a little, so within 10 %.
    assert change == pytest.approx(-4 * q * L / (math.pi**2 * alpha), rel=0.1)
    # Golden (this model): 0.0059 N m, small because the weight is nearly the mode's own shape.
    assert heavy.end_moment_nm == pytest.approx(0.00588, abs=5e-5)


@pytest.mark.parametrize("alpha", [-1e-3, 0.0, 1e-3, 0.05])
@pytest.mark.parametrize("way", [-3e-4, -1e-5, 0.0, 1e-5, 3e-4])
def test_small_errors_about_the_flat_sheet_are_solved(alpha: float, way: float) -> None:
    q, stiff = PANEL.weight_per_length_n_per_m, PANEL.bending_stiffness_nm2
    state = rod.solve_symmetric(
        stiff, L, alpha, L / 2 + way, q, axial_stiffness_n=PANEL.axial_stiffness_n
    )
    assert state.converged, state.reason
    # Discretisation-limited, as judged by the state itself.
    assert state.residual <= 1e-7


def test_stretching_hardly_matters_once_bent() -> None:
    x = el.half_distance(0.5, L) - 1e-3
    stiff = rod.solve_symmetric(EI, L, 0.5, x)
    soft = rod.solve_symmetric(EI, L, 0.5, x, axial_stiffness_n=EA)
    # Analytic: P/EA = 2.6e-6 of the length, on a stiffness of dP/dx = 690 EI/L³.
    assert soft.end_force_n == pytest.approx(stiff.end_force_n, rel=1e-3)
    assert soft.end_force_n != stiff.end_force_n


def test_what_cannot_be_is_reported_not_raised() -> None:
    taut = rod.solve_symmetric(EI, L, 0.1, L / 2 + 1e-6)
    assert not taut.converged
    assert taut.reason.startswith("taut")
    assert math.isnan(taut.end_force_n)
    assert np.isnan(taut.symmetric_stiffness()).all()
    good = (0.5, el.half_distance(0.5, L))
    states = rod.follow_symmetric(EI, L, [good, (0.1, 0.31), good])
    # A bad point does not spoil the next.
    assert [s.converged for s in states] == [True, False, True]


def test_a_sheet_that_must_arch_upwards_is_another_mode() -> None:
    # Ends 1 mrad upwards and 2 µm together: only the small upward bow is in equilibrium.
    state = rod.solve_symmetric(
        PANEL.bending_stiffness_nm2, L, -1e-3, L / 2 - 1e-6, axial_stiffness_n=EA
    )
    assert not state.converged
    assert "above" in state.reason
    assert state.end_force_n > 0.0


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((-1.0, L, 0.1, 0.29), "EI"),
        ((EI, 0.0, 0.1, 0.29), "L must"),
        ((EI, L, math.nan, 0.29), "angle"),
        ((EI, L, 4.0, 0.29), "angle"),
        ((EI, L, 0.1, math.inf), "x_m"),
        ((EI, L, 0.1, 0.29, -1.0), "weight"),
        ((EI, L, 0.1, 0.29, 0.0, None, 0.0), "axial"),
    ],
)
def test_refuses_what_is_no_rod_and_names_it(arguments: tuple[float, ...], name: str) -> None:
    with pytest.raises(InputError, match=name):
        rod.solve_symmetric(*arguments)
