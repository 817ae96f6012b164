"""What is remembered from sheet to sheet: where they had to be held over their pins.

All sheets come from one stand: as far as one lay off it, and as far as the arms are wrong about the
bed, so is the next one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dualbend.types import Vector

_PLACE = ("x_m", "y_m", "yaw_rad")
_RAISED = ("height_m", "left_level_m", "right_level_m")


class Lesson(NamedTuple):
    """Where a sheet was lowered first, ``start``, and where it was ``found`` to be seated.

    Both x, y [m] and yaw [rad] (3,) of the grips' middle over that of the pins. ``learned``: it
    counts for the sheets that follow. ``raised`` (3,) [m]: by how much both arms and each of them
    had to be raised, which is not learned.
    """

    start: Vector
    found: Vector
    learned: bool
    raised: Vector

    def row(self) -> dict[str, str | float | bool | None]:
        """Return it as a row of the summary."""
        parts = (("start", _PLACE, self.start), ("found", _PLACE, self.found))
        numbers: dict[str, str | float | bool | None] = {
            f"{which}_{name}": float(value)
            for which, names, values in (*parts, ("found", _RAISED, self.raised))
            for name, value in zip(names, values, strict=True)
        }
        return {**numbers, "learned": self.learned}


@dataclass
class Memory:
    """Where the sheets so far were found: the next one is lowered at ``start`` (3,), their mean.

    A sheet that was found elsewhere is not learned from. Where the next one is found there, too,
    the stand, or how sheets are held, has changed: all is forgotten but these two.
    """

    lessons: list[Lesson] = field(default_factory=list)
    kept: list[Vector] = field(default_factory=list)
    odd: Vector | None = None

    @property
    def start(self) -> Vector:
        """Return where the next sheet is lowered first (3,); before the first one, 0."""
        return np.mean(self.kept, axis=0) if self.kept else np.zeros(3)

    def learn(self, found: Vector, near: Vector, raised: Vector) -> None:
        """Remember where a sheet was found; by more than ``near`` (3,) off it is elsewhere."""

        def is_near(place: Vector) -> bool:
            return bool((np.abs(found - place) <= near).all())

        start, odd = self.start, self.odd
        self.odd = None
        if not self.kept or is_near(start):
            self.kept.append(found)
        elif odd is not None and is_near(odd):
            self.kept = [odd, found]
        else:
            self.odd = found
        self.lessons.append(Lesson(start, found, self.odd is None, raised))
