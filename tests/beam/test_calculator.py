"""The calculator: closed form, rod, rigidities and strain, each against what it is made of."""

import math

import numpy as np
import pytest

from dualbend.beam import elastica
from dualbend.beam.calculator import bent_sheet
from dualbend.beam.material import find_material
from dualbend.beam.material_table import sources
from dualbend.beam.path import (
    ApproximatePath,
    ExactPath,
    PiecewiseLinearPath,
    TablePath,
)
from dualbend.beam.rigidity import rigidity_ratio, searle_parameter
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.path_moment import worst_moment
from dualbend.beam.sheet import Anisotropy, Sheet
from dualbend.beam.time_law import ConstantSpeed, TrapezoidalSpeed
from dualbend.errors import InputError
from support.sheets import PANEL, STRIP

L, W, T, E = 0.6, 0.1, 1e-3, 69e9
EI = E * W * T**3 / 12.0
ALPHA = 0.7


def test_alone_it_is_the_closed_form() -> None:
    found = bent_sheet(L, W, T, E, ALPHA)
    # Analytic: paper (1), (3), (4).
    assert found["force_n"] == pytest.approx(elastica.end_force(ALPHA, EI, L), rel=1e-12)
    assert found["moment_nm"] == 0.0
    assert found["half_distance_m"] == elastica.half_distance(ALPHA, L)
    assert found["rise_m"] == elastica.rise(ALPHA, L)
    assert found["curvature_max_per_m"] == elastica.curvature_max(ALPHA, L)
    assert found["bending_stiffness_nm2"] == pytest.approx(EI, rel=1e-12)
    assert not {"surface_strain", "limit_strain"} & found.keys()


@pytest.mark.parametrize(("half_m", "weight"), [(0.25, None), (0.25, 2.0), (None, 2.0)])
def test_off_the_closed_form_it_is_the_rod(half_m: float | None, weight: float | None) -> None:
    found = bent_sheet(L, W, T, E, ALPHA, half_m, weight)
    x = elastica.half_distance(ALPHA, L) if half_m is None else half_m
    state = rod.solve_symmetric(EI, L, ALPHA, x, weight or 0.0)
    # Analytic: the same rod.
    assert found["half_distance_m"] == x
    assert found["force_n"] == pytest.approx(state.end_force_n, rel=1e-9)
    assert found["moment_nm"] == pytest.approx(state.end_moment_nm, rel=1e-9)
    assert abs(found["moment_nm"]) > 1e-3
    assert found["rise_m"] == pytest.approx(state.rise_m, rel=1e-12)
    largest = np.abs(state.curvature_per_m).max()
    assert found["curvature_max_per_m"] == pytest.approx(largest, rel=1e-12)


def test_no_weight_may_be_said_of_a_material_that_has_some() -> None:
    light = bent_sheet(L, W, T, None, ALPHA, weight_n_per_m=0.0, material="5052-H32")
    heavy = bent_sheet(L, W, T, None, ALPHA, material="5052-H32")
    metal = find_material("5052-H32")
    stiff = metal.young_pa * W * T**3 / 12.0
    weight = metal.density_kg_per_m3 * W * T * 9.81
    x = elastica.half_distance(ALPHA, L)
    # Analytic: closed form without weight, rod with ρ w t g.
    assert light["force_n"] == pytest.approx(elastica.end_force(ALPHA, stiff, L), rel=1e-12)
    expected = rod.solve_symmetric(stiff, L, ALPHA, x, weight).end_force_n
    assert heavy["force_n"] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rigidity", ["beam", "plate", "width"])
def test_the_rigidities_are_told_against_beam_and_against_the_one_that_is_taken(
    rigidity: str,
) -> None:
    nu = 0.4
    found = bent_sheet(L, W, T, E, ALPHA, rigidity=rigidity, poisson_ratio=nu)
    curvature = elastica.curvature_max(ALPHA, L)
    ratios = {
        "beam": 1.0,
        "plate": 1.0 / (1.0 - nu**2),
        "width": rigidity_ratio("width", nu, W, T, curvature),
    }
    # Analytic: force goes with stiffness.
    assert found["bending_stiffness_nm2"] == pytest.approx(EI * ratios[rigidity], rel=1e-12)
    assert found["searle_parameter"] == pytest.approx(W**2 * curvature / T, rel=1e-12)
    for kind, ratio in ratios.items():
        if kind != rigidity:
            change = 100.0 * (ratio / ratios[rigidity] - 1.0)
            assert found[f"force_as_{kind}_percent"] == pytest.approx(change, rel=1e-9)
        if kind != "beam":
            assert found[f"{kind}_over_beam"] == pytest.approx(ratio, rel=1e-12)
    assert f"force_as_{rigidity}_percent" not in found


