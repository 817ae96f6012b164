"""The discrete rod: gradient, tangent and stiffness of one energy; starts and branches."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dualbend.beam import elastica as el
from dualbend.beam._check import FloatArray
from dualbend.beam.rod import branch, ritz
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.basis import basis
from dualbend.beam.rod.state import RESIDUAL_TOLERANCE, residual

BASIS = basis(24)
GENERAL = ritz.Clamps(slope_left=0.7, slope_right=-0.3, shortening=0.08, climb=0.11)


def problem(
    clamps: ritz.Clamps = GENERAL, weight: float = 5.0, compliance: float = 0.03, modes: int = 24
) -> ritz.Problem:
    return ritz.Problem(basis=basis(modes), clamps=clamps, weight=weight, compliance=compliance)


def shallow(odd: float, even: float, shortening: float, climb: float = 0.0) -> ritz.Clamps:
    return ritz.Clamps(
        slope_left=even + odd, slope_right=even - odd, shortening=shortening, climb=climb
    )


def energy(case: ritz.Problem, u: FloatArray) -> float:
    """Return Λ(θ, p, v) = ∫ ½ θ'² − N − ½ κ N² dσ + p (c − 1) + v h, from its definition."""
    base, clamps = case.basis, case.clamps
    line = clamps.slope_left + (clamps.slope_right - clamps.slope_left) * base.sigma
    theta, bend = line + base.phi @ u[:-2], base.slope @ u[:-2]
    bend = bend + clamps.slope_right - clamps.slope_left
    p, v = u[-2:]
    normal = -p * np.cos(theta) - (v + case.weight * base.sigma) * np.sin(theta)
    density = 0.5 * bend**2 - normal - 0.5 * case.compliance * normal**2
    return float(base.weights @ density + p * (clamps.shortening - 1.0) + v * clamps.climb)


def guess(case: ritz.Problem) -> FloatArray:
    u = np.random.default_rng(4).normal(size=case.basis.modes + 2)
    u[:-2] *= 0.1
    u[-2:] = 9.0, -4.0
    return u


def solved(case: ritz.Problem) -> FloatArray:
    found = ritz.newton(case, ritz.start(case))
    assert found is not None
    return found


# --- one energy ---------------------------------------------------------------------------------


def test_the_residual_is_the_gradient_of_the_energy_and_the_tangent_that_of_the_residual() -> None:
    case = problem(modes=6)
    u, h = guess(case), 1e-6
    slopes, rows = [], []
    for unit in np.eye(u.size):
        ahead, behind = u + h * unit, u - h * unit
        slopes.append((energy(case, ahead) - energy(case, behind)) / (2 * h))
        rows.append(
            (case.residual(ahead, case.fields(ahead)) - case.residual(behind, case.fields(behind)))
            / (2 * h)
        )
    f = case.fields(u)
    # Central differences, second order in 1e-6 of numbers up to ten.
    np.testing.assert_allclose(case.residual(u, f), slopes, atol=1e-7)
    np.testing.assert_allclose(case.tangent(f), rows, atol=1e-7)


@pytest.mark.parametrize("compliance", [0.0, 0.03])
def test_end_moments_and_stiffness_are_the_energys_slopes_in_the_clamps(compliance: float) -> None:
    """(−M(0), M(1), p, v) of an equilibrium, and how they change as the clamps move."""
    case = problem(compliance=compliance)
    u, h = solved(case), 1e-5
    names = tuple(vars(case.clamps))

    def moved(name: str, by: float) -> ritz.Problem:
        clamps = replace(case.clamps, **{name: getattr(case.clamps, name) + by})
        return replace(case, clamps=clamps)

    def loads(there: ritz.Problem) -> FloatArray:
        found = ritz.newton(there, u)
        assert found is not None
        first, last = there.end_moments(there.fields(found))
        return np.array([-first, last, found[-2], found[-1]])

    slopes = [(energy(moved(name, h), u) - energy(moved(name, -h), u)) / (2 * h) for name in names]
    # Central differences, second order in 1e-5.
    np.testing.assert_allclose(loads(case), slopes, atol=1e-6)
    columns = [(loads(moved(name, h)) - loads(moved(name, -h))) / (2 * h) for name in names]
    stiffness = case.stiffness(case.fields(u))
    np.testing.assert_allclose(stiffness, np.column_stack(columns), rtol=1e-5, atol=1e-5)
    # Analytic: Maxwell-Betti.
    np.testing.assert_allclose(stiffness, stiffness.T, rtol=1e-9, atol=1e-9)


