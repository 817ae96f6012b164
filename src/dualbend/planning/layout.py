"""A sheet with holes over its pins: clearances at a bending angle, and layouts that are refused."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.planning.geometry import hole_play, lowest_rim, tip_guides
from dualbend.planning.shape import HangingSheet, HolePose, hang, shape_family
from dualbend.scene.bed.config import HolesConfig, PinsConfig, hole_places
from dualbend.types import SIDES


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

    @cached_property
    def middle(self) -> list[float]:
        """Places of the middle holes along the sheet from its middle [m]."""
        return [float(along) for along in self.holes.places_of("middle")[:, 0]]

    @cached_property
    def outer(self) -> list[float]:
        """Places of the outer holes along the sheet from its middle [m]."""
        return [float(along) for along in self.holes.places_of("outer")[:, 0]]

    def shift_m(self, pose: HolePose, along_m: float) -> float:
        """Return how far along the sheet a hole's pin is from it, as the sheet is bent [m].

        s − X(s), outward: on the right of the middle it is positive, on the left negative.
        """
        return math.copysign(abs(along_m) - pose.x_m, along_m)

    def _room(self, shape: HangingSheet) -> tuple[float, float]:
        """Return from where to where along x the sheet may be with its middle holes on pins [m].

        A hole with the play p fits while the sheet is ± p/2 around where hole and pin are in line;
        from the higher to the lower end where there is no such place.
        """
        lows, highs = [], []
        for s in self.middle:
            pose = shape.at(abs(s))
            play = hole_play(
                self.hole_m, self.pins.diameter_m, self.sheet.thickness_m, pose.slope_rad
            )
            shift = self.shift_m(pose, s)
            lows.append(shift - play / 2.0)
            highs.append(shift + play / 2.0)
        return max(lows), min(highs)

    def place_m(self, shape: HangingSheet) -> float:
        """Return where along x the sheet has as much play on one side as on the other [m]."""
        low, high = self._room(shape)
        return (low + high) / 2.0

    def fit_slack_m(self, shape: HangingSheet) -> float:
        """Return the play ± along x of the sheet on its middle pins [m]; falls with α.

        Of two mirrored holes: half the free play of one, less its approach.
        """
        low, high = self._room(shape)
        return (high - low) / 2.0

    def seat_slack_m(self, shape: HangingSheet) -> float:
        """Return how far the centre of each middle hole is below its tip [m]; falls with α."""
        z = max(shape.at(abs(s)).z_m for s in self.middle)
        return self.pins.height_m - self.sheet.thickness_m / 2.0 - z

    def lift_m(self, shape: HangingSheet, *along_m: float) -> float:
        """Return how far the rims of outer holes are above the tips [m]; grows with α.

        Of those at these places, or of all.
        """
        t = self.sheet.thickness_m
        rims = (lowest_rim(shape.at(abs(s)), self.hole_m, t) for s in along_m or self.outer)
        return min(rims) - self.pins.height_m

    def guide_slack_m(self, shape: HangingSheet, *along_m: float) -> float:
        """Return the offset that an outer tip guides, less the hole's [m]; falls with α.

        Of those at these places, or of all.
        """
        return min(
            self.guide_m(shape.at(abs(s))) - self.offset_m(shape, s) for s in along_m or self.outer
        )

    def offset_m(self, shape: HangingSheet, along_m: float) -> float:
        """Return how far along x a hole is off its pin, the middle ones on theirs [m]."""
        return abs(self.shift_m(shape.at(abs(along_m)), along_m) - self.place_m(shape))

    def guide_m(self, pose: HolePose) -> float:
        """Return the offset of a hole at a pose from which an outer tip guides it in [m]."""
        return tip_guides(self.pins, self.hole_m, self.sheet.thickness_m, pose.slope_rad)


def check_layout(layout: Layout) -> None:
    """Raise InputError where holes or pins overlap or leave the sheet, or a tip is too long.

    The message gives key, value and what would be right, at any bending angle.
    """
    sheet, holes, pins = layout.sheet, layout.holes, layout.pins
    D, d = layout.hole_m, pins.diameter_m
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
    _check_groups(layout)
    if holes.each is None:
        keys = [name for name, _ in holes.listed for _ in SIDES]
    else:
        keys = [name for name, _ in holes.listed]
    for (one, p), (other, q) in itertools.combinations(
        zip(keys, hole_places(holes), strict=True), 2
    ):
        gap = math.hypot(*(p - q))
        both = f"the two of {one}" if one == other else f"{one} and {other}"
        where = f"{both} are {gap:.6g} m apart"
        if gap <= d:
            raise InputError(
                f"{where}: their pins overlap, it must be more than pins.diameter_m = {d:g}"
            )
        if gap < 1.5 * D:
            raise InputError(f"{where}: it must be {1.5 * D:.6g} (1.5 diameters) or more")
    # A hole's radius of material between the hole and the edge.
    for name, hole in holes.listed:
        for key, edge in (
            ("along_m", sheet.length_m / 2.0 - D),
            ("across_m", sheet.width_m / 2.0 - D),
        ):
            value = getattr(hole, key)
            if abs(value) > edge:
                raise InputError(
                    f"{name}.{key} = {value:g} is off the sheet or within a "
                    f"hole's radius of its edge: its size must not exceed {edge:.6g}"
                )


def _check_groups(layout: Layout) -> None:
    """Raise InputError where the middle holes are not between the outer ones."""
    holes = layout.holes
    if holes.each is None:
        if holes.outer.along_m <= holes.middle.along_m:
            raise InputError(
                f"holes.outer.along_m = {holes.outer.along_m:g} must be above "
                f"holes.middle.along_m = {holes.middle.along_m:g}"
            )
        return
    if not layout.middle:
        raise InputError('holes.each: no hole has group = "middle"; one or more must go first')
    left, right = min(layout.outer, default=0.0), max(layout.outer, default=0.0)
    if not left < 0.0 < right:
        raise InputError(
            "holes.each: on both sides of the sheet's middle, along_m below and above 0, one hole "
            'or more must have group = "outer"'
        )
    far, near = max(map(abs, layout.middle)), min(map(abs, layout.outer))
    if near <= far:
        raise InputError(
            f"holes.each: an outer hole is {near:g} m from the sheet's middle along it, a middle "
            f"one {far:g} m: it must be farther than all middle ones"
        )
