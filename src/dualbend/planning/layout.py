"""A sheet with holes over its pins: clearances at a bending angle, and layouts that are refused."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.planning.geometry import hole_play, lowest_rim, tip_guides
from dualbend.planning.shape import HangingSheet, HolePose, hang, shape_family
from dualbend.scene.bed.config import HolesConfig, PinsConfig


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A sheet with its holes, their pins, and the limits of the bending angle.

    margin_m is the height of the outer holes above the tips of their pins, yield_strain the
    largest strain that the surface may have (None: any), min_half_distance_m the half distance
    of the grips at which the grippers meet, weight whether the sheet's own weight is counted.
    """

    sheet: Sheet
    holes: HolesConfig
    pins: PinsConfig
    margin_m: float = 1e-3
    yield_strain: float | None = None
    min_half_distance_m: float = 0.0
    weight: bool = True

    @property
    def hole_m(self) -> float:
        """Diameter of a hole [m]."""
        return self.pins.diameter_m + self.holes.clearance_m

    def hang(self, alpha: float) -> HangingSheet:
        """Return the shape at α [rad]."""
        if self.weight:
            return shape_family(self.sheet)(alpha)
        return hang(self.sheet, alpha, weight=False)

    def approach_m(self, pose: HolePose, along_m: float) -> float:
        """Return how much closer to the middle a hole is than its pin [m]."""
        return along_m - pose.x_m

    def fit_slack_m(self, shape: HangingSheet) -> float:
        """Return half the free play of a middle hole, less its approach [m]; falls with α."""
        s = self.holes.middle.along_m
        pose, pin = shape.at(s), self.pins.diameter_m
        play = hole_play(self.hole_m, pin, self.sheet.thickness_m, pose.slope_rad)
        return play / 2.0 - self.approach_m(pose, s)

    def seat_slack_m(self, shape: HangingSheet) -> float:
        """Return how far the centre of a middle hole is below the pin's tip [m]; falls with α."""
        z = shape.at(self.holes.middle.along_m).z_m
        return self.pins.height_m - self.sheet.thickness_m / 2.0 - z

    def lift_m(self, shape: HangingSheet) -> float:
        """Return how far the rims of the outer holes are above the tips [m]; grows with α."""
        pose = shape.at(self.holes.outer.along_m)
        return lowest_rim(pose, self.hole_m, self.sheet.thickness_m) - self.pins.height_m

    def guide_slack_m(self, shape: HangingSheet) -> float:
        """Return the offset that an outer tip guides, less the hole's [m]; falls with α."""
        s = self.holes.outer.along_m
        return self.guide_m(shape.at(s)) - self.approach_m(shape.at(s), s)

    def guide_m(self, pose: HolePose) -> float:
        """Return the offset of a hole at a pose from which an outer tip guides it in [m]."""
        return tip_guides(self.pins, self.hole_m, self.sheet.thickness_m, pose.slope_rad)


def check_layout(layout: Layout) -> None:
    """Raise InputError where holes or pins overlap or leave the sheet, or a tip is too long.

    The message gives key, value and what would be right, at any bending angle.
    """
    sheet, holes, pins = layout.sheet, layout.holes, layout.pins
    D, d = layout.hole_m, pins.diameter_m
    named = (("middle", holes.middle), ("outer", holes.outer))
    if pins.tip == "taper" and pins.taper_length_m > pins.height_m:
        raise InputError(
            f"pins.taper_length_m = {pins.taper_length_m:g} is longer than the pin: it must not "
            f"exceed pins.height_m = {pins.height_m:g}"
        )
    if pins.tip == "round" and d / 2.0 > pins.height_m:
        raise InputError(
            f"pins.height_m = {pins.height_m:g} is too short for a round tip: it must be "
            f"pins.diameter_m / 2 = {d / 2.0:g} or more"
        )
    if holes.outer.along_m <= holes.middle.along_m:
        raise InputError(
            f"holes.outer.along_m = {holes.outer.along_m:g} must be above holes.middle.along_m = "
            f"{holes.middle.along_m:g}"
        )
    for (one, p), (other, q) in itertools.combinations_with_replacement(named, 2):
        gap = math.hypot(p.along_m + q.along_m, p.across_m + q.across_m)
        both = f"the two of holes.{one}"
        if one != other:
            gap = min(gap, math.hypot(p.along_m - q.along_m, p.across_m - q.across_m))
            both = f"holes.{one} and holes.{other}"
        where = f"{both} are {gap:.6g} m apart"
        if gap <= d:
            raise InputError(
                f"{where}: their pins overlap, it must be more than pins.diameter_m = {d:g}"
            )
        if gap < 1.5 * D:
            raise InputError(f"{where}: it must be {1.5 * D:.6g} (1.5 diameters) or more")
    # A hole's radius of material between the hole and the edge.
    for name, pair in named:
        for key, value, edge in (
            ("along_m", pair.along_m, sheet.length_m / 2.0 - D),
            ("across_m", abs(pair.across_m), sheet.width_m / 2.0 - D),
        ):
            if value > edge:
                raise InputError(
                    f"holes.{name}.{key} = {getattr(pair, key):g} is off the sheet or within a "
                    f"hole's radius of its edge: its size must not exceed {edge:.6g}"
                )
