"""What a page is put together of, as data; the templates alone know how it becomes HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from markupsafe import Markup

from dualbend.report.plot import Plot
from dualbend.table import Table


@dataclass(frozen=True, eq=False)
class Figure:
    """A plot with its caption and, for who does not see it, what it shows."""

    plot: Plot
    caption: str
    alt: str


class Panels(NamedTuple):
    """Figures beside each other where there is room."""

    figures: Sequence[Figure]


class Details(NamedTuple):
    """A table that is folded away."""

    summary: str
    table: Table


class Verdict(NamedTuple):
    """How a run ended, and whether that was expected."""

    ended: str
    expected: bool
    seed: int


class Warned(NamedTuple):
    """Where a run contradicts physics, in a sentence."""

    text: str


Block = str | Markup | Table | Figure | Panels | Details | Verdict | Warned
"""A text is a paragraph of its own."""


@dataclass(frozen=True)
class Section:
    """A part of the page with its heading."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Chapter:
    """The parts of the page about one thing, and what is said before them."""

    title: str
    lead: Sequence[Block]
    sections: Sequence[Section]

    @property
    def figures(self) -> list[Figure]:
        """All figures, in the order of the page."""
        blocks = [*self.lead, *(block for part in self.sections for block in part.blocks)]
        found: list[Figure] = []
        for block in blocks:
            if isinstance(block, Figure):
                found.append(block)
            elif isinstance(block, Panels):
                found += block.figures
        return found
