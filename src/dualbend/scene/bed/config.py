"""Bed, alignment pins, pick-up stand and holes of an assembly, as a scenario gives them."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

import msgspec
import numpy as np

from dualbend.types import Config, Mask, Vector, said

HoleName = Literal["middle_left", "middle_right", "outer_left", "outer_right"]
HOLES: tuple[str, ...] = get_args(HoleName)
"""Holes and pins, as every array of four has them; left is negative along the sheet."""


class HolePairConfig(Config):
    """Two holes, or two pins, that are each other's image in the sheet's middle.

    One stands at (−along, −across), the other at (+along, +across), from the middle.
    """

    along_m: Annotated[float, said("arc length from the middle", ge=0, lt=1.5)]
    across_m: Annotated[float, said("off the centre line", ge=-1.5, le=1.5)] = 0.0


_Offset = Annotated[float, msgspec.Meta(ge=-0.05, le=0.05)]


class HolesConfig(Config):
    """The sheet's four holes: the middle pair goes over its pins first, then the outer pair."""

    middle: HolePairConfig = HolePairConfig(along_m=0.04)
    outer: HolePairConfig = HolePairConfig(along_m=0.14)
    clearance_m: Annotated[float, said("hole's diameter less the pin's", gt=0, lt=5e-3)] = 0.2e-3
    errors_m: Annotated[
        tuple[tuple[_Offset, _Offset], ...],
        said("each hole off its place, along and across", min_length=4, max_length=4),
    ] = ((0.0, 0.0),) * 4


_Thicker = Annotated[float, msgspec.Meta(ge=-0.5e-3, le=2e-3)]


class PinsConfig(Config):
    """The four alignment pins, where the holes of a flat sheet belong.

    The robots know them as drawn; ``thicker_m`` and ``missing`` are what they are not told.
    """

    diameter_m: Annotated[float, said("of the shank", ge=1e-3, le=0.03)] = 4.76e-3
    height_m: Annotated[float, said("tip above the bed", ge=2e-3, le=0.05)] = 6e-3
    tip: Annotated[Literal["round", "taper"], said("half a ball or a cone")] = "round"
    taper_length_m: Annotated[float, said("of a tapered tip", gt=0, le=0.05)] = 4e-3
    friction: Annotated[float, said("pin against hole's edge", ge=0, le=2)] = 0.2
    thicker_m: Annotated[
        tuple[_Thicker, ...],
        said("each pin's true diameter less the drawn one", min_length=4, max_length=4),
    ] = (0.0,) * 4
    missing: Annotated[tuple[HoleName, ...], said("pins that do not stand", max_length=4)] = ()

    @property
    def tip_m(self) -> float:
        """Length of the tip, over which a pin gets thinner [m]."""
        return 0.5 * self.diameter_m if self.tip == "round" else self.taper_length_m

    @property
    def true_diameters_m(self) -> Vector:
        """Diameter (4,) of each pin's shank as it is [m]."""
        return self.diameter_m + np.array(self.thicker_m)

    @property
    def stand(self) -> Mask:
        """Which pins stand on the bed (4,)."""
        return np.array([name not in self.missing for name in HOLES])


class BedConfig(Config):
    """The assembly bed: a flat block with the pins, under the cell's origin."""

    half_length_m: Annotated[float, said("half the block along x", gt=0, lt=3)] = 0.165
    half_width_m: Annotated[float, said("half the block along y", gt=0, lt=3)] = 0.05
    top_m: Annotated[float, said("above the floor", gt=0, lt=3)] = 0.672
    friction: Annotated[float, said("bed and stand", ge=0, le=2)] = 0.2


class StandConfig(Config):
    """The pick-up stand: a flat block beside the bed."""

    y_m: Annotated[float, said("its middle, in the world", ge=-1.5, le=1.5)] = 0.30
    half_length_m: Annotated[float, said("half the block along x", gt=0, lt=3)] = 0.165
    half_width_m: Annotated[float, said("half the block along y", gt=0, lt=3)] = 0.05
    top_m: Annotated[float, said("above the floor", gt=0, lt=3)] = 0.672


class LayoutConfig(Config):
    """Everything that the arms' workplace holds beside the sheet itself."""

    holes: HolesConfig = HolesConfig()
    pins: PinsConfig = PinsConfig()
    bed: BedConfig = BedConfig()
    stand: StandConfig = StandConfig()


def hole_places(holes: HolesConfig) -> Vector:
    """Return (4, 2): distance along and across the sheet from its middle [m], in HOLES' order."""
    pairs = (holes.middle, holes.outer)
    return np.array(
        [(sign * pair.along_m, sign * pair.across_m) for pair in pairs for sign in (-1.0, 1.0)]
    )
