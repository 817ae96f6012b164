"""The springs of a hinge that yields: where they slip, what is left beyond, thin layers."""

import numpy as np
import pytest

from dualbend.beam.laminate import stack
from dualbend.beam.material import Material, find_material
from dualbend.beam.plastic import REACH, of_laminate, of_material
from dualbend.beam.rod.plastic import solve_plastic
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError

T_M = 0.8e-3
METAL = {"young_pa": 70e9, "poisson_ratio": 0.3, "density_kg_per_m3": 2700.0, "yield_pa": 140e6}
IDEAL = of_material(Material(name="ideal", **METAL))
FIRST = IDEAL.first_yield(T_M)


def test_the_first_fibre_yields_at_the_surface() -> None:
    # Analytic: κ_y = 2 ε_y / t, ε_y = 2e-3.
    assert pytest.approx(2 * 2e-3 / T_M, rel=1e-14) == FIRST


@pytest.mark.parametrize("count", [6, 12])
def test_springs_slip_between_first_yield_and_their_reach(count: int) -> None:
    springs = IDEAL.springs(T_M, count)
    assert springs.yield_curvature.shape == springs.share.shape == (count,)
    assert springs.yield_curvature[0] == pytest.approx(FIRST, rel=1e-12)
    assert springs.yield_curvature[-1] == pytest.approx(REACH * FIRST, rel=1e-12)
    assert (np.diff(springs.yield_curvature) > 0.0).all()
    assert (springs.share > 0.0).all()
    # They crowd where the moment bends most, just beyond the first yield.
    assert np.median(springs.yield_curvature) < 0.5 * REACH * FIRST


def test_beyond_their_reach_the_slope_is_kept() -> None:
    springs = IDEAL.springs(T_M, 10)
    # Analytic: d(M/EI)/dκ = (κ_y/κ)³ of an ideal section, at twelve times κ_y.
    assert springs.elastic == pytest.approx(REACH**-3, rel=2e-3)
    far = springs.moment(np.array([20.0, 30.0]) * FIRST)
    assert (far[1] - far[0]) / (10.0 * FIRST) == pytest.approx(REACH**-3, rel=2e-3)


@pytest.mark.parametrize("count", [8, 12, 16])
def test_what_is_kept_after_release_is_fitted_with_second_order(count: int) -> None:
    """The error over the kept curvature, near the first yield over a twentieth of that."""
    grid = np.geomspace(1.0001, REACH, 1000) * FIRST
    springs = IDEAL.springs(T_M, count)
    wrong = np.abs(springs.moment(grid) - IDEAL.moment(grid, T_M))
    kept = np.maximum(IDEAL.residual(grid, T_M), 0.05 * FIRST)
    # Discretisation-limited: as the square of the number, 1.2 to 1.45 over it (measured).
    assert (wrong / kept).max() < 1.5 / count**2


def test_the_law_has_no_sign() -> None:
    springs = IDEAL.springs(T_M, 8)
    way = np.linspace(0.0, 9.0, 40) * FIRST
    np.testing.assert_allclose(springs.moment(-way), -springs.moment(way), rtol=1e-14)
    # A first loading by steps is the virgin curve.
    np.testing.assert_allclose(springs.follow(way[:, None])[:, 0], springs.moment(way), rtol=1e-12)


@pytest.mark.parametrize("film_m", [1e-6, 0.1e-3])
def test_the_bands_of_layers_fill_the_section_however_thin_the_middle_is(film_m: float) -> None:
    metal, core = find_material("5052-H32"), find_material("FR-4")
    face_m = 0.2e-3
    law = of_laminate(stack([(metal, face_m), (core, film_m), (metal, face_m)]))
    half = face_m + film_m / 2
    # Exact: the core up to half the film, the metal from there to the surface.
    assert [(band.low, band.high) for band in law.bands] == [
        (0.0, pytest.approx(film_m / 2 / half, rel=1e-9)),
        (pytest.approx(film_m / 2 / half, rel=1e-9), pytest.approx(1.0, rel=1e-12)),
    ]
    assert law.bands[0].yield_strain is None
    # The whole stiffness is that of the section by its own moduli.
    share = [band.stiffness * (band.high**3 - band.low**3) for band in law.bands]
    assert sum(share) == pytest.approx(1.0, rel=1e-12)
    moduli = law.bands[1].stiffness / law.bands[0].stiffness
    assert moduli == pytest.approx(metal.young_pa / core.young_pa, rel=1e-12)


def test_too_many_springs_for_a_section_are_refused() -> None:
    stiff = of_material(Material(name="nearly elastic", tangent_pa=69.9999999e9, **METAL))
    with pytest.raises(InputError, match="100 springs cannot follow"):
        stiff.springs(T_M, 100)


def test_a_half_circle_of_an_ideal_section_has_its_plastic_moment_in_the_middle() -> None:
    """Far beyond yield the end force follows from statics: P × rise is the moment in the middle."""
    sheet = Sheet(
        length_m=0.4,
        width_m=0.057,
        thickness_m=T_M,
        young_pa=70e9,
        poisson_ratio=0.3,
        density_kg_per_m3=2700.0,
        plasticity=IDEAL,
    )
    x = 0.15
    state = solve_plastic(sheet, 0.8, x, 0.0)
    middle = float(IDEAL.moment(np.array([state.curvature_max_per_m]), T_M)[0])
    moment = middle * sheet.bending_stiffness_nm2
    # Analytic bounds: between the elastic and the plastic limit of the section.
    assert FIRST < middle < 1.5 * FIRST
    # Analytic: moments about the middle, M(L/2) = M(0) − P × rise; a rise below that of two chords.
    rise = (state.end_moment_nm + moment) / state.end_force_n
    assert 0.0 < rise < np.sqrt(0.2**2 - x**2)
    assert rise > 0.5 * np.sqrt(0.2**2 - x**2)
