"""The rod of a sheet that is not uniform, or curved at rest: closed forms, another integrator."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from dualbend.beam import elastica
from dualbend.beam.material import find_material
from dualbend.beam.path import ExactPath
from dualbend.beam.plastic import of_material
from dualbend.beam.rod.basis import OUTPUT_POINTS, basis
from dualbend.beam.rod.path_moment import worst_moment
from dualbend.beam.rod.planar import solve_planar, solve_symmetric
from dualbend.beam.rod.plastic import solve_plastic
from dualbend.beam.rod.space import RodStiffness
from dualbend.beam.rod.state import RodState
from dualbend.beam.rod.tangent import sheet_tangent, sheet_wrench, solve_grips
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet, mean_thickness
from dualbend.errors import InputError
from dualbend.stability.plant.equilibrium import sheet_mass
from support.sheets import STRIP

L = STRIP.length_m
T = STRIP.thickness_m
TAPERED = ((0.0, 0.7 * T), (L, 1.3 * T))
STEPPED = ((0.0, 0.8 * T), (0.15, 0.8 * T), (0.15, 1.2 * T), (0.3, 1.2 * T), (0.3, T), (L, T))
WAVY = ((0.0, 0.9 * T), (0.1, 1.4 * T), (0.25, 0.8 * T), (L, T))


def sheet_of(profile: tuple[tuple[float, float], ...], **other: float) -> Sheet:
    values = {**vars(STRIP), "thickness_m": mean_thickness(profile), "profile": profile, **other}
    return Sheet(**values)


def solved(
    sheet: Sheet,
    left: tuple[float, float, float],
    right: tuple[float, float, float],
    *,
    weight: bool = True,
) -> RodState:
    q = sheet.weight_per_length_n_per_m if weight else 0.0
    state = solve_planar(sheet.bending_stiffness_nm2, L, left, right, q, sheet=sheet)
    assert state.converged, state.reason
    return state


def shot(sheet: Sheet, state: RodState, left: tuple[float, ...], right: tuple[float, ...]) -> list:
    """Return M(0), P and V of the inextensible rod by shooting, begun at a state."""
    steps = sheet.breaks_m
    unit = GRAVITY_M_PER_S2 * sheet.density_kg_per_m3 * sheet.width_m
    EI = STRIP.young_pa * STRIP.width_m / 12.0

    def end(unknowns: np.ndarray) -> np.ndarray:
        moment, force, lift = unknowns
        y = np.array([left[2], moment, left[0], left[1], 0.0])
        for low, high in pairwise(steps):
            a, b = (float(sheet.thickness_at(np.array([s]))[0]) for s in (low + 1e-9, high - 1e-9))

            def rates(s: float, y: np.ndarray, a=a, b=b, low=low, high=high) -> list[float]:  # noqa: ANN001
                t = a + (b - a) * (s - low) / (high - low)
                across = force * np.sin(y[0]) - (lift + y[4]) * np.cos(y[0])
                turn = y[1] / (EI * t**3) - sheet.rest_curvature_per_m
                return [turn, -across, np.cos(y[0]), -np.sin(y[0]), unit * t]

            y = solve_ivp(rates, (low, high), y, rtol=1e-11, atol=1e-13).y[:, -1]
        return np.array([y[0] + right[2], y[2] - right[0], y[3] - right[1]])

    begin = [state.left.moment_nm, state.end_force_n, state.left.force_z_n]
    found = root(end, np.array(begin) * 1.02, tol=1e-11)
    assert found.success
    return found.x.tolist()


@pytest.mark.parametrize("profile", [TAPERED, STEPPED, WAVY], ids=["tapered", "stepped", "wavy"])
@pytest.mark.parametrize("curvature", [0.0, 0.4])
def test_it_is_the_rod_of_another_integrator(
    profile: tuple[tuple[float, float], ...], curvature: float
) -> None:
    sheet = sheet_of(profile, rest_curvature_per_m=curvature)
    left, right = (-0.185, 0.0, 0.5), (0.188, 0.006, 0.42)
    state = solved(sheet, left, right)
    moment, force, lift = shot(sheet, state, left, right)
    # Both integrate the same equations: what differs is below 1e-6 of the load.
    assert state.left.moment_nm == pytest.approx(moment, abs=1e-6 * force * L)
    assert state.end_force_n == pytest.approx(force, rel=1e-6)
    assert state.left.force_z_n == pytest.approx(lift, abs=1e-6 * force)


@pytest.mark.parametrize("curvature", [-0.7, 0.3])
def test_a_strip_curved_at_rest_and_clamped_flat_turns_its_grips_by_ei_kappa(
    curvature: float,
) -> None:
    sheet = replace(STRIP, rest_curvature_per_m=curvature)
    EI, EA = sheet.bending_stiffness_nm2, sheet.axial_stiffness_n
    for axial, half in ((EA, L / 2), (None, L / 2)):
        state = solve_symmetric(EI, L, 0.0, half, axial_stiffness_n=axial, sheet=sheet)
        assert state.converged
        # Analytic: EI κ₀ everywhere, and no force that the clamps must bear.
        assert state.left.moment_nm == pytest.approx(EI * curvature, rel=1e-9)
        assert state.right.moment_nm == pytest.approx(EI * curvature, rel=1e-9)
        np.testing.assert_allclose(state.theta_rad, 0.0, atol=1e-12)


def test_a_uniform_strip_curved_at_rest_has_the_shape_of_a_straight_one() -> None:
    """Between the same grips, weight or not: analytic, the moment alone is EI κ₀ more."""
    sheet = replace(STRIP, rest_curvature_per_m=0.5)
    x = elastica.half_distance(0.6, L)
    grips = (-0.97 * x, 0.0, 0.6), (x, 0.004, 0.5)
    straight, curved = solved(STRIP, *grips), solved(sheet, *grips)
    np.testing.assert_allclose(curved.theta_rad, straight.theta_rad, atol=1e-9)
    assert curved.end_force_n == pytest.approx(straight.end_force_n, rel=1e-9)
    for ours, theirs in ((curved.left, straight.left), (curved.right, straight.right)):
        more = ours.moment_nm - theirs.moment_nm
        assert more == pytest.approx(0.5 * STRIP.bending_stiffness_nm2, rel=1e-9)


def test_a_free_strip_is_the_arc_of_its_rest_curvature() -> None:
    """Analytic: at the ends of a circular arc of κ₀ nothing is felt."""
    sheet = replace(STRIP, rest_curvature_per_m=2.0)
    alpha = 2.0 * L / 2.0
    state = solve_symmetric(sheet.bending_stiffness_nm2, L, alpha, np.sin(alpha) / 2.0, sheet=sheet)
    assert state.converged
    assert state.left.moment_nm == pytest.approx(0.0, abs=1e-9)
    assert state.end_force_n == pytest.approx(0.0, abs=1e-7)
    np.testing.assert_allclose(state.curvature_per_m, -2.0, atol=1e-8)


def test_a_tapered_cantilever_bends_as_its_closed_form() -> None:
    """Analytic, small: for t = a + b s, w = (12 F/E w) ∫ (L − s)²/(a + b s)³ ds."""
    (_, a), (_, end) = TAPERED
    b = (end - a) / L
    c = 12.0 / (STRIP.young_pa * STRIP.width_m)
    u0, u1, A = a, end, a + b * L  # L − s = (A − u)/b with u = a + b s

    def powers(u: float) -> float:
        return -(A**2) / (2.0 * u**2) + 2.0 * A / u + np.log(u)

    deflection = c / b**3 * (powers(u1) - powers(u0))
    slope = c / b**2 * ((-A / (2 * u1**2) + 1 / u1) - (-A / (2 * u0**2) + 1 / u0))
    sheet, tip_m = sheet_of(TAPERED), 2e-4
    force = tip_m / deflection
    # What the slopes shorten it by, ½ ∫ w'² ds, in the same closed form's first integral.
    u = np.linspace(u0, u1, 4001)
    slopes = force * c / b**2 * ((-A / (2 * u**2) + 1 / u) - (-A / (2 * u0**2) + 1 / u0))
    shorter = 0.5 * np.trapezoid(slopes**2, (u - a) / b)
    # Down by the deflection, the right end's slope as under the force alone: no moment is left.
    state = solved(sheet, (0.0, 0.0, 0.0), (L - shorter, -tip_m, -force * slope), weight=False)
    # Small angles: the next terms are of the order of slope², 1e-6; an axial force is left of them.
    assert state.right.moment_nm == pytest.approx(0.0, abs=1e-4 * force * L)
    assert state.right.force_z_n == pytest.approx(force, rel=1e-4)
    assert state.left.moment_nm == pytest.approx(force * L, rel=1e-4)


def test_a_stepped_beam_with_moments_at_its_ends_turns_by_its_pieces() -> None:
    """Analytic: without a force the moment is one, and each piece an arc of M/EI."""
    sheet, moment = sheet_of(STEPPED), 0.05
    bends = [
        (high - low, moment / sheet.section_at((low + high) / 2).bending_stiffness_nm2)
        for low, high in pairwise(sheet.breaks_m)
    ]
    slope, x, z = 0.4, 0.0, 0.0
    for length, bend in bends:
        after = slope - length * bend
        x += (np.sin(slope) - np.sin(after)) / bend
        z -= (np.cos(after) - np.cos(slope)) / bend
        slope = after
    state = solved(sheet, (0.0, 0.0, 0.4), (x, z, -slope), weight=False)
    assert state.left.moment_nm == pytest.approx(-moment, rel=1e-7)
    assert state.right.moment_nm == pytest.approx(-moment, rel=1e-7)
    assert state.end_force_n == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("profile", [TAPERED, STEPPED], ids=["tapered", "stepped"])
def test_turned_round_it_is_the_mirror_image(profile: tuple[tuple[float, float], ...]) -> None:
    """A symmetry: left and right change places, and so do their loads."""
    mirrored = tuple((L - s, t) for s, t in reversed(profile))
    a, b = (-0.19, 0.0, 0.4), (0.19, 0.0, 0.3)
    ours = solved(sheet_of(profile), a, b)
    theirs = solved(sheet_of(mirrored), (-0.19, 0.0, 0.3), (0.19, 0.0, 0.4))
    assert ours.left.moment_nm == pytest.approx(theirs.right.moment_nm, rel=1e-6)
    assert ours.left.force_z_n == pytest.approx(theirs.right.force_z_n, rel=1e-6)


def test_a_profile_of_one_thickness_is_the_uniform_sheet() -> None:
    """Two computations: on pieces, and on the whole."""
    pieces = sheet_of(((0.0, T), (0.1, T), (0.27, T), (L, T)))
    grips = (-0.19, 0.0, 0.4), (0.19, 0.002, 0.3)
    one, other = solved(pieces, *grips), solved(STRIP, *grips)
    assert one.left == pytest.approx(other.left, rel=1e-7)
    assert one.right == pytest.approx(other.right, rel=1e-7)
    np.testing.assert_allclose(one.z_m, other.z_m, atol=1e-10)
    tangent, expected = (
        sheet_tangent(solve_grips(s, np.array([-0.19, 0.0, 0.4] * 2))) for s in (pieces, STRIP)
    )
    np.testing.assert_allclose(tangent, expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("profile", [TAPERED, STEPPED], ids=["tapered", "stepped"])
def test_the_tangent_is_the_change_of_the_loads(profile: tuple[tuple[float, float], ...]) -> None:
    sheet = sheet_of(profile, rest_curvature_per_m=0.3)
    grips = np.array([-0.188, 0.0, 0.5, -0.187, 0.003, 0.4])
    state = solve_grips(sheet, grips)
    tangent = sheet_tangent(state)
    np.testing.assert_allclose(tangent, tangent.T, atol=1e-9 * np.abs(tangent).max())
    step = 1e-6
    for i in range(6):
        moved = [grips.copy(), grips.copy()]
        moved[0][i] += step
        moved[1][i] -= step
        high, low = (sheet_wrench(solve_grips(sheet, there, state)) for there in moved)
        # Central differences: their error is 1e-6 of the column.
        np.testing.assert_allclose(
            -(high - low) / (2 * step), tangent[:, i], atol=1e-4 * np.abs(tangent[:, i]).max()
        )


def test_the_elasticas_path_is_free_of_moments_for_a_uniform_straight_sheet_alone() -> None:
    path = ExactPath(length_m=L, target_rad=0.6)
    EI = STRIP.bending_stiffness_nm2
    assert worst_moment(path, STRIP).moment_nm < 1e-6
    assert worst_moment(path, sheet_of(TAPERED)).moment_nm > 0.02 * EI / L
    curved = replace(STRIP, rest_curvature_per_m=0.2)
    assert worst_moment(path, curved).moment_nm == pytest.approx(0.2 * EI, rel=1e-3)


def test_pieces_integrate_what_is_smooth_in_each_exactly() -> None:
    breaks = (0.0, 0.2, 0.7, 1.0)
    base = basis(24, breaks)
    # Analytic: the derivatives are orthonormal, and the functions vanish at both ends.
    gram = base.slope.T @ (base.weights[:, None] * base.slope)
    np.testing.assert_allclose(gram, np.eye(base.modes), atol=1e-12)
    np.testing.assert_allclose(base.out_phi[[0, -1]], 0.0, atol=1e-12)
    np.testing.assert_allclose(base.running @ base.slope, base.phi, atol=1e-12)
    np.testing.assert_allclose(base.cumulative @ base.slope, base.out_phi, atol=1e-12)
    kinked = np.where(base.sigma < 0.2, base.sigma**3, 2.0 * base.sigma)
    assert base.weights @ kinked == pytest.approx(0.2**4 / 4 + 1.0 - 0.2**2, rel=1e-12)
    assert base.out_sigma.size == OUTPUT_POINTS
    larger = basis(48, breaks)
    assert larger.modes > base.modes
    # A larger basis begins with a smaller one: a state on it is a start there.
    np.testing.assert_allclose(larger.out_phi[:, : base.modes], base.out_phi, atol=1e-12)


@pytest.mark.parametrize(
    ("profile", "message"),
    [
        (((0.0, T),), "must lead from 0 to the sheet's length"),
        (((0.0, T), (0.3, T)), "must lead from 0 to the sheet's length, 0.4 m"),
        (((0.1, T), (L, T)), "must lead from 0"),
        (
            ((0.0, T), (0.2, T), (0.1, T), (L, T)),
            r"row 3: the places must grow .* got 0\.2 then 0\.1",
        ),
        (((0.0, T), (0.2, T), (0.2, T), (0.2, T), (L, T)), "row 3: the places must grow"),
        (((0.0, T), (0.0, 2 * T), (L, T)), "row 2: the places must grow"),
        (((0.0, T), (L, -T)), "thickness must be finite and above 0"),
    ],
)
def test_a_profile_that_is_none_is_refused(
    profile: tuple[tuple[float, float], ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Sheet(**{**vars(STRIP), "profile": profile})


def test_the_mean_thickness_is_that_of_the_mass() -> None:
    sheet = sheet_of(STEPPED)
    # Analytic: ∫ t ds.
    area = 0.15 * 0.8 * T + 0.15 * 1.2 * T + 0.1 * T
    assert sheet.mass_kg == pytest.approx(sheet.density_kg_per_m3 * sheet.width_m * area)
    with pytest.raises(InputError, match="must be the profile's mean"):
        Sheet(**{**vars(sheet), "thickness_m": 1.01 * sheet.thickness_m})
    thicker = sheet.thicker(1.1)
    assert thicker.mass_kg == pytest.approx(1.1 * sheet.mass_kg)
    assert thicker.section_at(0.2).thickness_m == pytest.approx(1.1 * 1.2 * T)


def test_the_surface_strain_is_that_of_each_section() -> None:
    sheet = sheet_of(STEPPED)
    angles = np.zeros((1, 20))
    for place, factor in ((2, 0.8), (10, 1.2), (18, 1.0)):
        angles[:] = 0.0
        angles[0, place] = 0.01
        # Analytic: κ t/2 of that hinge.
        expected = 0.01 * 20 / L * factor * T / 2.0
        assert sheet.surface_strain(angles)[0] == pytest.approx(expected, rel=1e-12)


def test_a_tapered_sheet_stretches_by_the_mean_of_its_softness() -> None:
    """Analytic: ∫ ds/t = L ln(t₁/t₀)/(t₁ − t₀)."""
    sheet = sheet_of(TAPERED)
    (_, thin), (_, thick) = TAPERED
    softness = np.log(thick / thin) / (thick - thin)
    expected = sheet.young_pa * sheet.width_m / softness
    assert sheet.axial_stiffness_n == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("profile", [TAPERED, WAVY], ids=["tapered", "wavy"])
def test_a_turned_sheet_has_the_inertia_of_its_thickness(
    profile: tuple[tuple[float, float], ...],
) -> None:
    """Turned about its left grip as a whole, 2T/φ'² = ∫ ρ w t r² ds: by the shape, and by grips."""
    sheet = sheet_of(profile)
    state = solve_grips(sheet, np.array([-0.185, 0.0, 0.5] * 2))
    x, z = state.x_m - state.x_m[0], state.z_m - state.z_m[0]
    # Its right grip goes by φ (−z, x), x inward there; both slopes turn, the left one down less.
    turned = np.array([0.0, 0.0, -1.0, z[-1], x[-1], 1.0])
    found = turned @ sheet_mass(sheet, state) @ turned
    per_length = sheet.density_kg_per_m3 * sheet.width_m * sheet.thickness_at(state.s_m)
    expected = np.trapezoid(per_length * (x**2 + z**2), state.s_m)
    assert found == pytest.approx(expected, rel=1e-3)


def test_rods_that_know_uniform_straight_sheets_alone_refuse_others() -> None:
    yielding = replace(STRIP, plasticity=of_material(find_material("5052-H32")))
    for sheet in (sheet_of(TAPERED), replace(STRIP, rest_curvature_per_m=0.1)):
        with pytest.raises(InputError, match="of one thickness and straight at rest"):
            RodStiffness.of(sheet)
    curved = replace(yielding, rest_curvature_per_m=0.1)
    with pytest.raises(InputError, match="of one thickness and straight at rest"):
        solve_plastic(curved, 0.5, 0.19, 0.0)
