"""What a run's summary says beside its metrics: rigidity of the sheet, margins of the arms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from dualbend.arm.joint_limits import JointLimitMargins
from dualbend.evaluation.sheet import SheetReport
from dualbend.report.section import Block, Section
from dualbend.run.record import RunRecord
from dualbend.table import Columns, Table, quantity

T = TypeVar("T")


def sheet_section(run: RunRecord) -> Section | None:
    """Return the sheet and each way to take its rigidity; None where the summary has no sheet."""
    return _section("Sheet", run.summary.sheet, SheetReport, lambda x: [_facts(x), _rigidity(x)])


def arms_section(run: RunRecord) -> Section | None:
    """Return the margins that both arms had; None where the summary does not say them."""
    return _section("Arms", run.summary.arms, dict[str, JointLimitMargins], lambda x: [_margins(x)])


def _section(
    title: str, part: dict[str, Any], kind: type[T], blocks: Callable[[T], list[Block]]
) -> Section | None:
    if not part:
        return None
    try:
        return Section(title, blocks(msgspec.convert(part, kind)))
    except msgspec.ValidationError as error:
        return Section(title, [f"This part of the summary is not readable: {error}"])


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


def _margins(arms: dict[str, JointLimitMargins]) -> Table:
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
    return Table(columns, rows, caption)
