"""Validation of the assembly: every shipped one is run, and what the planner said is measured."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dualbend.errors import InputError
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.metrics import (
    OFFSET_BEYOND_CLEARANCE_M,
    RESTING_WITHIN_M,
    final_holes,
    seated,
)
from dualbend.task.assembly.run import AssemblyRun
from dualbend.validation.cases.runs import metric
from dualbend.validation.row import Row, absolute, at_most

SHEETS = {"pwb": 1, "pwb-misaligned": 1, "pwb-tight": 1, "pwb-stack": 3}
SPACING_WITHIN_M = 0.05e-3


def assembly_rows() -> Iterator[Row]:
    """Check the shipped assemblies; takes a minute."""
    yield _refusal()
    for name, sheets in SHEETS.items():
        yield from _seated(name, AssemblyRun(load_scenario(name)).run(), 4 * sheets)
    yield from _rigid(AssemblyRun(load_scenario("pwb-rigid")).run())


def _rigid(rigid: RunRecord) -> Iterator[Row]:
    """Check that arms that do not yield find no pin where those that do find all."""
    completed = float(rigid.outcome == "completed")
    yield absolute("pwb-rigid does not complete", completed, 0.0, "1", 0.0)
    yield absolute("pwb-rigid: holes seated", float(seated(rigid).sum()), 0.0, "1", 0.0)


def _refusal() -> Row:
    try:
        AssemblyRun(load_scenario("pwb-impossible"))
        refused = 0.0
    except InputError as error:
        refused = float("mm missing" in str(error))
    return absolute("pwb-impossible refused, with what is missing", refused, 1.0, "1", 0.0)


def _seated(name: str, result: RunRecord, holes: int) -> Iterator[Row]:
    assembly = assembly_of(result.scenario)
    yield absolute(f"{name} completes", float(result.outcome == "completed"), 1.0, "1", 0.0)
    yield absolute(f"{name}: holes seated", float(seated(result).sum()), holes, "1", 0.0)
    final = final_holes(result)
    allowed = 0.5 * assembly.layout.holes.clearance_m + OFFSET_BEYOND_CLEARANCE_M
    offset = float(np.hypot(final[..., 0], final[..., 1]).max())
    height = float(np.abs(final[..., 2]).max())
    yield at_most(f"{name}: worst hole off its pin's axis", offset, allowed, "m")
    yield at_most(f"{name}: worst hole above its rest", height, RESTING_WITHIN_M, "m")
    spacing = metric(result, "middle_spacing_error")
    words = f"{name}: middle holes' spacing while bent, against the plan"
    yield absolute(words, spacing, 0.0, "m", SPACING_WITHIN_M)
    strain = metric(result, "peak_surface_strain") / metric(result, "yield_strain")
    yield at_most(f"{name}: peak surface strain over yield", strain, 1.0, "1")
