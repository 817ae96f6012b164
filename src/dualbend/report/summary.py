"""What a run's summary says beside its metrics: the sheet's rigidity and the room of the arms."""

from __future__ import annotations

import msgspec

from dualbend.arm.joint_limits import ArmRoom
from dualbend.evaluation.sheet import SheetReport
from dualbend.report.html import Html, join, table
from dualbend.report.parts import Section, note, number
from dualbend.run.record import RunRecord


def sheet_section(run: RunRecord) -> Section | None:
    """Return the sheet and each way to take its rigidity; None where the summary has no sheet."""
    if not run.summary.sheet:
        return None
    try:
        sheet = msgspec.convert(run.summary.sheet, SheetReport)
    except msgspec.ValidationError as error:
        return Section(title="Sheet", body=note(f"The summary's sheet is not readable: {error}"))
    return Section(title="Sheet", body=join([_facts(sheet), _rigidity(sheet)]))


def _facts(sheet: SheetReport) -> Html:
    rows = [
        ("material", sheet.material, "–"),
        ("thickness", number(1e3 * sheet.thickness_m), "mm"),
        ("Young's modulus", number(1e-9 * sheet.young_pa), "GPa"),
        ("density", number(sheet.density_kg_per_m3), "kg/m³"),
        ("torsional stiffness", number(sheet.torsional_stiffness_nm2), "N\u00a0m²"),
        ("Searle parameter", number(sheet.searle_parameter), "–"),
        ("surface strain that it bears", number(sheet.limit_strain), "–"),
        ("surface strain of the nominal path", number(sheet.nominal_strain), "–"),
        ("simulated so that it yields", number(sheet.plastic), "–"),
        ("elastic theory", sheet.theory, "–"),
    ]
    return table("The sheet", ("what", "value", "unit"), rows)


def _rigidity(sheet: SheetReport) -> Html:
    head = ("rigidity", "bending stiffness [N m²]", "over EI", "end force [%]")
    rows = [
        (
            f"{kind} (taken)" if kind == sheet.rigidity else kind,
            number(choice.bending_stiffness_nm2),
            number(choice.over_beam),
            f"{choice.end_force_change_percent:+.2g}",
        )
        for kind, choice in sheet.choices.items()
    ]
    caption = "Ways to take the rigidity; the end force against the way that is taken"
    return table(caption, head, rows, numeric=range(1, 4))


def arms_section(run: RunRecord) -> Section | None:
    """Return the room that both arms had; None where the summary does not say it."""
    if not run.summary.arms:
        return None
    try:
        arms = msgspec.convert(run.summary.arms, dict[str, ArmRoom])
    except msgspec.ValidationError as error:
        return Section(title="Arms", body=note(f"The summary's arms are not readable: {error}"))
    head = ("side", "arm", "smallest manipulability [–]", "nearest limit [degrees]", "of joint")
    rows = [
        (side, room.arm, number(room.manipulability), number(room.room_deg), room.joint or "–")
        for side, room in arms.items()
    ]
    caption = (
        "Room of the arms along the commanded way; manipulability over the largest that the arm has"
    )
    return Section(title="Arms", body=table(caption, head, rows, numeric=(2, 3)))
