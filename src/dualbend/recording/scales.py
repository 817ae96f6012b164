"""What the colours and the lengths of arrows in the recording stand for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualbend.beam import elastica
from dualbend.evaluation.permanent_set import hinge_moments
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.types import SIDES, Vector

LONGEST_ARROW_M = 0.17
"""Bound of an arrow's length over a run: both arms' forces fit above the sheet, 0.4 m long."""

_NICE = np.outer(10.0 ** np.arange(-9, 10), [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]).ravel()

# Diverging map by K. Moreland, ISVC 2009: blue, grey, red at -1, 0, 1.
_MAP_STOPS = (-1.0, -0.5, 0.0, 0.5, 1.0)
_MAP_CHANNELS = ((59, 141, 221, 244, 180), (76, 176, 221, 152, 4), (192, 254, 221, 122, 38))


@dataclass(frozen=True, kw_only=True)
class Scales:
    """What a colour and an arrow's length stand for, the same through a run."""

    moment_range_n_m: float
    force_m_per_n: float
    torque_m_per_n_m: float

    @classmethod
    def of(cls, result: RunRecord) -> Scales:
        """Return round scales that hold the run's largest values."""
        trace = result.trace
        force, torque = (
            np.abs([trace[f"{s}_true_{kind}_{a}"] for s in SIDES for a in "xyz"]).max(initial=1e-6)
            for kind in ("force", "moment")
        )
        least = 1e-6 * float(result.bend_stiffness.max())
        peak = max(np.abs(hinge_moments(result)).max(initial=0.0), least)
        return cls._round(peak, force, torque)

    @classmethod
    def expected(cls, scenario: Scenario) -> Scales:
        """Return scales for a run that is still to come, from beam theory at its largest angle.

        The force is twice P of (1), for a flat sheet pulls; the moment on a grip, zero on the exact
        path, is taken as a fifth of that in the sheet's middle.
        """
        sheet, alpha = scenario.sheet.sheet(), scenario.path.end_rad
        middle = sheet.bending_stiffness_nm2 * elastica.curvature_max(alpha, sheet.length_m)
        force = elastica.end_force(alpha, sheet.bending_stiffness_nm2, sheet.length_m)
        return cls._round(middle, 2.0 * force, 0.2 * middle)

    @classmethod
    def _round(cls, moment: float, force: float, torque: float) -> Scales:
        return cls(
            moment_range_n_m=float(_NICE[0.999 * moment <= _NICE].min()),
            force_m_per_n=float(_NICE[LONGEST_ARROW_M / force >= _NICE].max()),
            torque_m_per_n_m=float(_NICE[LONGEST_ARROW_M / torque >= _NICE].max()),
        )


def diverging_colours(values: Vector) -> NDArray[np.uint8]:
    """Return red, green, blue (..., 3) for values from -1 (blue) through 0 (grey) to 1 (red)."""
    channels = [np.interp(values, _MAP_STOPS, channel) for channel in _MAP_CHANNELS]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
