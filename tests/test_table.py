"""A table written as text and as Markdown."""

import pytest

from dualbend.table import Code, Column, Table

COLUMNS = (Column("name"), Column("gain\nmargin", right=True), Column("force", "N", ".2f"))


def test_text_has_a_column_as_wide_as_its_widest_cell() -> None:
    found = Table(COLUMNS, [("a|<b", 2.0, 0.125), ("long name", None, [1.0, True])])
    assert found.text().splitlines() == [
        "name         gain  force [N]",
        "           margin",
        "a|<b            2  0.12",
        "long name       -  1.00, yes",
    ]


def test_a_row_may_end_early_and_a_column_have_a_width() -> None:
    wide = Table([Column("a", width=4), Column("b")], [("x",), ("y", "z")])
    assert wide.text().splitlines() == ["a     b", "x", "y     z"]


def test_a_row_of_too_many_values_is_refused() -> None:
    with pytest.raises(ValueError, match="2 values under 1 columns"):
        Table([Column("a")], [("x", "y")]).text()


def test_markdown_escapes_what_would_break_a_row() -> None:
    found = Table(
        [Column("key"), Column("of", "1/s")], [(Code("a.b"), "x|y\nz"), ("<b>", "**no**")]
    )
    assert found.markdown().splitlines() == [
        "| key | of [1/s] |",
        "|---|---|",
        "| `a.b` | x\\|y z |",
        "| &lt;b> | **no** |",
    ]
