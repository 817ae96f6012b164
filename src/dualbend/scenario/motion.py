"""What the two arms do in the paper's experiment: hold, bend along a path, hold, maybe return.

The sheet's middle stays where it is; the ends come together, rise and tilt (Fig. 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from dualbend.beam.time_law import ConstantSpeed, TimeLaw, TrapezoidalSpeed
from dualbend.scenario.path import PathConfig
from dualbend.types import Config, Vector, said

Phase = Literal["settle", "bend", "hold", "return", "rest"]
PHASES: tuple[Phase, ...] = ("settle", "bend", "hold", "return", "rest")


class MotionConfig(Config):
    """How fast the bending angle grows and how long the arms hold before and after."""

    speed_rad_per_s: Annotated[float, said("of the bending angle", gt=0, le=5)] = 0.1
    acceleration_rad_per_s2: (
        Annotated[float, said("of a trapezoidal speed; none: constant", gt=0, le=1e3)] | None
    ) = None
    settle_s: Annotated[float, said("the arms hold the start before they bend", ge=0, le=600)] = 1.0
    hold_s: Annotated[float, said("the arms hold the end after they bent", ge=0, le=600)] = 1.0
    return_rad: (
        Annotated[
            float,
            said("bending angle to which they then go back; none: they do not", ge=0, le=3.15),
        ]
        | None
    ) = None


def make_time_law(path: PathConfig, motion: MotionConfig, *, back: bool = False) -> TimeLaw:
    """Return the bending angle over time, from the path's start to its end, or back from there."""
    first, last = path.start_rad, path.end_rad
    if back:
        assert motion.return_rad is not None
        first, last = last, motion.return_rad
    ends = (first, last, motion.speed_rad_per_s)
    if motion.acceleration_rad_per_s2 is None:
        return ConstantSpeed(*ends)
    return TrapezoidalSpeed(*ends, motion.acceleration_rad_per_s2)


@dataclass(frozen=True, kw_only=True)
class NominalMotion:
    """Nominal grips at every command cycle, the same for both arms in their bending frames.

    Attributes
    ----------
    phase : (n,) index into PHASES
    alpha_rad : (n,) bending angle
    half_distance_m : (n,) from the mid-plane to the grip
    rise_m : (n,) of the grips above the sheet's middle
    """

    phase: NDArray[np.int_]
    alpha_rad: Vector
    half_distance_m: Vector
    rise_m: Vector

    @property
    def cycles(self) -> int:
        """Number of command cycles."""
        return len(self.alpha_rad)


def nominal_motion(
    path: PathConfig, motion: MotionConfig, length_m: float, period_s: float
) -> NominalMotion:
    """Return the nominal motion of a sheet of ``length_m``, one entry per command period."""
    law = make_time_law(path, motion)
    counts = [
        int(np.ceil(duration / period_s - 1e-9))
        for duration in (motion.settle_s, law.duration_s, motion.hold_s)
    ]
    # However short the way: the bending is a cycle at least.
    counts[1] = max(counts[1], 1)
    back = None if motion.return_rad is None else make_time_law(path, motion, back=True)
    if back is not None:
        counts += [max(int(np.ceil(back.duration_s / period_s - 1e-9)), 1), counts[-1]]
    # The last phase owns the sample at its end, so that the run reaches the final angle.
    counts[-1] += 1
    since_bending = period_s * np.arange(-counts[0], sum(counts) - counts[0], dtype=np.float64)
    alpha: Vector = law.at(since_bending)
    if back is not None:
        leaves = sum(counts[:3])
        since_leaving = period_s * np.arange(sum(counts) - leaves, dtype=np.float64)
        alpha[leaves:] = back.at(since_leaving)
    half_distance, rise = path.make(length_m).at(alpha)
    return NominalMotion(
        phase=np.repeat(np.arange(len(counts)), counts),
        alpha_rad=alpha,
        half_distance_m=half_distance,
        rise_m=rise,
    )
