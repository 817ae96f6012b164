"""The elastic rod between the grips that a trace recorded: the reference solution of a run."""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.run.record import RunRecord
from dualbend.types import SIDES, Vector

Place = Literal["grip", "edge"]
"""The arms' grips, or the sheet's edges behind the pads."""


class Columns(Protocol):
    """What a trace and a saved run have in common: columns by name (rows,)."""

    def __getitem__(self, name: str, /) -> Vector:
        """Return one column."""


def recorded_rods(
    columns: Columns, sheet: Sheet, place: Place, rows: NDArray[np.int_]
) -> tuple[rod.RodState, ...]:
    """Return the elastic rod's states between recorded poses (rows,), weight and stretch included.

    A state that was not found is not ``converged``. The rod knows no yield: where the sheet yields
    it is another sheet's.
    """
    left, right = (
        np.column_stack([columns[f"{side}_{place}_{part}"][rows] for part in ("x", "z", "alpha")])
        for side in SIDES
    )
    # The right arm's bending frame looks the other way: its x is minus the planar frame's.
    pairs = [
        (rod.Grip(*a), rod.Grip(-b[0], b[1], b[2]))
        for a, b in zip(left.tolist(), right.tolist(), strict=True)
    ]
    return rod.follow_planar(
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        pairs,
        sheet.weight_per_length_n_per_m,
        axial_stiffness_n=sheet.axial_stiffness_n,
    )


def reference_moments(result: RunRecord, place: Place, rows: NDArray[np.int_]) -> Vector:
    """Return the rod's moment on the left gripper at recorded poses (rows,) [N m]; NaN unsolved.

    ``place`` is "grip" (the arms') or "edge" (the sheet's, behind the pads). The rod has the
    sheet's weight and axial stiffness.
    """
    states = recorded_rods(result.trace, result.scenario.sheet.sheet(), place, rows)
    return np.array([s.left.moment_nm if s.converged else np.nan for s in states])