@pytest.mark.parametrize(("alpha", "beyond"), [(0.2, False), (1.2, True)])
def test_a_material_tells_its_strain_and_limit(alpha: float, beyond: bool) -> None:
    found = bent_sheet(L, W, 4.0 * T, None, alpha, weight_n_per_m=0.0, material="5052-H32")
    metal = find_material("5052-H32")
    # Analytic: κ t / 2 against σ_y / E.
    strain = elastica.curvature_max(alpha, L) * 4.0 * T / 2.0
    assert found["surface_strain"] == pytest.approx(strain, rel=1e-12)
    assert found["limit_strain"] == pytest.approx(metal.yield_pa / metal.young_pa, rel=1e-12)
    assert found["beyond_limit"] is beyond


def test_what_cannot_be_calculated_says_why() -> None:
    with pytest.raises(InputError, match=r"half distance = 0\.31 m: taut"):
        bent_sheet(L, W, T, E, 0.1, 0.31)
    with pytest.raises(InputError, match="--young is missing"):
        bent_sheet(L, W, T, None, ALPHA)
    with pytest.raises(InputError, match="--material tin: unknown material"):
        bent_sheet(L, W, T, None, ALPHA, material="tin")
    with pytest.raises(InputError, match="must be 'beam', 'plate' or 'width', got 'wide'"):
        rigidity_ratio("wide", 0.3, W, T, 1.0)  # type: ignore[arg-type]


# --- the sheet's section ------------------------------------------------------------------------


def test_an_isotropic_sheet_is_one_whose_ratios_are_one() -> None:
    sizes = {"length_m": L, "width_m": W, "thickness_m": T, "young_pa": E, "poisson_ratio": 0.3}
    bent = {"rigidity": "width", "curvature_per_m": 3.0, "density_kg_per_m3": 2700.0}
    plain = Sheet(**sizes, **bent)
    alike = Sheet(**sizes, **bent, anisotropy=Anisotropy(shear=0.5 / 1.3))
    # Analytic: G = E / (2 (1 + ν)), A11/t and D22/D11 without Poisson's part.
    for name in ("bending_stiffness_nm2", "torsional_stiffness_nm2", "axial_stiffness_n"):
        assert getattr(alike, name) == pytest.approx(getattr(plain, name), rel=1e-12)
    ratio = rigidity_ratio("width", 0.3, W, T, 3.0, 1.0)
    assert plain.bending_stiffness_nm2 == pytest.approx(EI * ratio, rel=1e-12)
    assert 1.0 < ratio < 1.0 / (1.0 - 0.09)
    # A weave that is soft across is flattened more: β⁴ goes with stretch over across.
    across = Sheet(**sizes, **bent, anisotropy=Anisotropy(shear=0.4, stretch=1.5, across=0.5))
    expected = EI * rigidity_ratio("width", 0.3, W, T, 3.0, 3.0)
    assert across.bending_stiffness_nm2 == pytest.approx(expected, rel=1e-12)
    assert across.axial_stiffness_n == pytest.approx(1.5 * E * W * T, rel=1e-12)


def test_searles_parameter_has_no_sign() -> None:
    # Analytic: w² κ / t.
    assert searle_parameter(0.2, 1e-3, -2.0) == pytest.approx(80.0, rel=1e-14)


# --- paths and time laws ------------------------------------------------------------------------


def test_the_worst_moment_is_that_of_a_dense_scan() -> None:
    path = PiecewiseLinearPath(L, (0.1, 0.4, 0.9))
    for weight, stretch in ((False, False), (True, False), (True, True)):
        found = worst_moment(path, PANEL, weight=weight, stretch=stretch)
        alphas = np.linspace(0.1, 0.9, 1601)
        states = rod.follow_symmetric(
            PANEL.bending_stiffness_nm2,
            L,
            [(a, path.at(a)[0]) for a in alphas.tolist()],
            PANEL.weight_per_length_n_per_m if weight else 0.0,
            None,
            PANEL.axial_stiffness_n if stretch else None,
        )
        moments = np.array([abs(state.end_moment_nm) for state in states])
        pieces = [moments[alphas <= 0.4].max(), moments[alphas >= 0.4].max()]
        # Discretisation-limited: the scan misses a peak by half a step, second order.
        np.testing.assert_allclose(found.piece_moments_nm, pieces, rtol=1e-5)
        assert found.moment_nm == max(found.piece_moments_nm)
        assert found.moment_nm >= moments.max() - 1e-12
        assert found.alpha_rad == pytest.approx(alphas[moments.argmax()], abs=5e-4)
        assert found.unsolved == 0


def test_a_part_of_a_path_has_the_pieces_that_lie_in_it() -> None:
    path = PiecewiseLinearPath(L, (0.1, 0.4, 0.9))
    whole = worst_moment(path, PANEL)
    for part, pieces in (((0.1, 0.9), 2), ((0.2, 0.4), 1), ((0.2, 0.5), 2), ((0.4, 0.9), 1)):
        assert worst_moment(path, PANEL, part).piece_moments_nm.size == pieces
    tail = worst_moment(path, PANEL, (0.4, 0.9))
    # Exact: the same samples.
    assert tail.moment_nm == pytest.approx(whole.piece_moments_nm[1], rel=1e-9)


