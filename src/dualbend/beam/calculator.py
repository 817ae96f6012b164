"""The calculator behind ``dualbend beam``: one state of a bent sheet, in numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dualbend.beam import elastica
from dualbend.beam.laminate import stack
from dualbend.beam.material import Material, find_material
from dualbend.beam.rigidity import Rigidity, searle_parameter
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError, refusing

_POISSON, _NO_DENSITY = 0.3, 1.0
"""Without a material: an assumed cross contraction, and a density that does not enter."""


def bent_sheet(
    length_m: float,
    width_m: float,
    thickness_m: float,
    young_pa: float | None,
    alpha_rad: float,
    half_distance_m: float | None = None,
    weight_n_per_m: float | None = None,
    *,
    material: str | None = None,
    rigidity: Rigidity = "beam",
    poisson_ratio: float | None = None,
) -> dict[str, float | bool]:
    """Return force, moment, half distance, rise and largest curvature of a symmetric state.

    Without a half distance the grips have no end moment, paper (3). Without a weight
    that state is the closed form (1)-(5); everything else is solved by
    :mod:`dualbend.beam.rod.planar`.
    The result also contains the bending stiffness, and for each kind of rigidity its ratio to EI
    and the change of force [%]; with a material's limit the surface strain, the limit and whether
    it is exceeded.

    Raises
    ------
    InputError
        A number is out of range, or the state cannot be solved; the message says why.
    """
    named = None if material is None else _named(material)
    sheet = _sheet(length_m, width_m, thickness_m, young_pa, poisson_ratio, named)
    curvature = elastica.curvature_max(alpha_rad, length_m)
    sheet = replace(sheet, rigidity=rigidity, curvature_per_m=curvature)
    if weight_n_per_m is None:
        weight_n_per_m = 0.0 if named is None else sheet.weight_per_length_n_per_m
    try:
        state = _state(sheet, alpha_rad, half_distance_m, weight_n_per_m)
    except OverflowError as error:
        raise InputError("length, width, thickness or young is too large; all are SI") from error
    return {**state, **_rigidities(sheet), **_strain(sheet, named, state["curvature_max_per_m"])}


def _named(material: str) -> Material:
    with refusing(f"--material {material}"):
        return find_material(material)


def _sheet(
    length_m: float,
    width_m: float,
    thickness_m: float,
    young_pa: float | None,
    poisson_ratio: float | None,
    material: Material | None,
) -> Sheet:
    if young_pa is None and material is None:
        raise InputError("--young is missing; give it, or --material")
    young, poisson, density = young_pa, _POISSON, _NO_DENSITY
    if material is not None:
        young = material.young_pa if young is None else young
        poisson, density = material.mean_poisson, material.density_kg_per_m3
    assert young is not None
    return Sheet(
        length_m=length_m,
        width_m=width_m,
        thickness_m=thickness_m,
        young_pa=young,
        poisson_ratio=poisson if poisson_ratio is None else poisson_ratio,
        density_kg_per_m3=density,
    )


def _state(
    sheet: Sheet, alpha_rad: float, half_distance_m: float | None, weight_n_per_m: float
) -> dict[str, float]:
    EI, length_m = sheet.bending_stiffness_nm2, sheet.length_m
    zero_moment = elastica.half_distance(alpha_rad, length_m)
    if half_distance_m is None and weight_n_per_m == 0.0:
        return {
            "force_n": elastica.end_force(alpha_rad, EI, length_m),
            "moment_nm": 0.0,
            "half_distance_m": zero_moment,
            "rise_m": elastica.rise(alpha_rad, length_m),
            "curvature_max_per_m": elastica.curvature_max(alpha_rad, length_m),
        }
    half_distance = zero_moment if half_distance_m is None else half_distance_m
    state = rod.solve_symmetric(EI, length_m, alpha_rad, half_distance, weight_n_per_m)
    if not state.converged:
        raise InputError(
            f"no bent state at alpha = {alpha_rad} rad, half distance = {half_distance} m: "
            f"{state.reason}"
        )
    return {
        "force_n": state.end_force_n,
        "moment_nm": state.end_moment_nm,
        "half_distance_m": half_distance,
        "rise_m": state.rise_m,
        "curvature_max_per_m": float(np.max(np.abs(state.curvature_per_m))),
    }


def _rigidities(sheet: Sheet) -> dict[str, float]:
    """Return the stiffness; for each kind of rigidity its ratio to EI and the force change."""
    taken = sheet.rigidity_over_beam(sheet.rigidity)
    found = {
        "bending_stiffness_nm2": sheet.bending_stiffness_nm2,
        "searle_parameter": searle_parameter(
            sheet.width_m, sheet.thickness_m, sheet.curvature_per_m
        ),
    }
    kinds: tuple[Rigidity, ...] = ("beam", "plate", "width")
    for kind in kinds:
        ratio = sheet.rigidity_over_beam(kind)
        if kind != "beam":
            found[f"{kind}_over_beam"] = ratio
        if kind != sheet.rigidity:
            found[f"force_as_{kind}_percent"] = 100.0 * (ratio / taken - 1.0)
    return found


def _strain(
    sheet: Sheet, material: Material | None, curvature_per_m: float
) -> dict[str, float | bool]:
    limit = None if material is None else stack([(material, sheet.thickness_m)]).surface_limit()
    if limit is None:
        return {}
    strain = curvature_per_m * sheet.thickness_m / 2.0
    return {
        "surface_strain": strain,
        "limit_strain": limit,
        "beyond_limit": bool(strain > limit),
    }
