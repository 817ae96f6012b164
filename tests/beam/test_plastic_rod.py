"""The rod that yields: the elastic rod below its yield, softer beyond it."""

from dataclasses import replace

import numpy as np
import pytest

from dualbend.beam import elastica
from dualbend.beam.plastic import Band, Plasticity
from dualbend.beam.rod.planar import solve_symmetric
from dualbend.beam.rod.plastic import solve_plastic
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError


def law(yield_strain: float) -> Plasticity:
    return Plasticity(
        (Band(low=0.0, high=1.0, stiffness=1.0, yield_strain=yield_strain, tangent_ratio=1e-3),)
    )


SHEET = Sheet(
    length_m=0.4,
    width_m=0.057,
    thickness_m=0.8e-3,
    young_pa=69e9,
    poisson_ratio=0.33,
    density_kg_per_m3=2700.0,
    plasticity=law(1.0),
)
Q = SHEET.weight_per_length_n_per_m


@pytest.mark.parametrize("alpha", [0.3, 0.8])
def test_below_its_yield_it_is_the_elastic_rod(alpha: float) -> None:
    # Off the zero-moment pose, and with weight: all terms are there.
    x = 0.999 * elastica.half_distance(alpha, SHEET.length_m)
    found = solve_plastic(SHEET, alpha, x, Q)
    wanted = solve_symmetric(SHEET.bending_stiffness_nm2, SHEET.length_m, alpha, x, Q)
    # Both to their solvers' tolerances.
    assert found.end_force_n == pytest.approx(wanted.end_force_n, rel=1e-6)
    assert found.end_moment_nm == pytest.approx(wanted.end_moment_nm, rel=1e-5)
    largest = float(abs(wanted.curvature_per_m).max())
    assert found.curvature_max_per_m == pytest.approx(largest, rel=1e-6)


def test_beyond_its_yield_it_pushes_less_and_bends_more_in_the_middle() -> None:
    alpha = 0.8
    x = elastica.half_distance(alpha, SHEET.length_m)
    elastic = solve_plastic(SHEET, alpha, x, 0.0)
    soft = replace(SHEET, plasticity=law(1.7e-3))
    found = solve_plastic(soft, alpha, x, 0.0)
    assert found.end_force_n < elastic.end_force_n
    assert found.curvature_max_per_m > elastic.curvature_max_per_m
    # The section in the middle carries no more than its plastic moment, hardening of 0.1 % aside.
    middle = float(
        soft.plasticity.moment(np.array([found.curvature_max_per_m]), SHEET.thickness_m)[0]  # type: ignore[union-attr]
    )
    full = 1.5 * soft.plasticity.first_yield(SHEET.thickness_m)  # type: ignore[union-attr]
    assert middle < 1.02 * full


def test_an_elastic_sheet_is_not_for_it() -> None:
    with pytest.raises(InputError, match="does not yield"):
        solve_plastic(replace(SHEET, plasticity=None), 0.5, 0.19, 0.0)
