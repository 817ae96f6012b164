"""One sheet of a series: how it went and what it taught; the table of several."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from dualbend.evaluation.metrics import bending_rows, held_rows
from dualbend.run.record import RunRecord
from dualbend.table import Columns, Table, quantity
from dualbend.types import SIDES, Vector

BEYOND_RAD = 0.2
"""After what is left of a flat sheet's stiffness along itself."""


class Sheet(msgspec.Struct, frozen=True, kw_only=True):
    """One sheet: how it went, and the correction that the next one gets.

    Moments are true ones, of the sheet on the arm where they are larger: ``peaks_nm`` of each piece
    of the path, ``rms_nm`` over the bending, ``hold_nm`` (2,) the mean of either arm's second half
    of the hold; ``force_n`` along x as the sensors read it there. ``time_s``, ``angle_rad`` and
    ``moment_nm`` are time, nominal angle and |moment| of the rows in which the sheet was bent.
    ``note``: why nothing was learned, "" where something was. ``correction_rad`` (arms, cycles):
    of the next sheet, ``largest_rad`` its largest value.
    """

    sheet: int
    speed_rad_per_s: float
    outcome: str
    note: str
    peaks_nm: list[float]
    rms_nm: float | None
    hold_nm: list[float]
    force_n: float | None
    largest_rad: float
    time_s: list[float]
    angle_rad: list[float]
    moment_nm: list[float]
    correction_rad: list[list[float]]

    @property
    def learned(self) -> bool:
        """The sheet taught something."""
        return not self.note

    @property
    def rms_beyond_nm(self) -> float:
        """Rms of the moment [N m] beyond `BEYOND_RAD`; NaN where the sheet was not bent so far."""
        late = np.array(self.moment_nm)[np.array(self.angle_rad) >= BEYOND_RAD]
        return float(np.sqrt(np.mean(late**2))) if late.size else math.nan


def sheet_of(
    number: int, result: RunRecord, note: str, force_n: float | None, correction: Vector
) -> Sheet:
    """Return what a run of a sheet came to."""
    scenario = result.scenario
    moment = np.array([result[f"{side}_true_moment_y"] for side in SIDES])
    bending, held = bending_rows(result), held_rows(result)
    knots = scenario.path.make(scenario.sheet.length_m).knots
    piece = np.searchsorted(knots, result["nominal_alpha"], side="right") - 1
    largest, in_piece = np.abs(moment).max(axis=0), np.clip(piece, 0, len(knots) - 2)
    peaks = [
        float(largest[rows].max())
        for i in range(len(knots) - 1)
        if (rows := bending & (in_piece == i)).any()
    ]
    rms = np.sqrt(np.mean(moment[:, bending] ** 2, axis=1)) if bending.any() else None
    return Sheet(
        sheet=number,
        speed_rad_per_s=scenario.motion.speed_rad_per_s,
        outcome=result.outcome,
        note=note,
        peaks_nm=peaks,
        rms_nm=None if rms is None else float(rms.max()),
        hold_nm=moment[:, held].mean(axis=1).tolist() if held.any() else [],
        force_n=force_n,
        largest_rad=float(np.abs(correction).max()),
        time_s=result["time"][bending].round(6).tolist(),
        angle_rad=result["nominal_alpha"][bending].round(9).tolist(),
        moment_nm=largest[bending].round(9).tolist(),
        correction_rad=correction.tolist(),
    )


def table(sheets: Sequence[Sheet]) -> Table:
    """Return a line for each sheet: its moments, and what was learned from it."""
    columns: Columns = [
        quantity("sheet", "", "d"),
        quantity("speed", "rad/s"),
        quantity("peaks by piece", "mN m", ".1f"),
        quantity("rms", "mN m", ".1f"),
        quantity("hold, left, right", "mN m", ".1f"),
        quantity("force in the hold", "N", ".2f"),
        quantity("next correction", "mrad", ".1f"),
        "",
    ]

    def milli(values: Sequence[float]) -> list[float]:
        return [1e3 * value for value in values]

    rows = [
        (
            sheet.sheet,
            sheet.speed_rad_per_s,
            milli(sheet.peaks_nm),
            None if sheet.rms_nm is None else 1e3 * sheet.rms_nm,
            milli(sheet.hold_nm),
            sheet.force_n,
            1e3 * sheet.largest_rad,
            f"nothing learned: {sheet.note}" if sheet.note else "",
        )
        for sheet in sheets
    ]
    return Table(columns, rows)


def spread_table(cells: Sequence[Sequence[Sheet]]) -> Table:
    """Return a line for each sheet's number: medians and worst over the cells that bent it.

    Peaks and rms are over those of the cell's own first sheet; the hold is the larger of both arms.
    """
    columns: Columns = [
        quantity("sheet", "", "d"),
        quantity("cells", "", "d"),
        quantity("peaks by piece over sheet 1, median", "", ".2f"),
        quantity("worst", "", ".2f"),
        quantity(f"rms beyond {BEYOND_RAD:g} rad over sheet 1, median", "", ".3f"),
        quantity("worst", "", ".3f"),
        quantity("hold, median", "mN m", ".1f"),
        quantity("worst", "mN m", ".1f"),
    ]
    rows = []
    for i in range(max(map(len, cells))):
        pairs = [(cell[0], cell[i]) for cell in cells if i < len(cell) and cell[i].hold_nm]
        if pairs:
            peaks = np.array([np.divide(sheet.peaks_nm, first.peaks_nm) for first, sheet in pairs])
            rms = np.array([sheet.rms_beyond_nm / first.rms_beyond_nm for first, sheet in pairs])
            hold = 1e3 * np.array([np.abs(sheet.hold_nm).max() for _, sheet in pairs])
            both = [
                (np.median(of, axis=0).tolist(), of.max(axis=0).tolist())
                for of in (peaks, rms, hold)
            ]
            rows.append((i + 1, len(pairs), *both[0], *both[1], *both[2]))
    return Table(columns, rows)