def test_running_integrals_are_exact_for_polynomials() -> None:
    for power in range(8):
        values = BASIS.sigma**power
        # Analytic: σⁿ⁺¹/(n + 1), to rounding.
        for table, at in ((BASIS.running, BASIS.sigma), (BASIS.cumulative, BASIS.out_sigma)):
            np.testing.assert_allclose(
                table @ values, at ** (power + 1) / (power + 1), atol=1e-13, rtol=1e-12
            )
        assert BASIS.weights @ values == pytest.approx(1.0 / (power + 1), rel=1e-13)


def test_the_functions_are_zero_at_the_clamps_and_their_slopes_orthonormal() -> None:
    # Analytic, to rounding.
    np.testing.assert_allclose(BASIS.out_phi[[0, -1]], 0.0, atol=1e-14)
    product = BASIS.slope.T @ (BASIS.weights[:, None] * BASIS.slope)
    np.testing.assert_allclose(product, np.eye(24), atol=1e-12)
    rates = np.gradient(BASIS.out_phi[:, :3], BASIS.out_sigma, axis=0, edge_order=2)
    # Central differences on 81 points, second order.
    np.testing.assert_allclose(rates, BASIS.out_slope[:, :3], atol=0.02)


@pytest.mark.parametrize("modes", [6, 8, 10, 12])
def test_the_residual_tells_the_relative_error_of_the_end_moments(modes: int) -> None:
    """θ' at the ends has half the order of the reactions, so their gap is its error."""
    alpha = 0.9
    clamps = shallow(alpha, 0.0, 2 * el.shortening(alpha, 1.0) + 0.02)
    coarse = problem(clamps, weight=3.0, compliance=0.0, modes=modes)
    fine = problem(clamps, weight=3.0, compliance=0.0, modes=48)

    def ends(case: ritz.Problem, u: FloatArray) -> FloatArray:
        return case.basis.out_slope[[0, -1]] @ u[:-2] - 2.0 * alpha

    u, right = solved(coarse), ends(fine, solved(fine))
    error = np.abs(ends(coarse, u) - right).max() / (1.0 + np.abs(right).sum())
    # Discretisation-limited: the reactions' own error is smaller by orders.
    assert residual(coarse, u) == pytest.approx(error, rel=0.01)
    assert residual(fine, solved(fine)) < 1e-4 * RESIDUAL_TOLERANCE


@pytest.mark.parametrize("unknown", [0, 3, -2, -1])
def test_the_residual_sees_an_unknown_that_is_off(unknown: int) -> None:
    case = problem()
    off = solved(case)
    off[unknown] += 1e-3
    assert residual(case, off) > 10.0 * RESIDUAL_TOLERANCE


# --- starts -------------------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", [0.0, 0.02, -0.02])
@pytest.mark.parametrize(
    ("odd", "even", "euler_loads"),
    [(0.04, 0.0, 1.0), (0.0, 0.04, 4.0), (0.0, -0.04, 4.0), (0.0, 0.0, 4.0)],
    ids=["zero moment", "end slopes alike", "end slopes alike, down", "clamped flat"],
)
def test_the_first_guess_is_the_shallow_rod(
    odd: float, even: float, euler_loads: float, tilt: float
) -> None:
    """The cos πσ buckles at π², cos 2πσ and sin 2πσ at 4π²; about a chord that may be inclined."""
    lost = (odd**2 + even**2 or 0.04**2) / 4.0
    along, climb = (1.0 - lost) * math.cos(tilt), -(1.0 - lost) * math.sin(tilt)
    case = problem(shallow(odd, even + tilt, 1.0 - along, climb), weight=0.0, compliance=0.0)
    begin = ritz.start(case)
    # Analytic, first order in the slopes of 0.04; forces along the chord.
    force = euler_loads * math.pi**2
    assert begin[-2] * math.cos(tilt) + begin[-1] * math.sin(tilt) == pytest.approx(force, rel=5e-3)
    assert begin[-1] * math.cos(tilt) - begin[-2] * math.sin(tilt) == pytest.approx(0.0, abs=0.05)
    xi = math.pi * case.basis.out_sigma
    bump = 0.04 * np.sin(2.0 * xi) * (not odd and not even)
    shape = odd * np.cos(xi) + even * np.cos(2.0 * xi) + bump
    theta = case.line(case.basis.out_sigma) + case.basis.out_phi @ begin[:-2]
    np.testing.assert_allclose(theta - tilt, shape, atol=1e-3 * 0.04 + 0.04**2)


