"""What damages pins or holes, and where contact is not what metal does: either ends the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dualbend.scene.bed.pin_contacts import PinPeaks
from dualbend.scene.warnings import SimulationFailed
from dualbend.task.assembly.config import LimitsConfig


class Resolution(NamedTuple):
    """What limits how fast a contact may be: the true sheet's thickness [m], a step's time [s]."""

    thickness_m: float
    step_s: float


def stop_at_damage(
    phase: str,
    pins: Sequence[str],
    peaks: PinPeaks,
    limits: LimitsConfig,
    resolution: Resolution,
) -> None:
    """Raise SimulationFailed where a force or a depth at one of the pins is beyond its limit."""
    for force, limit, what in (
        (peaks.force_n, limits.pin_force_n, "pin"),
        (peaks.edge_force_n, limits.edge_force_n, "hole edge"),
    ):
        worst = int(np.argmax(force))
        if force[worst] > limit:
            raise SimulationFailed(
                f"{phase}: the force on the {pins[worst]} {what} is {force[worst]:.1f} N, "
                f"above {limit:g} N"
            )
    for depth, limit, what in (
        (peaks.penetration_m, limits.penetration_m, "stays"),
        # Deeper, a pin would come out on the other side.
        (peaks.impact_m, 0.5 * resolution.thickness_m, "falls"),
    ):
        worst = int(np.argmax(depth))
        if depth[worst] > limit:
            raise SimulationFailed(
                f"{phase}: the sheet {what} {1e6 * depth[worst]:.0f} µm deep into the "
                f"{pins[worst]} pin, above {1e6 * limit:.0f} µm, which no metal does; "
                f"a smaller physics.step_s than {resolution.step_s:g} resolves it"
            )
