"""What of a workplace no robot could work at: refused before anything is planned."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.scene.bed.config import LayoutConfig, hole_places
from dualbend.task.assembly.config import AssemblyConfig

JAW_ROOM_M: Final = 0.015
"""From a grip to what its gripper must not touch: half a jaw's depth, and 5 mm to be safe."""

LIFT_ROOM_M: Final = 5e-3
"""Between the tips of the pins and a sheet that is carried over them."""


def check_workplace(config: AssemblyConfig, sheet: Sheet) -> None:
    """Raise InputError with the key, its value and what would be right."""
    for problem in _problems(config, sheet):
        raise InputError(f"task.{problem}")


def _problems(config: AssemblyConfig, sheet: Sheet) -> Iterator[str]:
    layout = config.layout
    bed, stand, pins = layout.bed, layout.stand, layout.pins
    longest = 0.5 * sheet.length_m - JAW_ROOM_M
    for block_name, block in (("bed", bed), ("stand", stand)):
        if block.half_length_m > longest:
            yield (
                f"layout.{block_name}.half_length_m = {block.half_length_m:g}: the grippers at the "
                f"sheet's ends would touch it; at most {longest:g}"
            )
    radius = 0.5 * pins.diameter_m
    for name, hole in layout.holes.listed:
        for key, side in (("along_m", "half_length_m"), ("across_m", "half_width_m")):
            half = getattr(bed, side)
            if abs(getattr(hole, key)) + radius > half:
                yield (
                    f"layout.{name}.{key} = {getattr(hole, key):g}: its pins would not stand "
                    f"on the bed; at most {half - radius:g}, or a larger layout.bed.{side}"
                )
    thicker = max(0.0, 2.0 * pins.height_m - pins.diameter_m)
    if pins.tip == "round" and layout.thicker_m.max() > thicker:
        yield (
            f"layout.pins.thicker_m = {pins.thicker_m}: a round tip would be longer than its pin; "
            f"at most {thicker:g}"
        )
    yield from _holes_beside_the_sheet(layout, sheet)
    apart = bed.half_width_m + stand.half_width_m
    if abs(stand.y_m) < apart:
        yield (
            f"layout.stand.y_m = {stand.y_m:g}: the stand stands in the bed; at least {apart:g} "
            "to either side"
        )
    laid = (config.sheets - 1) * sheet.thickness_m
    if laid + sheet.thickness_m > pins.height_m:
        yield (
            f"sheets = {config.sheets}: the stack is higher than its pins, "
            f"layout.pins.height_m = {pins.height_m:g}; at most "
            f"{int(pins.height_m / sheet.thickness_m)} sheets"
        )
    least = pins.height_m + LIFT_ROOM_M
    if config.lift_m < least:
        yield (
            f"lift_m = {config.lift_m:g}: the sheet would be carried into the pins; "
            f"at least {least:g}"
        )


def _holes_beside_the_sheet(layout: LayoutConfig, sheet: Sheet) -> Iterator[str]:
    holes, radius = layout.holes, 0.5 * (layout.pins.diameter_m + layout.holes.clearance_m)
    most = np.array([0.5 * sheet.length_m, 0.5 * sheet.width_m]) - radius
    keys = "along_m", "across_m"
    for name, hole in holes.listed:
        for key, limit in zip(keys, most.tolist(), strict=True):
            if abs(value := getattr(hole, key)) > limit:
                yield (
                    f"layout.{name}.{key} = {value:g}: its holes would not be in the sheet; "
                    f"at most {limit:g}"
                )
    for name, place, error in zip(holes.names, hole_places(holes), holes.offsets_m, strict=True):
        if (abs(place + error) > most).any():
            yield (
                f"layout.holes.errors_m = {holes.errors_m}: the {name} hole would not be in the "
                f"sheet; it may be {most[0]:g} along and {most[1]:g} across from the middle"
            )
