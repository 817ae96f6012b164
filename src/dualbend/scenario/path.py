"""The path of the grips over the bending angle, as a scenario gives it."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import msgspec

from dualbend.beam.elastica import END_SLOPE_GRIPPERS_MEET
from dualbend.beam.path import (
    ApproximatePath,
    BendingPath,
    ExactPath,
    PiecewiseLinearPath,
    TablePath,
)
from dualbend.errors import InputError
from dualbend.types import Tagged, said

_Number = Annotated[float, msgspec.Meta(ge=-10, le=10)]


class _Ends(Tagged):
    """From which to which bending angle a path goes."""

    start_rad: Annotated[float, said("bending angle at the start", ge=0, le=3.15)] = 0.0
    end_rad: Annotated[float, said("bending angle at the end", gt=0, le=3.15)] = 1.0
    learned: (
        Annotated[
            str,
            said(
                "file of corrections that dualbend learn wrote, from the scenario's folder; "
                "none: none",
                min_length=1,
                max_length=1000,
            ),
        ]
        | None
    ) = None

    def __post_init__(self) -> None:
        """Refuse angles at which the grippers meet."""
        if not self.start_rad < self.end_rad < END_SLOPE_GRIPPERS_MEET:
            raise InputError(
                f"end_rad must lie between start_rad = {self.start_rad} and "
                f"{END_SLOPE_GRIPPERS_MEET:.4f} rad, where the grippers meet; got {self.end_rad}"
            )

    def make(self, length_m: float) -> BendingPath:
        """Return the path of a sheet of free length ``length_m`` [m].

        Raises InputError where a table does not suit the sheet.
        """
        try:
            return self._of(length_m)
        except InputError as error:
            raise InputError(f"path.{error}") from error

    def _of(self, length_m: float) -> BendingPath:
        raise NotImplementedError


class PiecewisePathConfig(_Ends, tag="piecewise"):
    """Straight pieces between poses without end moment, each of one length but for the last."""

    interval_rad: Annotated[float, said("length of a linear piece", ge=1e-4, le=3.15)]

    def _of(self, length_m: float) -> BendingPath:
        return PiecewiseLinearPath.from_interval(
            length_m, self.end_rad, self.interval_rad, start_rad=self.start_rad
        )


class PiecesPathConfig(_Ends, tag="pieces"):
    """A number of equal straight pieces between poses without end moment."""

    pieces: Annotated[int, said("number of pieces", ge=1, le=1000, examples=[5])]

    def _of(self, length_m: float) -> BendingPath:
        return PiecewiseLinearPath.from_count(
            length_m, self.end_rad, self.pieces, start_rad=self.start_rad
        )


class ExactPathConfig(_Ends, tag="exact"):
    """The grip poses at which the sheet has no end moment, by elliptic integrals."""

    def _of(self, length_m: float) -> BendingPath:
        return ExactPath(length_m, self.end_rad, self.start_rad)


class ApproximatePathConfig(_Ends, tag="approximate"):
    """A polynomial in place of the elliptic integrals."""

    def _of(self, length_m: float) -> BendingPath:
        return ApproximatePath(length_m, self.end_rad, self.start_rad)


class TablePathConfig(_Ends, tag="table"):
    """Your own grip poses."""

    table: Annotated[
        tuple[tuple[_Number, _Number, _Number], ...],
        said(
            "rows of bending angle in rad, half distance of the grips and their "
            "rise above the sheet's middle in m",
            min_length=2,
            max_length=10_000,
            examples=[[[0.0, 0.2, 0.0], [1.0, 0.167, 0.0926]]],
        ),
    ]
    smooth: Annotated[bool, said("a cubic spline through the table's rows, else straight")] = False

    def _of(self, length_m: float) -> BendingPath:
        return TablePath(length_m, self.table, self.smooth, self.end_rad, self.start_rad)


PathConfig: TypeAlias = (
    PiecewisePathConfig
    | PiecesPathConfig
    | ExactPathConfig
    | ApproximatePathConfig
    | TablePathConfig
)
"""Which grip poses belong to a bending angle."""
