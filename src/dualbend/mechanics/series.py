"""Elastic elements in series."""

from __future__ import annotations

import numpy as np

from dualbend.types import Vector


def in_series(stiffness: Vector, compliance: Vector) -> Vector:
    """Return the stiffness with a compliance in series: (1 + K C)⁻¹ K, also for a singular K."""
    return np.asarray(
        np.linalg.solve(np.eye(len(stiffness)) + stiffness @ compliance, stiffness),
        dtype=np.float64,
    )
