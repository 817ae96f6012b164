"""A table said once, as columns and rows: written as text or Markdown here, as HTML by a report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest


class Code(str):
    """Text of a cell that is shown as code where the medium can."""

    __slots__ = ()


@dataclass(frozen=True)
class Column:
    """A column: its name, the unit of its numbers, and how they are written.

    ``right``: aligned to the right; ``width``: at least so many characters in text. A name of
    several lines heads the column in as many lines of text.
    """

    name: str
    unit: str = ""
    format: str = ".4g"
    right: bool = False
    width: int = 0

    @property
    def heading(self) -> str:
        """The name, with the unit in brackets where there is one."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def quantity(name: str, unit: str = "", spec: str = ".4g", width: int = 0) -> Column:
    """Return a column of numbers, aligned to the right."""
    return Column(name, unit, spec, right=True, width=width)


Columns = Sequence[Column | str]
"""A column is given by its name alone where it holds texts."""


class Table:
    """Rows of values under columns; a row may end early. ``caption`` says what they are.

    A value is a number (written as its column says), a truth value (yes or no), a text, None, or a
    list of these.
    """

    def __init__(
        self, columns: Columns, rows: Iterable[Sequence[object]], caption: str = ""
    ) -> None:
        self.columns = [Column(c) if isinstance(c, str) else c for c in columns]
        self.rows = [[*row, *[""] * (len(columns) - len(row))] for row in rows]
        self.caption = caption
        for row in self.rows:
            if len(row) > len(columns):
                raise ValueError(f"{len(row)} values under {len(columns)} columns: {row}")

    def cells(self, missing: str = "-") -> list[list[str]]:
        """Return every row as texts, with ``missing`` where a value is None."""
        return [
            [shown(v, c.format, missing) for v, c in zip(row, self.columns, strict=True)]
            for row in self.rows
        ]

    def text(self) -> str:
        """Return the table as lines of text, each column as wide as its widest cell."""
        heads = zip_longest(*(column.heading.split("\n") for column in self.columns), fillvalue="")
        lines = [*(list(line) for line in heads), *self.cells()]
        widths = [
            max(column.width, *(len(line[i]) for line in lines))
            for i, column in enumerate(self.columns)
        ]
        sides = [str.rjust if column.right else str.ljust for column in self.columns]
        return "\n".join(
            "  ".join(side(c, w) for side, c, w in zip(sides, line, widths, strict=True)).rstrip()
            for line in lines
        )

    def markdown(self) -> str:
        """Return the table in Markdown, with what would break a row escaped."""
        head, *lines = (
            f"| {' | '.join(escaped(cell) for cell in line)} |"
            for line in ([column.heading for column in self.columns], *self.cells())
        )
        return "\n".join([head, f"{'|---' * len(self.columns)}|", *lines])


def shown(value: object, spec: str = ".4g", missing: str = "-") -> str:
    """Return a value as a table shows it: a number by ``spec``, a list with commas."""
    if isinstance(value, list | tuple):
        return ", ".join(shown(item, spec, missing) for item in value)
    if value is None:
        return missing
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    return format(value, spec)


def relative_change(old: object, new: object) -> float | None:
    """Return (new − old) / |old|; None where the old value is 0 or one is no number."""
    if isinstance(old, float) and isinstance(new, float) and old:
        return (new - old) / abs(old)
    return None


def percent(change: float | None) -> str:
    """Return a relative change in percent with its sign, "" where there is none."""
    return "" if change is None else f"{100 * change:+.3g} %"


def escaped(cell: str) -> str:
    """Return text with what would break a row of a Markdown table escaped; code in backticks."""
    plain = cell.replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")
    return f"`{plain}`" if isinstance(cell, Code) else plain
