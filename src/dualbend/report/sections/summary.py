"""What a run's summary says beside its metrics: rigidity of the sheet, margins of the arms."""

from __future__ import annotations

import msgspec

from dualbend.arm.joint_limits import JointLimitMargins
from dualbend.evaluation.sheet import SheetReport
from dualbend.report.section import Section
from dualbend.run.record import RunRecord
from dualbend.table import Columns, Table, quantity


def sheet_section(run: RunRecord) -> Section | None:
    """Return the sheet and each way to take its rigidity; None where the summary has no sheet."""
    if not run.summary.sheet:
        return None
    try:
        sheet = msgspec.convert(run.summary.sheet, SheetReport)
    except msgspec.ValidationError as error:
        return Section("Sheet", [f"The summary's sheet is not readable: {error}"])
    return Section("Sheet", [_facts(sheet), _rigidity(sheet)])


def _facts(sheet: SheetReport) -> Table:
    rows = [
        ("material", sheet.material, None),
        ("thickness", 1e3 * sheet.thickness_m, "mm"),
        ("Young's modulus", 1e-9 * sheet.young_pa, "GPa"),
        ("density", sheet.density_kg_per_m3, "kg/m³"),
        ("torsional stiffness", sheet.torsional_stiffness_nm2, "N\u00a0m²"),
        ("Searle parameter", sheet.searle_parameter, None),
        ("surface strain that it bears", sheet.limit_strain, None),
        ("surface strain of the nominal path", sheet.nominal_strain, None),
        ("simulated so that it yields", sheet.plastic, None),
        ("elastic theory", sheet.theory, None),
    ]
    return Table(["what", "value", "unit"], rows, "The sheet")


def _rigidity(sheet: SheetReport) -> Table:
    columns: Columns = [
        *("rigidity", quantity("bending stiffness", "N m²"), quantity("over EI")),
        quantity("end force", "%", "+.2g"),
    ]
    rows = [
        (
            f"{kind} (taken)" if kind == sheet.rigidity else kind,
            choice.bending_stiffness_nm2,
            choice.over_beam,
            choice.end_force_change_percent,
        )
        for kind, choice in sheet.choices.items()
    ]
    caption = "Ways to take the rigidity; the end force against the way that is taken"
    return Table(columns, rows, caption)


def arms_section(run: RunRecord) -> Section | None:
    """Return the margins that both arms had; None where the summary does not say them."""
    if not run.summary.arms:
        return None
    try:
        arms = msgspec.convert(run.summary.arms, dict[str, JointLimitMargins])
    except msgspec.ValidationError as error:
        return Section("Arms", [f"The summary's arms are not readable: {error}"])
    columns: Columns = [
        *("side", "arm", quantity("smallest manipulability", "–")),
        *(quantity("nearest limit", "degrees"), "of joint"),
    ]
    rows = [
        (side, room.arm, room.manipulability, room.margin_deg, room.joint or None)
        for side, room in arms.items()
    ]
    caption = (
        "Margins of the arms along the commanded path; manipulability over the largest that the "
        "arm has"
    )
    return Section("Arms", [Table(columns, rows, caption)])
