"""Sheets that yield and laminates against theory: spring-back, in ideal grips and in the cell.

A strip is turned by both ends into a circle and let go: what it keeps is κ − M(κ)/EI with the
elastic-plastic moment of the section. In the cell the shipped run ends with the grips brought back;
there the holds are opened without gravity, and each hinge keeps what its largest curvature left.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import mujoco
import numpy as np

from dualbend.beam.laminate import Laminate, stack
from dualbend.beam.material import Material, find_material
from dualbend.beam.path import ExactPath
from dualbend.beam.plastic import of_laminate, of_material
from dualbend.beam.rod.plastic import solve_plastic
from dualbend.beam.sheet import Sheet
from dualbend.evaluation.permanent_set import permanent_curvature
from dualbend.run.record import RunRecord
from dualbend.scenario.motion import PHASES
from dualbend.scene.sheet.strips import StripConfig, bend_joint
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Vector
from dualbend.validation.cases.ideal_grips import gripped_strips, place_grips
from dualbend.validation.cases.sheet import reference_loads, settled_loads
from dualbend.validation.perfect import perfect_scenario
from dualbend.validation.row import Row, relative

SCENARIO = "springback"
_STRIP, _THICKNESS_M = partial(Sheet, length_m=0.3, width_m=0.05), 1e-3
_DAMPING, _STEP_S, _TURN_S, _REST_S = 0.3, 5e-4, 1.0, 2.0
_GENTLE = 10.0
_RATIOS = (1.5, 2.0, 3.0, 6.0)
_FREE_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Springback:
    """A strip turned into a circle and let go; curvatures are means over the length [1/m]."""

    bent: float
    kept: float
    theory: float


def yielding_sheet(material: Material) -> Sheet:
    """Return the strip of one material that is bent here."""
    return _STRIP(
        thickness_m=_THICKNESS_M,
        young_pa=material.young_pa,
        poisson_ratio=material.mean_poisson,
        density_kg_per_m3=material.density_kg_per_m3,
        plasticity=of_material(material),
    )


def clad_sheet() -> tuple[Sheet, Laminate]:
    """Return a copper-clad FR-4 strip that yields, and its layers."""
    foil, core = find_material("copper-foil"), find_material("FR-4")
    whole = stack([(foil, 35e-6), (core, 0.4e-3), (foil, 35e-6)])
    sheet = _STRIP(
        thickness_m=whole.thickness_m,
        young_pa=12.0 * whole.bending_per_width_nm / whole.thickness_m**3,
        poisson_ratio=0.3,  # of the twist, which there is none of
        density_kg_per_m3=whole.density_kg_per_m3,
        plasticity=of_laminate(whole),
    )
    return sheet, whole


def springback(sheet: Sheet, ratio: float, strips: StripConfig | None = None) -> Springback:
    """Turn a strip to ``ratio`` times the curvature of first yield, let go, and measure."""
    strips = strips or StripConfig(damping_ratio=_DAMPING)
    assert sheet.plasticity is not None
    curvature = ratio * sheet.plasticity.first_yield(sheet.thickness_m)
    model = gripped_strips(sheet, strips, weight=False, step_s=_STEP_S, weld_time_s=2.0 * _STEP_S)
    data = mujoco.MjData(model)
    addresses = [model.joint(bend_joint(i)).qposadr[0] for i in range(strips.hinges)]
    for now in np.linspace(0.0, curvature, round(_TURN_S / _STEP_S)).tolist():
        _turn(data, sheet, strips.hinges, now)
        mujoco.mj_step(model, data)
    mujoco.mj_step(model, data, nstep=round(_TURN_S / 2.0 / _STEP_S))
    bent = -float(data.qpos[addresses].sum()) / sheet.length_m
    data.eq_active[:] = 0
    # Gently: a strip that swings past its rest yields a second time, the other way.
    model.dof_damping *= _GENTLE
    mujoco.mj_step(model, data, nstep=round(_REST_S / _STEP_S))
    kept = -float(data.qpos[addresses].sum()) / sheet.length_m
    theory = float(sheet.plasticity.residual(np.array([bent]), sheet.thickness_m)[0])
    return Springback(bent=bent, kept=kept, theory=theory)


def _turn(data: mujoco.MjData, sheet: Sheet, hinges: int, curvature: float) -> None:
    """Put both grips where the chain of strips ends on a circle."""
    h = sheet.length_m / hinges
    slopes = (np.arange(hinges + 1) - hinges / 2.0) * curvature * h
    lengths = np.concatenate(([h / 2.0], np.full(hinges - 1, h), [h / 2.0]))
    half_distance = float(lengths @ np.cos(slopes)) / 2.0
    place_grips(data, curvature * sheet.length_m / 2.0, half_distance)


def springback_rows() -> Iterator[Row]:
    """Compare what strips of metal and of a laminate keep with the section's theory."""
    cases = [("5052-H32", ratio) for ratio in _RATIOS] + [("spring-steel", 2.0)]
    for name, ratio in cases:
        found = springback(yielding_sheet(find_material(name)), ratio)
        label = f"kept curvature, {name} bent to {ratio:g} of its yield"
        yield relative(label, found.kept, found.theory, "1/m", 0.03)
    found = springback(clad_sheet()[0], 4.0)
    label = "kept curvature over bent, copper-clad FR-4 at 4 of its yield"
    yield relative(label, found.kept, found.theory, "1/m", 0.03, found.bent)


