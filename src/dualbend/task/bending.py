"""What the two arms do in the paper's experiment: hold, bend along a path, hold, maybe return.

The sheet's middle stays where it is; the ends come together, rise and tilt (Fig. 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from dualbend.beam.elastica import END_SLOPE_GRIPPERS_MEET
from dualbend.beam.path import (
    ApproximatePath,
    BendingPath,
    ExactPath,
    PiecewiseLinearPath,
    TablePath,
)
from dualbend.beam.time_law import ConstantSpeed, TimeLaw, TrapezoidalSpeed
from dualbend.control.alter import COMMAND_PERIOD_S
from dualbend.errors import InputError

Vector = NDArray[np.float64]
Phase = Literal["settle", "bend", "hold", "return", "rest"]
PHASES: tuple[Phase, ...] = ("settle", "bend", "hold", "return", "rest")


class PathConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which grip poses belong to a bending angle, and from which to which angle."""

    kind: Annotated[
        Literal["exact", "piecewise", "approximate", "table"],
        msgspec.Meta(
            description="exact: no end moment; piecewise: straight pieces between its poses; "
            "approximate: a polynomial; table: your own"
        ),
    ] = "piecewise"
    start_rad: Annotated[float, msgspec.Meta(ge=0, description="bending angle at the start")] = 0.0
    end_rad: Annotated[float, msgspec.Meta(gt=0, description="bending angle at the end")] = 1.0
    interval_rad: (
        Annotated[float, msgspec.Meta(ge=1e-4, description="length of a linear piece")] | None
    ) = None
    pieces: Annotated[int, msgspec.Meta(ge=1, le=1000, description="number of pieces")] | None = (
        None
    )
    table: (
        Annotated[
            tuple[tuple[float, float, float], ...],
            msgspec.Meta(
                min_length=2,
                description="rows of bending angle in rad, half distance of the grips and their "
                "rise above the sheet's middle in m",
            ),
        ]
        | None
    ) = None
    smooth: Annotated[
        bool, msgspec.Meta(description="a cubic spline through the table's rows, else straight")
    ] = False

    def __post_init__(self) -> None:
        """Refuse angles at which the grippers meet and a piece-wise path without its pieces."""
        if not self.start_rad < self.end_rad < END_SLOPE_GRIPPERS_MEET:
            raise ValueError(
                f"end_rad must lie between start_rad = {self.start_rad} and "
                f"{END_SLOPE_GRIPPERS_MEET:.4f} rad, where the grippers meet; got {self.end_rad}"
            )
        given = [self.interval_rad is not None, self.pieces is not None]
        if self.kind == "piecewise" and sum(given) != 1:
            raise ValueError(
                'kind = "piecewise" needs either interval_rad (0.2 in Fig. 6) or pieces, not both'
            )
        if self.kind != "piecewise" and any(given):
            raise ValueError(f'kind = "{self.kind}" has no pieces: drop interval_rad and pieces')
        if (self.kind == "table") != (self.table is not None):
            raise ValueError(
                f'kind = "table" and table belong together; got kind = "{self.kind}" '
                f"{'without' if self.table is None else 'with'} a table"
            )
        if self.smooth and self.table is None:
            raise ValueError(f'smooth = true belongs to kind = "table", got kind = "{self.kind}"')


class MotionConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How fast the bending angle grows and how long the arms hold before and after."""

    speed_rad_per_s: Annotated[
        float, msgspec.Meta(gt=0, le=5, description="of the bending angle")
    ] = 0.1
    acceleration_rad_per_s2: (
        Annotated[float, msgspec.Meta(gt=0, description="of a trapezoidal speed; none: constant")]
        | None
    ) = None
    settle_s: Annotated[
        float, msgspec.Meta(ge=0, le=600, description="the arms hold the start before they bend")
    ] = 1.0
    hold_s: Annotated[
        float, msgspec.Meta(ge=0, le=600, description="the arms hold the end after they bent")
    ] = 1.0
    return_rad: (
        Annotated[
            float,
            msgspec.Meta(
                ge=0, description="bending angle to which they then go back; none: they do not"
            ),
        ]
        | None
    ) = None


def make_path(config: PathConfig, length_m: float) -> BendingPath:
    """Return the path of a sheet of free length ``length_m`` [m].

    Raises InputError where a table does not suit the sheet.
    """
    if config.kind == "exact":
        return ExactPath(length_m, config.end_rad, config.start_rad)
    if config.kind == "approximate":
        return ApproximatePath(length_m, config.end_rad, config.start_rad)
    if config.table is not None:
        try:
            return TablePath(
                length_m, config.table, config.smooth, config.end_rad, config.start_rad
            )
        except InputError as error:
            raise InputError(f"path.{error}") from error
    if config.pieces is not None:
        return PiecewiseLinearPath.from_count(
            length_m, config.end_rad, config.pieces, start_rad=config.start_rad
        )
    assert config.interval_rad is not None
    return PiecewiseLinearPath.from_interval(
        length_m, config.end_rad, config.interval_rad, start_rad=config.start_rad
    )


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


def nominal_motion(path: PathConfig, motion: MotionConfig, length_m: float) -> NominalMotion:
    """Return the nominal motion, one entry a command cycle of 28 ms."""
    law = make_time_law(path, motion)
    counts = [
        int(np.ceil(duration / COMMAND_PERIOD_S - 1e-9))
        for duration in (motion.settle_s, law.duration_s, motion.hold_s)
    ]
    # However short the way: the bending is a cycle at least.
    counts[1] = max(counts[1], 1)
    back = None if motion.return_rad is None else make_time_law(path, motion, back=True)
    if back is not None:
        counts += [max(int(np.ceil(back.duration_s / COMMAND_PERIOD_S - 1e-9)), 1), counts[-1]]
    # The last phase owns the sample at its end, so that the run reaches the final angle.
    counts[-1] += 1
    since_bending = COMMAND_PERIOD_S * np.arange(
        -counts[0], sum(counts) - counts[0], dtype=np.float64
    )
    alpha: Vector = law.at(since_bending)
    if back is not None:
        leaves = sum(counts[:3])
        since_leaving = COMMAND_PERIOD_S * np.arange(sum(counts) - leaves, dtype=np.float64)
        alpha[leaves:] = back.at(since_leaving)
    half_distance, rise = make_path(path, length_m).at(alpha)
    return NominalMotion(
        phase=np.repeat(np.arange(len(counts)), counts),
        alpha_rad=alpha,
        half_distance_m=half_distance,
        rise_m=rise,
    )
