"""The rod off the optimum: closed form, an independent solver, equilibrium, work, scaling."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_bvp

from dualbend.beam import elastica as el
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod import ritz
from dualbend.beam.rod.basis import basis

L, EI = 0.6, 0.575
seeded = settings(max_examples=25, derandomize=True, deadline=None)


def on_chord(alpha: float, interval: float = 0.2) -> float:
    """Half distance linear in α between knots on the zero-moment path."""
    low = math.floor(alpha / interval + 1e-9) * interval
    a, b = el.half_distance(low, L), el.half_distance(low + interval, L)
    return a + (b - a) * (alpha - low) / interval


@pytest.mark.parametrize("alpha", [0.001, 0.01, 0.2, 0.8, 1.5, 2.2, el.END_SLOPE_GRIPPERS_MEET])
def test_on_the_zero_moment_path_it_is_the_closed_form(alpha: float) -> None:
    state = rod.solve_symmetric(EI, L, alpha, el.half_distance(alpha, L))
    assert state.converged, state.reason
    # Analytic, limited by the rounding of x, which dP/dx ~ 16π²/α² magnifies.
    magnified = 1e-12 + 160 * 2e-16 / alpha**2
    assert state.end_force_n == pytest.approx(el.end_force(alpha, EI, L), rel=magnified)
    assert state.end_moment_nm == pytest.approx(0.0, abs=EI / L * magnified)
    x, z, theta = el.shape(alpha, L, state.s_m)
    # Discretisation-limited (spectral): 1e-9 of the length and of a radian.
    assert state.x_m == pytest.approx(x, abs=1e-9)
    assert state.z_m == pytest.approx(z, abs=1e-9)
    assert state.theta_rad == pytest.approx(theta, abs=1e-8)
    assert state.rise_m == pytest.approx(el.rise(alpha, L), abs=1e-9)


@pytest.mark.parametrize(
    ("alpha", "force", "moment"),
    [(0.10, 32.30, 0.3447), (0.30, 19.10, 0.1470), (0.50, 17.46, 0.0874)],
)
def test_golden_points_of_the_linear_pieces(alpha: float, force: float, moment: float) -> None:
    state = rod.solve_symmetric(EI, L, alpha, on_chord(alpha))
    # Golden: four digits of an earlier shooting model.
    assert state.end_force_n == pytest.approx(force, abs=5e-3)
    assert state.end_moment_nm == pytest.approx(moment, abs=5e-5)


def by_solve_bvp(alpha: float, x: float, q: float) -> tuple[float, float]:
    """Return (P, M) of the half rod by collocation of the differential equation itself."""
    half = L / 2

    def rates(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        load = p[0] * np.sin(y[0]) + q * (half - s) * np.cos(y[0])
        return np.vstack([y[1], -load / EI, np.cos(y[0])])

    def ends(a: np.ndarray, b: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.array([a[0] - alpha, b[0], a[2], b[2] - x])

    s = np.linspace(0, half, 41)
    theta = alpha * np.cos(math.pi * s / L)
    guess = np.vstack([theta, -alpha * math.pi / L * np.sin(math.pi * s / L), s * x / half])
    found = solve_bvp(rates, ends, s, guess, p=[15.0], tol=1e-9, max_nodes=20000)
    assert found.success
    return float(found.p[0]), float(EI * found.y[1, 0])


@pytest.mark.parametrize("q", [0.0, 2.65])
@pytest.mark.parametrize("alpha", [0.3, 0.5, 0.9])
def test_agrees_with_an_independent_solver(alpha: float, q: float) -> None:
    x = on_chord(alpha)
    state = rod.solve_symmetric(EI, L, alpha, x, q)
    force, moment = by_solve_bvp(alpha, x, q)
    # Discretisation-limited: solve_bvp's relative residual is 1e-9.
    assert state.end_force_n == pytest.approx(force, rel=1e-6)
    assert state.end_moment_nm == pytest.approx(moment, rel=1e-6, abs=1e-7)


def test_converges_faster_than_any_power_of_the_number_of_functions() -> None:
    alpha = 0.9
    clamps = ritz.Clamps(
        slope_left=alpha, slope_right=-alpha, shortening=2 * el.shortening(alpha, 1.0), climb=0.0
    )
    errors = []
    for modes in (4, 6, 8, 10):
        problem = ritz.Problem(basis=basis(modes), clamps=clamps, weight=0.0, compliance=0.0)
        found = ritz.newton(problem, ritz.start(problem))
        assert found is not None
        errors.append(abs(found[-2] - el.end_force(alpha, 1.0, 1.0)))
    orders = -np.diff(np.log(errors)) / np.diff(np.log([4, 6, 8, 10]))
    # Observed order: above 8 from the first refinement on, as for an analytic solution.
    assert np.all(orders > 8.0), (errors, orders)
    assert errors[-1] < 1e-6


grips = st.tuples(
    st.floats(0.2, 1.2), st.floats(-0.03, 0.03), st.floats(-0.01, 0.01), st.floats(0.002, 0.01)
)


def planar(case: tuple[float, float, float, float], q: float, **kw: float) -> rod.RodState:
    """A hanging rod with slightly different grips: (α, its difference, climb, less distance)."""
    alpha, tilt, climb, closer = case
    x = el.half_distance(alpha, L) - closer
    left, right = (-x, 0.05, alpha + tilt), (x, 0.05 + climb, alpha - tilt)
    return rod.solve_planar(EI, L, left, right, q, **kw)


@given(case=grips, q=st.sampled_from([0.0, 2.65]))
@seeded
def test_the_loads_on_both_grippers_carry_the_sheet(
    case: tuple[float, float, float, float], q: float
) -> None:
    state = planar(case, q)
    assert state.converged, state.reason
    left, right = state.left, state.right
    # Analytic: sums of forces, and of moments about the left grip (positive turns x to −z; the
    # right gripper's own axis points the other way).
    assert left.force_x_n + right.force_x_n == pytest.approx(0.0, abs=1e-12)
    assert left.force_z_n + right.force_z_n == pytest.approx(-q * L, abs=1e-12)
    dx, dz = state.x_m[-1] - state.x_m[0], state.z_m[-1] - state.z_m[0]
    # Simpson over the 81 points, fourth order: 1e-6 of q L².
    weights = np.ones(81)
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    gravity = q * float(weights @ (state.x_m - state.x_m[0])) * L / 240
    torque = left.moment_nm - right.moment_nm + dz * right.force_x_n - dx * right.force_z_n
    assert torque == pytest.approx(gravity, abs=1e-6 * (1 + q))
    # And section by section: EI κ(s) from the loads left of s (no weight), discretisation 1e-8.
    if q == 0.0:
        lever_x, lever_z = state.x_m - state.x_m[0], state.z_m - state.z_m[0]
        section = left.moment_nm - lever_z * left.force_x_n + lever_x * left.force_z_n
        assert EI * state.curvature_per_m == pytest.approx(section, abs=1e-7)


@given(case=grips)
@seeded
def test_mirrored_grips_have_mirrored_loads(case: tuple[float, float, float, float]) -> None:
    alpha, tilt, climb, closer = case
    there, back = planar(case, 2.0), planar((alpha, -tilt, -climb, closer), 2.0)
    # Analytic symmetry, to Newton's tolerance.
    assert back.right.moment_nm == pytest.approx(there.left.moment_nm, abs=1e-9)
    assert back.left.force_z_n == pytest.approx(there.right.force_z_n, abs=1e-8)
    assert back.end_force_n == pytest.approx(there.end_force_n, rel=1e-9)


@given(alpha=st.floats(0.1, 1.5), closer=st.floats(0.0, 0.01), q=st.sampled_from([0.0, 2.0]))
@seeded
def test_symmetric_grips_are_loaded_alike(alpha: float, closer: float, q: float) -> None:
    x = el.half_distance(alpha, L) - closer
    state = rod.solve_symmetric(EI, L, alpha, x, q)
    assert state.converged, state.reason
    # Analytic symmetry; each gripper carries half the weight.
    assert state.left.moment_nm == pytest.approx(state.right.moment_nm, abs=1e-10)
    assert state.left.force_z_n == pytest.approx(-q * L / 2, abs=1e-9)
    assert state.x_m == pytest.approx(-state.x_m[::-1], abs=1e-10)
    assert state.theta_rad[40] == pytest.approx(0.0, abs=1e-11)


@given(case=grips, q=st.sampled_from([0.0, 2.65]), stretches=st.booleans())
@seeded
def test_every_load_is_the_slope_of_the_energy(
    case: tuple[float, float, float, float], q: float, stretches: bool
) -> None:
    alpha, tilt, climb, closer = case
    x = el.half_distance(alpha, L) - closer
    axial = 2e5 if stretches else None
    place = np.array([-x, 0.0, alpha + tilt, x, climb, alpha - tilt])

    def energy(where: np.ndarray) -> float:
        state = rod.solve_planar(EI, L, tuple(where[:3]), tuple(where[3:]), q, None, axial)
        # The elastic energy and the weight's; heights count from the left grip.
        problem, u = state.problem, state.unknowns
        base, f, clamps = problem.basis, problem.fields(u), problem.clamps
        bending = u[:-2] @ u[:-2] + (clamps.slope_right - clamps.slope_left) ** 2
        height = -(base.running @ (f.stretch * f.sin))
        rest = 0.5 * problem.compliance * f.along**2 + problem.weight * height
        return EI / L * float(0.5 * bending + base.weights @ rest) + q * L * float(where[1])

    state = rod.solve_planar(EI, L, tuple(place[:3]), tuple(place[3:]), q, None, axial)
    loads = np.array([*state.left, *state.right])
    h = 1e-5
    slopes = [(energy(place + h * unit) - energy(place - h * unit)) / (2 * h) for unit in np.eye(6)]
    # Virtual work: the sheet's load on a gripper is −∂U. Central difference, second order.
    assert loads == pytest.approx(-np.array(slopes), rel=1e-5, abs=1e-5)


@given(case=st.tuples(st.floats(0.15, 1.2), st.floats(0.0, 5e-3)), q=st.sampled_from([0.0, 2.0]))
@seeded
def test_stiffness_is_reciprocal_and_the_slope_of_the_loads(
    case: tuple[float, float], q: float
) -> None:
    alpha, closer = case
    x = el.half_distance(alpha, L) - closer
    state = rod.solve_symmetric(EI, L, alpha, x, q)
    stiffness = state.symmetric_stiffness()
    # Analytic (Maxwell-Betti): the energy −2 M dα − 2 P dx has one mixed derivative.
    assert stiffness.moment_per_distance_n == pytest.approx(
        stiffness.force_per_slope_n_per_rad, rel=1e-10
    )
    h = 1e-6
    ahead = rod.solve_symmetric(EI, L, alpha + h, x, q, state)
    behind = rod.solve_symmetric(EI, L, alpha - h, x, q, state)
    # Central difference, second order in 1e-6.
    assert stiffness.moment_per_slope_nm_per_rad == pytest.approx(
        (ahead.end_moment_nm - behind.end_moment_nm) / (2 * h), rel=1e-5
    )


def test_stiffness_on_the_zero_moment_path() -> None:
    state = rod.solve_symmetric(EI, L, 0.1, el.half_distance(0.1, L))
    k = state.symmetric_stiffness()
    # Analytic, first order in α²: dM/dα → −π² EI/L, dP/dx → −16π² EI/(α² L³).
    assert k.moment_per_slope_nm_per_rad * L / EI == pytest.approx(-(math.pi**2), rel=2e-3)
    assert k.force_per_distance_n_per_m * L**3 / EI == pytest.approx(
        -16 * math.pi**2 / 0.01, rel=5e-3
    )


@given(alpha=st.floats(0.05, 1.2), scale=st.floats(0.2, 5.0), stiff=st.floats(0.1, 10.0))
@seeded
def test_loads_scale_with_length_and_stiffness(alpha: float, scale: float, stiff: float) -> None:
    q, x = 2.0, on_chord(alpha)
    one = rod.solve_symmetric(EI, L, alpha, x, q)
    other = rod.solve_symmetric(EI * stiff, L * scale, alpha, x * scale, q * stiff / scale**3)
    # Analytic similarity: P ~ EI/L², M ~ EI/L with q L³/EI kept.
    tight = 1e-9 / min(alpha**2, 1.0)
    assert other.end_force_n == pytest.approx(one.end_force_n * stiff / scale**2, rel=tight)
    assert other.end_moment_nm == pytest.approx(
        one.end_moment_nm * stiff / scale, rel=tight, abs=tight
    )


def test_a_path_is_followed_from_state_to_state() -> None:
    alphas = np.linspace(0.0, 1.2, 61)
    points = [(float(a), on_chord(float(a))) for a in alphas]
    states = rod.follow_symmetric(EI, L, points)
    assert all(s.converged for s in states), [s.reason for s in states if not s.converged]
    fresh = rod.solve_symmetric(EI, L, *points[33])
    # Analytic: the same equilibrium by another way, to Newton's tolerance.
    assert states[33].end_moment_nm == pytest.approx(fresh.end_moment_nm, abs=1e-10)
    knots = [states[k].end_moment_nm for k in (0, 10, 20, 30, 40, 50, 60)]
    assert knots == pytest.approx(np.zeros(7), abs=1e-9)


def test_a_far_guess_leads_to_the_same_state() -> None:
    far = rod.solve_symmetric(EI, L, 1.2, el.half_distance(1.2, L))
    target = (0.01, L / 2 - 3e-4)
    cold = rod.solve_symmetric(EI, L, *target, 2.65)
    warm = rod.solve_symmetric(EI, L, *target, 2.65, far)
    assert warm.converged
    # Analytic: uniqueness of the hanging first mode.
    assert warm.end_force_n == pytest.approx(cold.end_force_n, rel=1e-8)


def test_a_guess_in_another_mode_is_left_again() -> None:
    alpha, x = 0.05, L / 2 - 3e-3
    good = rod.solve_symmetric(EI, L, alpha, x)
    problem = good.problem
    # Seed the sheet snapped through, its middle above its ends.
    seed = good.unknowns.copy()
    seed[:-2] *= -1.0
    above = ritz.newton(problem, seed)
    assert above is not None
    snapped = replace(good, unknowns=above)
    assert abs(above[1] - good.unknowns[1]) > 1e-2
    again = rod.solve_symmetric(EI, L, alpha, x, guess=snapped)
    # Analytic: the same hanging equilibrium.
    assert again.converged
    assert again.end_moment_nm == pytest.approx(good.end_moment_nm, abs=1e-9)