def test_points_without_a_solution_are_counted_and_left_out() -> None:
    """Of a table with the grips 1e-4 of L too far apart at its start, where the sheet is taut."""
    ends = [0.05, 0.5]
    half = [0.5 * L * 1.0001, elastica.half_distance(0.5, L)]
    rise = [elastica.rise(alpha, L) for alpha in ends]
    path = TablePath(L, tuple(zip(ends, half, rise, strict=True)))
    found = worst_moment(path, PANEL)
    taut = [x >= 0.5 * L for x in path.at(np.linspace(*ends, 24))[0]]
    # Exact: the samples of the piece with the grips at least L apart.
    assert found.unsolved == sum(taut) > 0
    assert found.moment_nm > 0.0


@pytest.mark.parametrize("length", [0.0, -0.6, math.nan, math.inf])
def test_a_path_is_for_a_sheet_of_some_length(length: float) -> None:
    for make in (
        lambda: ExactPath(length, 0.5),
        lambda: PiecewiseLinearPath(length, (0.0, 0.5)),
        lambda: ApproximatePath(length, 0.5),
        lambda: TablePath(length, ((0.0, 0.2, 0.0), (1.0, 0.1, 0.1))),
    ):
        with pytest.raises(InputError, match="length_m must be finite and above 0"):
            make()


def test_a_sheet_may_be_of_cork() -> None:
    cork = Sheet(
        length_m=L,
        width_m=W,
        thickness_m=T,
        young_pa=E,
        poisson_ratio=0.0,
        density_kg_per_m3=200.0,
        rigidity="plate",
    )
    # Analytic: without contraction a plate is a beam.
    assert cork.bending_stiffness_nm2 == pytest.approx(EI, rel=1e-14)


def test_no_sheet_is_shortened_by_more_than_half() -> None:
    # Analytic: at half the grippers meet.
    meet = elastica.end_slope_from_shortening(L / 2, L)
    assert meet == pytest.approx(elastica.END_SLOPE_GRIPPERS_MEET, rel=1e-9)
    for shortened in (0.51 * L, -1e-9):
        with pytest.raises(InputError, match="shortening"):
            elastica.end_slope_from_shortening(shortened, L)


def test_every_number_of_a_material_is_listed_with_its_source() -> None:
    material = find_material("5052-H32")
    title, *lines = sources(material).splitlines()
    assert title == f"5052-H32: {material.title}"
    assert len(lines) == len(material.evidence) > 3
    for line, (key, evidence) in zip(lines, material.evidence.items(), strict=True):
        name, value, told = line.split(maxsplit=2)
        assert (name, float(value)) == (key, pytest.approx(getattr(material, key), rel=1e-3))
        assert told == f"{evidence.grade}: {evidence.source}"


@pytest.mark.parametrize("degree", [-1, 13])
def test_the_degree_of_a_polynomial_path_has_bounds(degree: int) -> None:
    with pytest.raises(InputError, match=r"degree must lie in \[0, 12\]"):
        ApproximatePath(L, 0.5, degree=degree)
    assert ApproximatePath(L, 0.5, degree=12).coefficients[0].size == 13
    x, y = ApproximatePath(L, 0.1, degree=0).at(0.1)
    # Analytic: the leading terms, x = L/2 − L α²/8 and y = L α/π, to α² of themselves.
    assert L / 2 - x == pytest.approx(L * 0.01 / 8, rel=0.01)
    assert y == pytest.approx(L * 0.1 / math.pi, rel=0.01)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("name", ["start_rad", "end_rad"])
def test_a_motion_goes_between_numbers(name: str, bad: float) -> None:
    ends = {"start_rad": 0.0, "end_rad": 1.0, name: bad}
    with pytest.raises(InputError, match=f"{name} must be finite"):
        ConstantSpeed(**ends, speed_rad_per_s=0.1)
    with pytest.raises(InputError, match=f"{name} must be finite"):
        TrapezoidalSpeed(**ends, speed_rad_per_s=0.1, acceleration_rad_per_s2=1.0)


def test_the_strip_of_the_scenarios_by_hand() -> None:
    """Written down: 57 × 0.5 mm of E = 70.3 GPa, 0.4 m long."""
    assert STRIP.bending_stiffness_nm2 == pytest.approx(70.3e9 * 0.057 * 1.25e-10 / 12, rel=1e-12)
    assert STRIP.bending_stiffness_nm2 == pytest.approx(0.04174, abs=5e-6)
    assert STRIP.axial_stiffness_n == pytest.approx(2.0036e6, rel=1e-4)
    assert STRIP.weight_per_length_n_per_m == pytest.approx(2680 * 28.5e-6 * 9.81, rel=1e-12)
    assert STRIP.euler_load_n == pytest.approx(2.5747, rel=1e-4)
