"""Bed, alignment pins, pick-up stand and holes of an assembly, as a scenario gives them."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

import msgspec
import numpy as np

from dualbend.errors import brief
from dualbend.types import Config, Mask, Vector, said

Group = Literal["middle", "outer"]
GROUPS: tuple[Group, Group] = get_args(Group)
HOLES = ("middle_left", "middle_right", "outer_left", "outer_right")
"""Holes and pins of two mirrored pairs, as every array of four has them; left is negative."""


class HolePairConfig(Config):
    """Two holes, or two pins, that are each other's image in the sheet's middle.

    One stands at (−along, −across), the other at (+along, +across), from the middle.
    """

    along_m: Annotated[float, said("arc length from the middle", ge=0, lt=1.5)]
    across_m: Annotated[float, said("off the centre line", ge=-1.5, le=1.5)] = 0.0


class HoleConfig(Config):
    """One hole and its pin, anywhere in the sheet."""

    group: Annotated[Group, said("which go first, while the sheet is bent, and which last")]
    along_m: Annotated[
        float, said("arc length from the sheet's middle, left is negative", gt=-1.5, lt=1.5)
    ]
    across_m: Annotated[float, said("off the centre line", ge=-1.5, le=1.5)] = 0.0


_Offset = Annotated[float, msgspec.Meta(ge=-0.05, le=0.05)]

MOST_HOLES = 16
MIDDLE, OUTER = HolePairConfig(along_m=0.04), HolePairConfig(along_m=0.14)


class HolesConfig(Config):
    """The sheet's holes: the middle ones go over their pins first, then the outer ones.

    Two mirrored pairs, ``middle`` and ``outer``, or ``each`` of them by itself in their place:
    middle_1, middle_2, outer_1 and so on, in the order of the list.
    """

    middle: HolePairConfig = MIDDLE
    outer: HolePairConfig = OUTER
    each: (
        Annotated[
            tuple[HoleConfig, ...],
            said(
                "holes one by one, in place of the pairs",
                min_length=1,
                max_length=MOST_HOLES,
                extra={"replaces": GROUPS},
            ),
        ]
        | None
    ) = None
    clearance_m: Annotated[float, said("hole's diameter less the pin's", gt=0, lt=5e-3)] = 0.2e-3
    errors_m: Annotated[
        tuple[tuple[_Offset, _Offset], ...],
        said("every hole off its place, along and across; [] is none", max_length=MOST_HOLES),
    ] = ()

    def __post_init__(self) -> None:
        """Refuse pairs beside a list."""
        pairs = (self.middle, MIDDLE, "middle"), (self.outer, OUTER, "outer")
        for pair, default, name in pairs:
            if self.each is not None and pair != default:
                raise ValueError(f'{name}: each lists all holes; each = "none" takes it back')

    @property
    def listed(self) -> list[tuple[str, HolePairConfig | HoleConfig]]:
        """The key of each hole or pair, and what it says."""
        if self.each is None:
            return [("holes.middle", self.middle), ("holes.outer", self.outer)]
        return [(f"holes.each[{i}]", hole) for i, hole in enumerate(self.each)]

    @property
    def groups(self) -> tuple[Group, ...]:
        """Whether each hole goes first or last."""
        if self.each is None:
            return ("middle", "middle", "outer", "outer")
        return tuple(hole.group for hole in self.each)

    @property
    def names(self) -> tuple[str, ...]:
        """What each hole and its pin are called."""
        groups = self.groups
        if self.each is None:
            return HOLES
        return tuple(f"{group}_{groups[: i + 1].count(group)}" for i, group in enumerate(groups))

    def names_of(self, group: Group) -> tuple[str, ...]:
        """Return the names of the holes of a group."""
        return tuple(n for n, g in zip(self.names, self.groups, strict=True) if g == group)

    def places_of(self, group: Group) -> Vector:
        """Return (k, 2): where along and across the holes of a group are [m]."""
        return hole_places(self)[[g == group for g in self.groups]]

    @property
    def offsets_m(self) -> Vector:
        """How far each hole is off its place (n, 2) [m]."""
        return np.array(self.errors_m) if self.errors_m else np.zeros((len(self.groups), 2))


_Name = Annotated[str, msgspec.Meta(max_length=20)]
_Thicker = Annotated[float, msgspec.Meta(ge=-0.5e-3, le=2e-3)]


class PinsConfig(Config):
    """The alignment pins, where the holes of a flat sheet belong.

    The robots know them as drawn; ``thicker_m`` and ``missing`` are what they are not told.
    """

    diameter_m: Annotated[float, said("of the shank", ge=1e-3, le=0.03)] = 4.76e-3
    height_m: Annotated[float, said("tip above the bed", ge=2e-3, le=0.05)] = 6e-3
    tip: Annotated[Literal["round", "taper"], said("half a ball or a cone")] = "round"
    taper_length_m: Annotated[float, said("of a tapered tip", gt=0, le=0.05)] = 4e-3
    friction: Annotated[float, said("pin against hole's edge", ge=0, le=2)] = 0.2
    thicker_m: Annotated[
        tuple[_Thicker, ...],
        said("every pin's true diameter less the drawn one; [] is none", max_length=MOST_HOLES),
    ] = ()
    missing: Annotated[
        tuple[_Name, ...], said("names of pins that do not stand", max_length=MOST_HOLES)
    ] = ()

    @property
    def tip_m(self) -> float:
        """Length of the tip, over which a pin gets thinner [m]."""
        return 0.5 * self.diameter_m if self.tip == "round" else self.taper_length_m


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

    def __post_init__(self) -> None:
        """Refuse what is said of another number of holes, or of pins that are not there."""
        names = self.holes.names
        for key, given in (
            ("holes.errors_m", self.holes.errors_m),
            ("pins.thicker_m", self.pins.thicker_m),
        ):
            if given and len(given) != len(names):
                raise ValueError(
                    f"{key} has {len(given)} entries: must have one for each of the {len(names)} "
                    f"holes, {', '.join(names)}, or none"
                )
        for name in self.pins.missing:
            if name not in names:
                raise ValueError(
                    f"pins.missing: {brief(name)} is no pin; they are {', '.join(names)}"
                )

    @property
    def thicker_m(self) -> Vector:
        """Diameter of each pin less the drawn one (n,) [m]."""
        return np.array(self.pins.thicker_m or (0.0,) * len(self.holes.names))

    @property
    def standing(self) -> Mask:
        """Which pins stand on the bed (n,)."""
        return np.array([name not in self.pins.missing for name in self.holes.names])


def hole_places(holes: HolesConfig) -> Vector:
    """Return (n, 2): distance along and across the sheet from its middle [m], in names' order."""
    if holes.each is not None:
        return np.array([(hole.along_m, hole.across_m) for hole in holes.each])
    pairs = (holes.middle, holes.outer)
    return np.array(
        [(sign * pair.along_m, sign * pair.across_m) for pair in pairs for sign in (-1.0, 1.0)]
    )