@pytest.mark.parametrize("weight", [0.0, 20.0])
@pytest.mark.parametrize(("even", "climb"), [(0.2, -0.2), (0.0, 0.2), (0.3, 0.0)])
def test_the_first_guess_is_near_the_solution(even: float, climb: float, weight: float) -> None:
    size = 0.1
    case = problem(
        shallow(size, even * size, 0.45 * size**2, climb * size), weight * size, compliance=0.0
    )
    begin, found = ritz.start(case), solved(case)
    # The guess has three functions: 13 % of the slope, 1 % of the forces (measured).
    assert np.abs(case.basis.out_phi @ (begin - found)[:-2]).max() < 0.14 * size
    np.testing.assert_allclose(begin[-2:], found[-2:], atol=0.01 * found[-2])


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.5, 2.1])
def test_the_start_on_the_curve_is_the_elastica(alpha: float) -> None:
    case = problem(shallow(alpha, 0.0, 2.0 * el.shortening(alpha, 1.0)), 0.0, 0.0)
    clamps, begin = branch.on_curve(case)
    # Analytic: the closed form is an equilibrium; spectral accuracy, lowest at 2.1 rad.
    assert clamps.slope_left == pytest.approx(alpha, rel=1e-14)
    assert clamps == replace(case.clamps, slope_left=clamps.slope_left, slope_right=-alpha)
    assert np.abs(case.residual(begin, case.fields(begin))).max() < 1e-9
    assert begin[-2] == pytest.approx(el.end_force(alpha, 1.0, 1.0), rel=1e-14)


@pytest.mark.parametrize(
    ("left", "right", "alpha"),
    [(0.9, -0.3, 0.6), (0.01, -0.02, 0.1), (-0.4, 0.2, 0.1), (3.0, -3.0, 0.95)],
)
def test_the_start_on_the_curve_has_the_mean_end_slope_within_reach(
    left: float, right: float, alpha: float
) -> None:
    clamps = ritz.Clamps(slope_left=left, slope_right=right, shortening=0.1, climb=0.05)
    begin, _ = branch.on_curve(problem(clamps))
    # Exact: from 0.1 rad to 95 % of where the grippers meet.
    wanted = alpha if alpha < 0.95 else 0.95 * el.END_SLOPE_GRIPPERS_MEET
    assert (begin.slope_left, begin.slope_right) == pytest.approx((wanted, -wanted), rel=1e-14)
    assert begin.climb == 0.0
    assert begin.shortening == pytest.approx(2.0 * el.shortening(wanted, 1.0), rel=1e-14)


# --- branches -----------------------------------------------------------------------------------


@pytest.mark.parametrize("modes", [24, 48, 10])
def test_unknowns_on_another_basis_are_the_same_rod(modes: int) -> None:
    case = problem()
    u = solved(case)
    other = replace(case, basis=basis(modes))
    same = branch.resized(u, modes)
    assert same.size == modes + 2
    # Analytic: hierarchical functions; what is cut off is small.
    assert same[-2:].tolist() == u[-2:].tolist()
    np.testing.assert_allclose(
        other.basis.out_phi @ same[:-2],
        case.basis.out_phi @ u[:-2],
        atol=1e-14 if modes >= 24 else 1e-4,
    )
    np.testing.assert_array_equal(branch.resized(same, 24)[: min(modes, 24)], u[: min(modes, 24)])


def test_clamps_a_part_of_the_way() -> None:
    other = ritz.Clamps(slope_left=-0.1, slope_right=0.5, shortening=0.04, climb=-0.05)
    half = GENERAL.towards(other, 0.25)
    # Exact: linear in the part.
    assert vars(half) == pytest.approx(
        {"slope_left": 0.5, "slope_right": -0.1, "shortening": 0.07, "climb": 0.07}
    )
    assert vars(GENERAL.towards(other, 1.0)) == pytest.approx(vars(other))