def laminate_rows() -> Iterator[Row]:
    """Compare the end force of copper-clad strips with the rod of 1/d11."""
    sheet, whole = clad_sheet()
    elastic = replace(sheet, length_m=0.4, plasticity=None)
    path, alphas = ExactPath(elastic.length_m, 1.0), np.array([0.3, 1.0])
    found = settled_loads(elastic, 20, path, alphas, weight=True).force_n
    wanted = reference_loads(elastic, path, alphas, weight=True).force_n
    thickness = 1e6 * whole.thickness_m
    for alpha, measured, theory in zip(alphas, found, wanted, strict=True):
        label = f"sheet force, copper-clad FR-4 of {thickness:g} µm at {alpha:g} rad"
        yield relative(label, measured, theory, "N", 0.005)


def let_go(run: BendingRun) -> Vector:
    """Open both holds of a run that has ended, without weight; return the curvatures (hinges,)."""
    simulation = run.cell.simulation
    model, data = simulation.model, simulation.data
    model.opt.gravity[:] = 0.0
    data.eq_active[:] = 0
    data.qvel[:] = 0.0
    mujoco.mj_step(model, data, nstep=round(_FREE_S / model.opt.timestep))
    sheet = run.scenario.sheet
    return np.asarray(simulation.bending_angles * sheet.model.sections / sheet.length_m)


def run_springback() -> tuple[BendingRun, RunRecord]:
    """Run the shipped scenario of a sheet that yields."""
    run = BendingRun(perfect_scenario(SCENARIO))
    return run, run.run()


def bent_rows(result: RunRecord) -> Iterator[Row]:
    """Compare the sheet at rest in its bent end with the rod that yields, at the edges' poses."""
    trace, config = result.trace, result.scenario.sheet
    row = int(np.flatnonzero(trace["phase"] == PHASES.index("hold"))[-1])
    alpha, x = (
        float(np.mean([trace[f"{side}_edge_{part}"][row] for side in SIDES]))
        for part in ("alpha", "x")
    )
    sheet = config.sheet()
    rod = solve_plastic(sheet, alpha, -x, sheet.weight_per_length_n_per_m)
    largest = np.abs(trace.bends[row]).max() * config.model.sections / config.length_m
    for what, measured, wanted, unit, tolerance in (
        ("end force", -trace["left_true_force_x"][row], rod.end_force_n, "N", 0.01),
        ("end moment", trace["left_true_moment_y"][row], rod.end_moment_nm, "N m", 0.01),
        ("largest curvature", largest, rod.curvature_max_per_m, "1/m", 0.03),
    ):
        name = f"{SCENARIO} {what} against the rod that yields"
        yield relative(name, float(measured), wanted, unit, tolerance)


def cell_rows() -> Iterator[Row]:
    """Compare what the sheet keeps in the cell with the theory of its most bent hinge."""
    run, result = run_springback()
    yield from bent_rows(result)
    config = result.scenario.sheet
    sheet = config.sheet()
    assert sheet.plasticity is not None
    predicted = np.abs(permanent_curvature(result)[-1])
    free = np.abs(let_go(run))
    i = int(np.argmax(free))
    largest = np.abs(result.trace.bends[:, i]).max() * config.model.sections / config.length_m
    theory = float(sheet.plasticity.residual(np.array([largest]), sheet.thickness_m)[0])
    yield relative(f"{SCENARIO} kept curvature", float(free[i]), theory, "1/m", 0.03)
    name = f"{SCENARIO} permanent_curvature of the summary, as let go"
    yield relative(name, float(predicted[i]), float(free[i]), "1/m", 1e-3)
