"""The validation table as a Markdown page: the same text from the same measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dualbend.table import Column, Table
from dualbend.validation.row import Row

_HEAD = """# Validation

Made by `dualbend validate --markdown docs/validation.md`; do not edit. How far the simulation is
from theory and from independent models: {passed} of {count} rows pass. Nothing here is a stored
result: the command measures every row, in a minute or two, and exits with 1 where one fails.

What is in brackets at the end of a row's name says how the error is formed: *relative*
|measured − reference| over the reference or the scale that the name gives, *absolute*
|measured − reference|, *at most* and *at least* what is beyond the reference. A row passes where
its error is not above the allowed one. Errors near 1e-15 are rounding and differ between machines.

A row checks *mechanics* where both sides read the same properties: a wrong modulus would pass. It
checks a *property* where the reference is a number written down from a source, a table or a
calculation by hand (`src/dualbend/validation/handbook.py` and `dh.py` name them).

Measured with {versions}.
"""


def validation_page(rows: Sequence[Row], versions: Mapping[str, str]) -> str:
    """Return the page; ``versions`` by the name of the package."""
    head = _HEAD.format(
        passed=sum(row.passed for row in rows),
        count=len(rows),
        versions=", ".join(f"{name} {number}" for name, number in versions.items()),
    )
    columns = (
        *("", "checks", "what", "measured", "reference", "unit"),
        *(Column("error", format=".2g"), Column("allowed", format=".2g")),
    )
    cells = [
        (
            "pass" if row.passed else "**FAIL**",
            *(row.checks, row.name, row.measured, row.reference),
            "" if row.unit == "1" else row.unit,
            *(row.error, row.tolerance),
        )
        for row in rows
    ]
    return "\n".join([head, Table(columns, cells).markdown(), ""])
