"""The elastic rod between the grips that a trace recorded: the reference solution of a run."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dualbend.beam.rod.state import RodState
from dualbend.beam.rod.tangent import follow_grips
from dualbend.run.record import RunRecord
from dualbend.types import SIDES, Vector

Place = Literal["grip", "edge"]
"""The arms' grips, or the sheet's edges behind the pads."""


def recorded_rods(run: RunRecord, place: Place, rows: NDArray[np.int_]) -> tuple[RodState, ...]:
    """Return the elastic rod's states between recorded poses (rows,), weight and stretch included.

    A state that was not found is not ``converged``. The rod knows no yield: where the sheet yields
    it is another sheet's.
    """
    names = [f"{side}_{place}_{part}" for side in SIDES for part in ("x", "z", "alpha")]
    grips = np.column_stack([run[name][rows] for name in names])
    return follow_grips(run.scenario.sheet.sheet(), grips)


def reference_moments(result: RunRecord, place: Place, rows: NDArray[np.int_]) -> Vector:
    """Return the rod's moment on the left gripper at recorded poses (rows,) [N m]; NaN unsolved.

    ``place`` is "grip" (the arms') or "edge" (the sheet's, behind the pads). The rod has the
    sheet's weight and axial stiffness.
    """
    states = recorded_rods(result, place, rows)
    return np.array([s.left.moment_nm if s.converged else np.nan for s in states])
