"""What a run did to a sheet that yields: moments of its hinges, and the shape it keeps.

Both follow from the recorded angles: a hinge's springs yield and slip the same whether they are
followed at every step or once per cycle, as long as it turns one way in between.
"""

from __future__ import annotations

import numpy as np

from dualbend.run.record import RunRecord
from dualbend.scene.sheet.strips import hinge_springs
from dualbend.types import Vector


def hinge_moments(result: RunRecord) -> Vector:
    """Return the moment of each bending hinge at every cycle (rows, hinges) [N m]."""
    config, sheet = result.scenario.sheet, result.scenario.true_sheet
    spacing = sheet.length_m / config.model.sections
    bends = result.trace.bends + sheet.rest_curvature_per_m * spacing
    if sheet.plasticity is None:
        return np.asarray(result.bend_stiffness * bends)
    moments = hinge_springs(sheet, config.strips).follow(bends / spacing)
    return np.asarray(result.bend_stiffness * spacing * moments)


def permanent_curvature(result: RunRecord) -> Vector:
    """Return the curvature that each hinge would keep if let go (rows, hinges) [1/m]."""
    config = result.scenario.sheet
    unloaded = result.trace.bends - hinge_moments(result) / result.bend_stiffness
    return np.asarray(unloaded * config.model.sections / config.length_m)
