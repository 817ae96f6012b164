"""What is remembered from sheet to sheet: where they had to be held, how high the arms stood.

All sheets come from one stand, and the arms stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dualbend.types import Vector

PARTS = (
    ("x", "m"),
    ("y", "m"),
    ("yaw", "rad"),
    ("height", "m"),
    ("left_level", "m"),
    ("right_level", "m"),
)
"""Of what is found with a sheet: place between the grips, by how much the arms had to be raised."""


class Lesson(NamedTuple):
    """What a sheet was begun with and what was ``found`` with it, both (6,) as `PARTS` has it.

    ``learned``: what was found counts for the sheets that follow.
    """

    start: Vector
    found: Vector
    learned: bool

    def row(self) -> dict[str, str | float | bool | None]:
        """Return it as a row of the summary."""
        both = (("start", self.start), ("found", self.found))
        numbers: dict[str, str | float | bool | None] = {
            f"{which}_{name}_{unit}": float(value)
            for which, values in both
            for (name, unit), value in zip(PARTS, values, strict=True)
        }
        return {**numbers, "learned": self.learned}


@dataclass
class Memory:
    """What was found with the sheets so far: ``start`` (6,) is their mean, 0 before the first one.

    A sheet that differs from it is not learned from. Where the next one differs likewise the stand,
    or what holds the sheets, has changed: all is forgotten but these two.
    """

    lessons: list[Lesson] = field(default_factory=list)
    kept: list[Vector] = field(default_factory=list)
    odd: Vector | None = None

    @property
    def start(self) -> Vector:
        """What the next sheet begins with (6,)."""
        return np.mean(self.kept, axis=0) if self.kept else np.zeros(len(PARTS))

    def learn(self, found: Vector, near: Vector) -> None:
        """Remember what was found with a sheet; further off than ``near`` (6,) it differs."""
        start, odd = self.start, self.odd
        likewise = odd is not None and bool((np.abs(found - odd) <= near).all())
        learned = not self.kept or bool((np.abs(found - start) <= near).all())
        if learned:
            self.kept.append(found)
        elif odd is not None and likewise:
            self.kept = [odd, found]
        self.odd = None if learned or likewise else found
        self.lessons.append(Lesson(start, found, learned or likewise))
