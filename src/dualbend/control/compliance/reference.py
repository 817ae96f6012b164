"""What the sensor should read on the right path, so that only the error is complied with.

The sheet pushes back with its Euler force even where the path is right; the paper's filter complies
with all of it, which leaves an offset. The reference is the known force of the zero-moment state
with weight. It comes from the nominal bending angle alone, never from the path's x.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from dualbend.control.compliance.schedule import KnownSheet
from dualbend.types import Config, Vector, matvec, said


class ReferenceConfig(Config):
    """Which loads are taken for right, and how the moment is read.

    Below some hundredths of a radian a sheet with weight has no zero-moment state but a taut one,
    so its force is not asked for there. ``known_weight``: the vertical force on the arm is half the
    sheet's weight, and not what its noisy channel says; it enters the moment with the lever arm.
    """

    from_rad: Annotated[float, said("below it the force of this slope [rad]", ge=0.005, le=1)] = (
        0.05
    )
    known_weight: Annotated[bool, said("take the vertical force for half the sheet's weight")] = (
        False
    )


def moment_rows(config: ReferenceConfig | None, known: KnownSheet, alpha_rad: Vector) -> Vector:
    """Return (..., 2, 3): what is taken of force x, z and moment for the force x and the moment.

    With the known weight M = M_read + r cos α (F_z known − F_z read): the lever arm's part of the
    noise goes, but for F_x sin α.
    """
    rows = np.zeros((*alpha_rad.shape, 2, 3))
    rows[..., 0, 0] = rows[..., 1, 2] = 1.0
    if config is not None and config.known_weight:
        rows[..., 1, 1] = -known.lever_arm_m * np.cos(alpha_rad)
    return rows


def reference(
    config: ReferenceConfig | None, known: KnownSheet, alpha_rad: Vector, rows: Vector
) -> Vector:
    """Return force x [N] and moment [N m] (..., 2) of the right path, as ``rows`` take them."""
    loads = np.zeros((*alpha_rad.shape, 3))
    if config is not None:
        loads[..., 0] = known.force(np.maximum(alpha_rad, config.from_rad))
        loads[..., 1] = known.force_z_n
    return matvec(rows, loads)
