"""The path of the grips over the bending angle, as a scenario gives it."""

from __future__ import annotations

from typing import Annotated, Literal

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
