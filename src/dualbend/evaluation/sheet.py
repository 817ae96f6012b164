"""What a scenario's sheet is in numbers: rigidity and its consequence, and whether it will yield.

Theory only, before the run: the part ``sheet`` of the summary.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import get_args

import msgspec
import numpy as np

from dualbend.beam import elastica
from dualbend.beam.rigidity import Rigidity, searle_parameter
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import NUMBERS, SheetConfig, substance
from dualbend.scenario.toml_text import number

_POINTS = 25
"""End slopes at which the nominal path is solved: 40 mrad on the shipped ones."""


class RigidityChoice(msgspec.Struct, frozen=True, kw_only=True):
    """One way to take the sheet's bending stiffness.

    ``over_beam``: the stiffness over EI; ``end_force_change_percent``: of the end force against
    the way that the scenario takes, as force goes with stiffness (without weight).
    """

    bending_stiffness_nm2: float
    over_beam: float
    end_force_change_percent: float


class SheetReport(msgspec.Struct, frozen=True, kw_only=True):
    """The sheet of a scenario.

    Attributes
    ----------
    material : names of the layers, with the numbers that are given beside a name; or "given" for
        numbers without a name
    rigidity, choices : the way that is taken, and all of them with their consequence
    searle_parameter : w² κ / t at the path's largest curvature; about 1 beam, above 100 plate
    limit_strain, nominal_strain : surface strain that yields or breaks the sheet (None: not known),
        and the largest of the nominal path in theory
    exceeds : the second is above the first
    yields : it yields there; else it breaks
    plastic : the simulated sheet yields and springs back
    theory : what the elastic theory (rod, elastica) says of this run
    """

    material: str
    thickness_m: float
    young_pa: float
    density_kg_per_m3: float
    torsional_stiffness_nm2: float
    rigidity: str
    choices: dict[str, RigidityChoice]
    searle_parameter: float
    limit_strain: float | None
    nominal_strain: float | None
    exceeds: bool
    yields: bool
    plastic: bool
    theory: str


@functools.lru_cache(maxsize=16)
def sheet_report(scenario: Scenario) -> SheetReport:
    """Return what the scenario's sheet is, and what its nominal path does to it in theory."""
    sheet, whole = scenario.sheet.sheet(), substance(scenario.sheet)
    known = scenario.sheet.limit_strain
    limit = None if known is None else scenario.limit_strain
    strain = nominal_strain(scenario)
    exceeds = limit is not None and strain > limit
    curvature = elastica.curvature_max(scenario.path.end_rad, sheet.length_m)
    return SheetReport(
        material=_material(scenario.sheet),
        thickness_m=sheet.thickness_m,
        young_pa=sheet.young_pa,
        density_kg_per_m3=sheet.density_kg_per_m3,
        torsional_stiffness_nm2=sheet.torsional_stiffness_nm2,
        rigidity=sheet.rigidity,
        choices=rigidity_choices(sheet, curvature),
        searle_parameter=searle_parameter(sheet.width_m, sheet.thickness_m, curvature),
        limit_strain=limit,
        nominal_strain=strain,
        exceeds=exceeds,
        yields=any(x.material.yield_pa is not None for x in whole.layers),
        plastic=sheet.plasticity is not None,
        theory=_theory(exceeds=exceeds, plastic=sheet.plasticity is not None),
    )


def rigidity_choices(sheet: Sheet, curvature_per_m: float) -> dict[str, RigidityChoice]:
    """Return the three ways to take the bending stiffness, the width's at the given curvature."""
    there = replace(sheet, curvature_per_m=sheet.curvature_per_m or curvature_per_m)
    beam, taken = sheet.young_pa * sheet.second_moment_m4, sheet.bending_stiffness_nm2
    ratios = {kind: there.rigidity_over_beam(kind) for kind in get_args(Rigidity)}
    return {
        kind: RigidityChoice(
            bending_stiffness_nm2=beam * ratio,
            over_beam=ratio,
            end_force_change_percent=100.0 * (beam * ratio / taken - 1.0),
        )
        for kind, ratio in ratios.items()
    }


def nominal_strain(scenario: Scenario) -> float:
    """Return the largest surface strain of the nominal path, κ t/2, of the elastic rod with weight.

    Where the rod is not solved (near the flat state), the zero-moment elastica stands in.
    """
    sheet = scenario.sheet.sheet()
    path = scenario.path.make(sheet.length_m)
    start, end = scenario.path.start_rad, scenario.path.end_rad
    alphas = np.linspace(max(start, 0.05 * end), end, _POINTS).tolist()
    states = rod.follow_symmetric(
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        [(alpha, path.at(alpha)[0]) for alpha in alphas],
        sheet.weight_per_length_n_per_m,
        sheet=sheet,
    )
    thickness = sheet.thickness_at(states[0].s_m)
    rest = sheet.rest_curvature_per_m
    largest = [
        float(np.max(np.abs(state.curvature_per_m + rest) * thickness))
        if state.converged
        else (elastica.curvature_max(alpha, sheet.length_m) + abs(rest)) * thickness.max()
        for alpha, state in zip(alphas, states, strict=True)
    ]
    return max(largest) / 2.0


def _material(sheet: SheetConfig) -> str:
    """Return what a sheet is made of: a name never hides numbers that are given beside it."""
    if sheet.material is None:
        layers = substance(sheet).layers if sheet.layers else ()
        return " / ".join(layer.material.name for layer in layers) or "given"
    given = [f"{key} = {number(x)}" for key in NUMBERS if (x := getattr(sheet, key)) is not None]
    return f"{sheet.material} with {', '.join(given)}" if given else sheet.material


def no_theory(scenario: Scenario) -> str:
    """Return why the elastic theory predicts no moment of a scenario, "" where it does."""
    if not scenario.sheet.plastic:
        return ""
    found = sheet_report(scenario)
    if found.exceeds:
        return f"No moment is predicted: the elastic theory {found.theory}."
    return "No moment is predicted: the sheet may yield, which the elastic theory does not know."


def _theory(*, exceeds: bool, plastic: bool) -> str:
    if exceeds and plastic:
        return "does not apply: the elastica and the rod know no yield, and the sheet yields"
    if exceeds:
        return "does not apply to the real sheet, which would not stay elastic; simulated elastic"
    return "applies"
