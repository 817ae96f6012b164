"""The middle of a bent sheet between grips that yield to it: where it hangs, what holds it up."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.optimize import root

from dualbend.beam.path import BendingPath
from dualbend.beam.rod.planar import solve_planar
from dualbend.beam.rod.state import GripLoad
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.errors import InputError
from dualbend.types import Vector

Yields = Callable[[Vector], Vector]
"""Displacement x, z [m], α [rad] (3,) of a grip under the sheet's force x, z and moment (3,)."""

_HEIGHTS = 13
"""At which the force is computed; it is interpolated between."""


def rigid(_: Vector) -> Vector:
    """Return the displacement of a grip that stays where it was sent."""
    return np.zeros(3)


class BentMiddle:
    """Force over height of the middle of a sheet that is bent between two grips.

    A thick sheet pushes its grips apart by as much as they were brought together to bend it, and
    then hangs less deep.

    Attributes
    ----------
    hang_m
        By how much the middle hangs higher than between rigid grips without its weight [m].

    Raises
    ------
    InputError
        No equilibrium is found, or the sheet is too stiff to hang down between such grips.
    """

    def __init__(
        self, sheet: Sheet, path: BendingPath, highest_m: float, yields: Yields = rigid
    ) -> None:
        heights = np.linspace(0.0, highest_m, _HEIGHTS)
        forces = _forces(sheet, path, yields, heights)
        if forces[-1] <= 0.0:
            raise InputError(
                f"sheet.thickness_m = {sheet.thickness_m:g}: the bent sheet pushes its grips "
                f"apart until its middle hangs more than {1e3 * highest_m:.1f} mm too high, above "
                "the pins; a thinner sheet or stiffer arms hang lower"
            )
        self.hang_m = float(np.interp(0.0, forces, heights))
        self._heights = heights
        self._forces = _forces(sheet, path, yields, self.hang_m + heights)

    def force(self, height_m: float) -> float:
        """Return the force [N] that holds it this much above where it hangs."""
        return float(np.interp(height_m, self._heights, self._forces))

    def yields(self, force_n: float) -> float:
        """Return by how much a force holds it above where it hangs [m]."""
        return float(np.interp(force_n, self._forces, self._heights))


def _forces(sheet: Sheet, path: BendingPath, yields: Yields, heights_m: Vector) -> Vector:
    """Return the force [N] that holds the middle at each of growing heights above its place.

    Twice the end force of half the sheet, its middle level. A grip that is loaded by w goes from
    where it was sent by u(w): found where u(w) is the displacement that w comes of. The sheet may
    stretch: between some of the places that are tried it is taut.
    """
    bend_rad = float(path.knots[-1])
    half, rise = path.at(bend_rad)
    sent, moved, forces = np.array([-half, rise, bend_rad]), np.zeros(3), []

    def left_over(by: Vector, height: float) -> Vector:
        return yields(np.array(_ends(sheet, *(sent + by).tolist(), height)[0])) - by

    for height in heights_m.tolist():
        moved = root(left_over, moved, args=(height,), tol=1e-10).x
        forces.append(-2.0 * _ends(sheet, *(sent + moved).tolist(), height)[1].force_z_n)
    return np.array(forces)


@lru_cache(maxsize=2048)
def _ends(
    sheet: Sheet, x_m: float, z_m: float, alpha_rad: float, height_m: float
) -> tuple[GripLoad, GripLoad]:
    """Return the loads of half the sheet's ends: grip at x, z, α, level middle at a height.

    Kept for the runs of a study, whose robots believe in one sheet: half a run's preparation.
    """
    found = solve_planar(
        sheet.bending_stiffness_nm2,
        0.5 * sheet.length_m,
        (x_m, z_m, alpha_rad),
        (0.0, height_m, 0.0),
        sheet.mass_kg * GRAVITY_M_PER_S2 / sheet.length_m,
        axial_stiffness_n=sheet.axial_stiffness_n,
    )
    if not found.converged:
        raise InputError(
            f"the force of the bent sheet held {1e3 * height_m:.2f} mm up was not found "
            f"({found.reason}): the contact force could not be evaluated"
        )
    return found.left, found.right
