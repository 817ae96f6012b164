"""The calculator behind ``dualbend beam``: one state of a bent sheet, in numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np

from dualbend.beam import elastica
from dualbend.beam.laminate import stack
from dualbend.beam.material import Material, find_material
from dualbend.beam.rigidity import Rigidity, searle_parameter
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError

_NO_MATERIAL = Material(name="", young_pa=1.0, poisson_ratio=0.3, density_kg_per_m3=1.0)
"""Without a material: an assumed Poisson's ratio; modulus and density do not enter."""


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

    Raises InputError where a number is out of range, or the state cannot be solved.
    """
    named = None
    if material is not None:
        try:
            named = find_material(material)
        except InputError as error:
            raise InputError(f"--material {material}: {error}") from error
    elif young_pa is None:
        raise InputError("--young is missing; give it, or --material")
    base = named or _NO_MATERIAL
    sheet = Sheet(
        length_m=length_m,
        width_m=width_m,
        thickness_m=thickness_m,
        young_pa=base.young_pa if young_pa is None else young_pa,
        poisson_ratio=base.mean_poisson if poisson_ratio is None else poisson_ratio,
        density_kg_per_m3=base.density_kg_per_m3,
    )
    curvature = elastica.curvature_max(alpha_rad, length_m)
    sheet = replace(sheet, rigidity=rigidity, curvature_per_m=curvature)
    if weight_n_per_m is None:
        weight_n_per_m = 0.0 if named is None else sheet.weight_per_length_n_per_m
    try:
        state = _state(sheet, alpha_rad, half_distance_m, weight_n_per_m)
    except OverflowError as error:
        raise InputError("length, width, thickness or young is too large; all are SI") from error
    return {**state, **_rigidities(sheet), **_strain(sheet, named, state["curvature_max_per_m"])}


def _state(
    sheet: Sheet, alpha_rad: float, half_distance_m: float | None, weight_n_per_m: float
) -> dict[str, float]:
    EI, length_m = sheet.bending_stiffness_nm2, sheet.length_m
    zero_moment = elastica.half_distance(alpha_rad, length_m)
    half_distance = zero_moment if half_distance_m is None else half_distance_m
    force, moment = elastica.end_force(alpha_rad, EI, length_m), 0.0
    rise, curvature = elastica.rise(alpha_rad, length_m), sheet.curvature_per_m
    if half_distance_m is not None or weight_n_per_m != 0.0:
        state = rod.solve_symmetric(EI, length_m, alpha_rad, half_distance, weight_n_per_m)
        if not state.converged:
            raise InputError(
                f"no bent state at alpha = {alpha_rad} rad, half distance = {half_distance} m: "
                f"{state.reason}"
            )
        force, moment, rise = state.end_force_n, state.end_moment_nm, state.rise_m
        curvature = float(np.max(np.abs(state.curvature_per_m)))
    return {
        "force_n": force,
        "moment_nm": moment,
        "half_distance_m": half_distance,
        "rise_m": rise,
        "curvature_max_per_m": curvature,
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
    for kind in get_args(Rigidity):
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
    return {"surface_strain": strain, "limit_strain": limit, "beyond_limit": bool(strain > limit)}
