"""What a scenario's sheet is in numbers, before the run: each against its closed form."""

from dataclasses import replace

import pytest

from dualbend.beam import elastica
from dualbend.beam.rigidity import rigidity_ratio
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.evaluation.sheet import no_theory, nominal_strain, rigidity_choices, sheet_report
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from support.strip import STRIP6

WIDE = Sheet(
    length_m=0.4,
    width_m=0.2,
    thickness_m=0.5e-3,
    young_pa=70e9,
    poisson_ratio=0.35,
    density_kg_per_m3=2700.0,
)


@pytest.mark.parametrize("taken", ["beam", "plate", "width"])
def test_three_ways_to_take_the_bending_stiffness(taken: str) -> None:
    curvature = 4.0
    beam = WIDE.young_pa * WIDE.width_m * WIDE.thickness_m**3 / 12.0
    ratios = {
        "beam": 1.0,
        "plate": 1.0 / (1.0 - 0.35**2),
        "width": rigidity_ratio("width", 0.35, 0.2, 0.5e-3, curvature),
    }
    found = rigidity_choices(replace(WIDE, rigidity=taken, curvature_per_m=curvature), 9.0)
    assert found.keys() == ratios.keys()
    for kind, ratio in ratios.items():
        # Analytic; the force goes with the stiffness.
        assert found[kind].over_beam == pytest.approx(ratio, rel=1e-12)
        assert found[kind].bending_stiffness_nm2 == pytest.approx(beam * ratio, rel=1e-12)
        change = 100.0 * (ratio / ratios[taken] - 1.0)
        assert found[kind].end_force_change_percent == pytest.approx(change, abs=1e-9)
    assert 1.0 < ratios["width"] < ratios["plate"]
    # A sheet that is given no curvature is looked at with that of the path.
    bare = rigidity_choices(WIDE, curvature)
    assert bare["width"].over_beam == pytest.approx(ratios["width"], rel=1e-12)


LIGHT = ("sheet.density_kg_per_m3=100", "sheet.young_pa=1e12", "sheet.thickness_m=0.0028")
"""Hardly any weight for its stiffness."""


def scenario(*settings: str) -> Scenario:
    return load_scenario(STRIP6, ["path=exact", *settings])


@pytest.mark.parametrize("end", [0.4, 1.2])
def test_the_strain_of_the_zero_moment_path_is_the_elasticas(end: float) -> None:
    light = scenario(f"path.end_rad={end}", *LIGHT)
    sheet = light.sheet.sheet()
    # Analytic: without weight (q L³/EI is 1e-5) it is bent most in the middle, at the path's end.
    expected = elastica.surface_strain(end, sheet.length_m, sheet.thickness_m)
    assert nominal_strain(light) == pytest.approx(expected, rel=1e-6)


def test_the_weight_of_a_heavy_sheet_is_in_its_strain() -> None:
    heavy = scenario("path.end_rad=0.3", "sheet.density_kg_per_m3=20000")
    sheet = heavy.sheet.sheet()
    x = elastica.half_distance(0.3, sheet.length_m)
    weight = 20000 * sheet.width_m * sheet.thickness_m * 9.81
    state = rod.solve_symmetric(sheet.bending_stiffness_nm2, sheet.length_m, 0.3, x, weight)
    # Analytic: the rod with ρ w t g at the end of the path, where it is bent most.
    expected = abs(state.curvature_per_m).max() * sheet.thickness_m / 2.0
    assert nominal_strain(heavy) == pytest.approx(expected, rel=1e-9)
    plain = elastica.surface_strain(0.3, sheet.length_m, sheet.thickness_m)
    assert abs(nominal_strain(heavy) / plain - 1.0) > 1e-3


def test_a_path_of_pieces_strains_between_its_knots_too() -> None:
    """Two chords of 0.6 rad: off the zero-moment path the sheet bends more than at the knots."""
    coarse = load_scenario(STRIP6, ["path.end_rad=1.2", "path.interval_rad=0.6"])
    sheet = coarse.sheet.sheet()
    at_end = elastica.surface_strain(1.2, sheet.length_m, sheet.thickness_m)
    # Bound: not below that of the last knot; weight aside.
    assert nominal_strain(coarse) >= at_end * (1.0 - 1e-2)


def test_the_report_holds_the_sheets_own_numbers() -> None:
    given = scenario(
        "path.end_rad=0.9",
        "sheet.material=2024-T3",
        "sheet.thickness_m=0.0004",
        "sheet.width_m=0.05",
    )
    report, sheet = sheet_report(given), given.sheet.sheet()
    # Exact.
    assert report.thickness_m == 0.0004
    assert report.young_pa == sheet.young_pa
    assert report.density_kg_per_m3 == sheet.density_kg_per_m3
    assert report.torsional_stiffness_nm2 == sheet.torsional_stiffness_nm2
    assert report.rigidity == sheet.rigidity
    curvature = elastica.curvature_max(0.9, sheet.length_m)
    # Analytic: w² κ / t at the end of the path.
    assert report.searle_parameter == pytest.approx(0.05**2 * curvature / 0.0004, rel=1e-12)
    assert report.choices == rigidity_choices(sheet, curvature)
    assert report.limit_strain == given.limit_strain


@pytest.mark.parametrize(
    ("thickness", "plastic", "exceeds", "says"),
    [
        (0.0005, "false", False, ""),
        (0.0005, "true", False, "may yield, which the elastic theory does not know"),
        (0.0028, "false", True, ""),
        (0.0028, "true", True, "the sheet yields"),
    ],
)
def test_what_the_elastic_theory_says_of_a_sheet_that_yields_or_does_not(
    thickness: float, plastic: str, exceeds: bool, says: str
) -> None:
    settings = (
        "sheet.material=2024-T3",
        f"sheet.thickness_m={thickness}",
        f"sheet.plastic={plastic}",
    )
    case = scenario("path.end_rad=0.6", *settings)
    report = sheet_report(case)
    assert (report.exceeds, report.yields) == (exceeds, True)
    assert report.plastic is (plastic == "true")
    assert report.theory.startswith("does not apply" if exceeds else "applies")
    assert (no_theory(case) == "") is (plastic == "false")
    assert says in no_theory(case)
    assert report.nominal_strain is not None
    assert report.limit_strain is not None
    assert exceeds is (report.nominal_strain > report.limit_strain)


def test_what_breaks_does_not_yield() -> None:
    report = sheet_report(scenario("path.end_rad=0.6", "sheet.material=FR-4"))
    assert not report.yields
    assert not report.plastic