def test_a_walk_ends_in_an_equilibrium_of_the_clamps_that_it_is_sent_to() -> None:
    near = problem(shallow(0.3, 0.0, 0.06), 2.0, 0.0)
    far = replace(near, clamps=GENERAL)
    found = branch.walk(far, near.clamps, solved(near))
    assert found is not None
    # To Newton's tolerance, and the same as by the first guess.
    assert np.abs(far.residual(found, far.fields(found))).max() < 1e-7
    np.testing.assert_allclose(found, solved(far), atol=1e-6)


def test_a_walk_to_where_no_rod_can_be_is_given_up() -> None:
    near = problem(shallow(0.3, 0.0, 0.06), 0.0, 0.0)
    taut = replace(near, clamps=shallow(0.3, 0.0, -0.01))
    assert branch.walk(taut, near.clamps, solved(near)) is None


@pytest.mark.parametrize("climb", [0.0, 0.03, -0.03])
def test_a_sheet_above_its_ends_is_another_mode_and_by_how_much(climb: float) -> None:
    """The mirror image of a hanging rod stands: as far above its ends as that hangs below."""
    clamps = shallow(0.0, 0.02, 0.01, climb)
    hanging = problem(clamps, 0.0, 0.0)
    standing = replace(hanging, clamps=shallow(0.0, -0.02, 0.01, -climb))
    u = solved(hanging)
    mirrored = np.concatenate([-u[:-2], [u[-2], -u[-1]]])
    base, f = hanging.basis, hanging.fields(u)
    drop = base.cumulative @ f.sin
    sag = drop[40] - drop[-1] / 2
    assert branch.other_mode(hanging, u) == ""
    # Analytic: the same number, as printed to three digits.
    assert f"the middle is {sag:.3g} L above the ends" in branch.other_mode(standing, mirrored)


@pytest.mark.parametrize(("part", "told"), [(1.0 / 4.0, True), (1.0 / 12.0, False)])
def test_ends_that_point_up_may_hold_the_middle_up_by_a_quarter_of_their_slope(
    part: float, told: bool
) -> None:
    """A circular arc of ends δ stands δ/4 above them; the elastica stands δ/π, a taut rod less."""
    size = 0.02
    hanging = problem(shallow(size, 0.0, part * size**2), 0.0, 0.0)
    standing = replace(hanging, clamps=shallow(-size, 0.0, part * size**2))
    u = solved(hanging)
    mirrored = np.concatenate([-u[:-2], u[-2:]])
    assert bool(branch.other_mode(standing, mirrored)) is told


def test_a_buckled_mode_that_would_snap_is_told_with_its_directions() -> None:
    """The second mode, θ ~ cos 2πσ between flat clamps off the chord, is unstable in one way."""
    case = problem(shallow(0.0, 0.0, 0.01), 0.0, 0.0)
    base = case.basis
    # Between clamps, the antisymmetric mode has tan x = x at x = √p / 2 = 4.4934.
    root = 2.0 * 4.493409457909064
    theta = np.cos(root * (base.sigma - 0.5)) - math.cos(root / 2)
    bend = -root * np.sin(root * (base.sigma - 0.5))
    scale = math.sqrt(2 * 0.01 / float(base.weights @ theta**2))
    begin = np.concatenate([base.slope.T @ (base.weights * scale * bend), [root**2, 0.0]])
    found = ritz.newton(case, begin)
    assert found is not None
    # Analytic, first order in the shortening: 8.18 π², twice the first mode's.
    assert found[-2] == pytest.approx(root**2, rel=0.01)
    assert "unstable in 1 direction" in branch.other_mode(case, found)


def test_the_rise_is_from_the_middle_to_the_mean_of_the_ends() -> None:
    state = rod.solve_planar(0.575, 0.6, (-0.27, 0.05, 0.5), (0.27, 0.09, 0.4), 2.0)
    assert state.converged, state.reason
    # Exact: read off the shape, whose ends differ by 40 mm; the left one is where its grip is.
    assert state.rise_m == pytest.approx((state.z_m[0] + state.z_m[-1]) / 2 - state.z_m[40])
    assert state.z_m[-1] - state.z_m[0] == pytest.approx(0.04, abs=1e-9)
    assert (state.x_m[0], state.z_m[0]) == (-0.27, 0.05)
    assert state.x_m[-1] == pytest.approx(0.27, abs=1e-9)
