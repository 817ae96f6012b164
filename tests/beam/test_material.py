"""The library's numbers are possible and have sources; sections that yield obey the mechanics."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualbend.beam import material_table
from dualbend.beam.laminate import stack
from dualbend.beam.material import GRADES, Material, find_material, library
from dualbend.beam.plastic import Plasticity, of_laminate, of_material
from dualbend.beam.rigidity import anticlastic_share, rigidity_ratio, searle_parameter
from dualbend.errors import InputError

METALS = [name for name, found in library().items() if found.yield_pa is not None]
EPP = Material(
    name="ideal", young_pa=70e9, poisson_ratio=0.33, density_kg_per_m3=2700.0, yield_pa=140e6
)
T_M = 1e-3


def ideal() -> tuple[Plasticity, float]:
    """Return a perfectly plastic section and its curvature at first yield, 2 ε_y / t."""
    return of_material(EPP), 2.0 * 140e6 / 70e9 / T_M


@pytest.mark.parametrize("name", library())
def test_a_material_is_possible_and_every_number_has_a_source(name: str) -> None:
    found = find_material(name)
    numbers = {"young_pa", "poisson_ratio", "density_kg_per_m3"} | (
        {"yield_pa", "tangent_pa"} if found.yield_pa is not None else {"strain_at_failure"}
    )
    assert numbers <= set(found.evidence)
    assert all(said.grade in GRADES and said.source for said in found.evidence.values())
    # A positive strain energy: ν12 ν21 < 1, and G of an isotropic sheet between E/3 and E/2.
    assert found.mean_poisson < 1.0
    if found.shear_pa is None:
        assert found.young_pa / 3.0 < found.in_plane_shear_pa <= found.young_pa / 2.0
    # Every one of them yields or breaks between 0.1 and 3 %: a factor of 1000 would not pass.
    assert found.limit_strain is not None
    assert 1e-3 < found.limit_strain < 3e-2


def test_both_directions_of_fr4_are_one_material() -> None:
    along, across = find_material("FR-4"), find_material("FR-4-crosswise")
    assert (along.young_pa, along.transverse_pa) == (across.transverse_pa, across.young_pa)
    # Symmetry of the compliance, ν12/E1 = ν21/E2; to the three digits of the table.
    ratio = along.poisson_ratio / along.young_pa
    assert ratio == pytest.approx(across.poisson_ratio / across.young_pa, rel=5e-3)


def test_an_unknown_material_names_the_nearest_and_all_valid_ones() -> None:
    with pytest.raises(InputError, match=r"did you mean '6061-T6'.*") as caught:
        find_material("6061-t66")
    assert all(name in str(caught.value) for name in library())


@pytest.mark.parametrize(
    ("key", "value"),
    [("young_pa", 0.0), ("yield_pa", -1.0), ("tangent_pa", 70e9), ("poisson_ratio", 0.5)],
)
def test_an_impossible_material_is_refused_with_the_key(key: str, value: float) -> None:
    numbers = {"young_pa": 70e9, "poisson_ratio": 0.3, "density_kg_per_m3": 2700.0, key: value}
    with pytest.raises(InputError, match=key):
        Material(name="wrong", **numbers)  # type: ignore[arg-type]


def test_the_tables_hold_every_material() -> None:
    for text in (material_table.overview(library()), material_table.markdown(library())):
        assert all(name in text for name in library())
    assert set(json.loads(material_table.as_json(library()))) == set(library())


def test_the_page_has_the_table_of_the_library() -> None:
    page = Path(__file__).parents[2] / "docs" / "materials.md"
    # Made with: dualbend materials --markdown
    assert material_table.markdown(library()) in page.read_text(encoding="utf-8")


def test_the_plastic_moment_is_one_and_a_half_times_the_first() -> None:
    section, first = ideal()
    elastic, full = section.moment(np.array([first, 1e4 * first]), T_M)
    assert section.first_yield(T_M) == pytest.approx(first, rel=1e-14)  # analytic
    assert elastic == pytest.approx(first, rel=1e-14)  # analytic: M_y = EI κ_y
    # Analytic: M_p (1 − (κ_y/κ)²/3) is M_p to 3e-9 there.
    assert full == pytest.approx(1.5 * first, rel=1e-8)


@given(ratio=st.floats(1.0, 100.0))
def test_moment_of_the_rectangle_beyond_its_first_yield(ratio: float) -> None:
    section, first = ideal()
    moment = float(section.moment(np.array([ratio * first]), T_M)[0])
    assert moment == pytest.approx(1.5 * first * (1.0 - 1.0 / (3.0 * ratio**2)), rel=1e-12)


@pytest.mark.parametrize("name", METALS)
def test_moment_is_the_integral_of_the_stress(name: str) -> None:
    found = find_material(name)
    section = of_material(found)
    limit, r = found.yield_pa / found.young_pa, found.tangent_pa / found.young_pa  # type: ignore[operator]
    places = 20_000
    z = (np.arange(places) + 0.5) / places * 2.0 - 1.0
    for ratio in (0.7, 1.5, 6.0):
        curvature = ratio * section.first_yield(T_M)
        strain = curvature * z * T_M / 2.0
        over = np.maximum(np.abs(strain) - limit, 0.0)
        stress = strain - np.sign(strain) * (1.0 - r) * over  # over E
        moment = 1.5 * float(2.0 / places * (stress @ z)) / (T_M / 2.0)
        # Quadrature-limited: the mid-point rule, 20000⁻² of the moment.
        assert float(section.moment(np.array([curvature]), T_M)[0]) == pytest.approx(
            moment, rel=1e-5
        )


@given(
    ratio=st.floats(1e-3, 30.0),
    yield_mpa=st.floats(20.0, 2000.0),
    hardening=st.floats(0.0, 0.9),
)
def test_a_section_never_carries_more_than_elastically_nor_springs_back_too_far(
    ratio: float, yield_mpa: float, hardening: float
) -> None:
    numbers = {"young_pa": 70e9, "tangent_pa": hardening * 70e9, "yield_pa": yield_mpa * 1e6}
    section = of_material(
        Material(name="any", poisson_ratio=0.3, density_kg_per_m3=2700.0, **numbers)
    )
    first = section.first_yield(T_M)
    curvature = np.array([ratio * first, 1.01 * ratio * first])
    moment, kept = section.moment(curvature, T_M), section.residual(curvature, T_M)
    assert moment[1] >= moment[0]  # a stable material
    assert np.all(kept >= -1e-12 * curvature)
    if ratio <= 0.99:
        np.testing.assert_allclose(kept, 0.0, atol=1e-12 * first)  # elastic: nothing is kept
    # Kinematic bound: it cannot keep more than it was bent beyond the first yield.
    assert np.all(kept <= np.maximum(curvature - first, 0.0) + 1e-12 * first)


@pytest.mark.parametrize("name", METALS)
@pytest.mark.parametrize(("count", "bound"), [(6, 0.02), (10, 0.007)])
def test_springs_of_a_hinge_follow_the_section(name: str, count: int, bound: float) -> None:
    section = of_material(find_material(name))
    first = section.first_yield(T_M)
    springs = section.springs(T_M, count)
    assert springs.share.sum() + springs.elastic == pytest.approx(1.0, rel=1e-12)  # E I, elastic
    curvature = np.geomspace(0.1, 11.0, 500) * first
    wrong = np.abs(springs.moment(curvature) - section.moment(curvature, T_M)) / curvature
    # Discretisation-limited, as the square of the number: error of the kept curvature over κ.
    assert wrong[curvature < first].max() < 1e-12
    assert wrong.max() < bound


def test_a_loop_closes_and_costs_its_area() -> None:
    section, first = ideal()
    springs = section.springs(T_M, 10)
    top = 3.0 * first
    cycle = np.concatenate(
        [np.linspace(a, b, 401) for a, b in ((0, top), (top, -top), (-top, top), (top, -top))]
    )
    moment = springs.follow(cycle[:, None])[:, 0]
    up, again = moment[802:1203], moment[1203:]
    # Masing: the way back is the first way twice as large, and the way up again its mirror.
    np.testing.assert_allclose(up, -moment[401:802], atol=1e-12 * first)
    np.testing.assert_allclose(again, moment[401:802], atol=1e-12 * first)
    virgin = springs.moment(np.linspace(0.0, top, 401))
    np.testing.assert_allclose(moment[400] - moment[401:802], 2.0 * virgin, atol=1e-12 * first)
    # What a cycle costs is positive: ∮ M dκ.
    assert np.trapezoid(moment[401:1203], cycle[401:1203]) > 0.0


@given(share=st.floats(0.0, 0.999))
def test_below_the_first_yield_the_way_back_is_the_way_there(share: float) -> None:
    section, first = ideal()
    way = np.array([0.0, share, -share, 0.3 * share, 0.0])[:, None] * first
    np.testing.assert_allclose(section.springs(T_M, 8).follow(way), way, atol=1e-12 * first)


def test_letting_go_is_elastic_and_leaves_the_closed_form() -> None:
    section, first = ideal()
    springs = section.springs(T_M, 12)
    for ratio in (1.5, 3.0, 8.0):
        bent = ratio * first
        kept = bent - float(springs.moment(np.array([bent]))[0])
        left = springs.follow(np.array([[bent], [kept]]))[-1, 0]
        assert left == pytest.approx(0.0, abs=1e-9 * first)  # no spring slips on the way back
        # Discretisation-limited: twelve springs.
        assert kept == pytest.approx(float(section.residual(np.array([bent]), T_M)[0]), rel=0.012)


def test_what_breaks_cannot_yield() -> None:
    with pytest.raises(InputError, match="FR-4 has no yield strength"):
        of_material(find_material("FR-4"))
    with pytest.raises(InputError, match="FR-4"):
        of_laminate(stack([(find_material("FR-4"), 1e-3)]))


def test_layers_of_one_metal_yield_as_the_sheet_does() -> None:
    metal = find_material("5052-H32")
    layered = of_laminate(stack([(metal, 0.2e-3), (metal, 0.6e-3), (metal, 0.2e-3)]))
    curvature = np.linspace(0.1, 5.0, 50) * of_material(metal).first_yield(T_M)
    np.testing.assert_allclose(
        layered.moment(curvature, T_M), of_material(metal).moment(curvature, T_M), rtol=1e-12
    )  # analytic


@given(nu=st.floats(0.01, 0.49), width=st.floats(1e-3, 2.0), curvature=st.floats(1e-4, 50.0))
def test_the_width_lies_between_beam_and_plate(nu: float, width: float, curvature: float) -> None:
    found = rigidity_ratio("width", nu, width, 1e-3, curvature)
    assert 1.0 - 1e-12 <= found <= rigidity_ratio("plate", nu, width, 1e-3, curvature)


def test_a_narrow_strip_is_a_beam_and_a_wide_one_a_plate() -> None:
    # Limits by Searle's parameter: 0.01 and 1e6; the edges of a wide one are 0.75/B of its width.
    for nu in (0.1, 0.33, 0.45):
        narrow = rigidity_ratio("width", nu, 1e-3, 1e-3, 10.0)
        assert searle_parameter(1e-3, 1e-3, 10.0) == pytest.approx(0.01)
        assert narrow == pytest.approx(1.0, abs=1e-5)
        wide = rigidity_ratio("width", nu, 1.0, 1e-3, 1000.0)
        assert wide == pytest.approx(1.0 / (1.0 - nu**2), rel=2e-3 * nu**2)


def test_the_moment_is_the_slope_of_the_energy_of_the_section_across() -> None:
    # The section across solved anew, by finite elements in the space of its own bending.
    nu, t, w = 0.33, 1e-3, 0.05
    for curvature in (2.0, 10.0, 60.0):
        step = 1e-4 * curvature
        slope = (_energy(nu, t, w, curvature + step) - _energy(nu, t, w, curvature - step)) / (
            2.0 * step
        )
        found = rigidity_ratio("width", nu, w, t, curvature) * w * t**3 / 12.0 * curvature
        # Discretisation-limited: polynomials of degree 30; the difference quotient costs 1e-8.
        assert slope == pytest.approx(found, rel=1e-6)


def _energy(nu: float, t: float, w: float, curvature: float) -> float:
    """Return the least energy per length over E, w(y) an even polynomial of degree 30."""
    y, weight = np.polynomial.legendre.leggauss(60)
    D = t**3 / 12.0 / (1.0 - nu**2)
    weight = weight * w / 2.0
    basis = np.polynomial.legendre.Legendre.basis
    shapes = np.array([basis(n)(y) for n in range(0, 31, 2)])
    bends = np.array([basis(n).deriv(2)(y) if n else 0 * y for n in range(0, 31, 2)]) * 4 / w**2
    stiff = (D * bends * weight) @ bends.T + (t * curvature**2 * shapes * weight) @ shapes.T
    load = -D * nu * curvature * bends @ weight
    best = np.linalg.solve(stiff, load)
    return float(0.5 * D * w * curvature**2 - 0.5 * load @ best)


def test_share_of_free_bending_is_continuous_at_its_limits() -> None:
    # The series and the limit are cut off where they are exact to 1e-6 and 1e-12.
    assert anticlastic_share(0.0301) == pytest.approx(1.0, abs=2e-6)
    assert anticlastic_share(17.99) == pytest.approx(0.75 / 17.99, rel=1e-12)
    assert math.isfinite(anticlastic_share(1e6))
