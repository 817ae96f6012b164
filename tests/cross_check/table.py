"""Write docs/cross-checks.md from the rows that ``pytest -m cross_check`` left."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cross_check_rows import ROOT, ROWS_FILE

PAGE = ROOT / "docs" / "cross-checks.md"

HEAD = (
    "| quantity | points | this project | theory | cross-check | unit "
    "| less project | less theory |"
)


def number(value: float | None) -> str:
    """Return a number as the table shows it."""
    return "" if value is None else f"{value:.4g}"


def percent(value: float | None) -> str:
    """Return a part as a percentage; one that is rounding as a power of ten."""
    if value is None:
        return ""
    if abs(value) < 5e-7:
        return f"{value:.0e}" if value else "0"
    digits = 4 if abs(value) < 5e-5 else 2
    return f"{100.0 * value:+.{digits}f} %"


def size(row: dict[str, Any]) -> float:
    """Return by how much a row's cross-check differs from whatever it is compared with."""
    return max(
        (abs(row[k]) for k in ("difference", "from_theory") if row[k] is not None), default=0
    )


def line(row: dict[str, Any], points: str) -> str:
    """Return one row of a table."""
    part = row["asked"]
    asked = (
        ""
        if part is None
        else f" (required {100 * part:g} %)"
        if part > 1e-3
        else f" (required {part:.0e})"
    )
    cells = [
        f"{row['quantity']}{asked}",
        points,
        *(number(row[key]) for key in ("project", "theory", "found")),
        row["unit"],
        percent(row["difference"]),
        percent(row["from_theory"]),
    ]
    return "| " + " | ".join(cells) + " |"


def short(run: dict[str, Any]) -> Iterator[str]:
    """Yield one row for each quantity of a run: the point where the cross-check differs most."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in run["rows"]:
        groups.setdefault(row["quantity"], []).append(row)
    for rows in groups.values():
        worst = max(rows, key=size)
        where = worst["point"] if len(rows) == 1 else f"{len(rows)}, worst at {worst['point']}"
        yield line(worst, where)


def heading(run: dict[str, Any], *, times: bool) -> str:
    """Return the row that begins a run, with the time that each took."""
    took = run["seconds"]
    names = {"project": "project", "theory": "theory", "other": "cross-check"}
    parts = [f"{shown} {_rounded(took[who])} s" for who, shown in names.items() if who in took]
    told = f" ({', '.join(parts)})" if times and parts else ""
    return f"| **{run['code']}: {run['name']}**{told} |" + " |" * 7


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def page(content: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the generated part."""
    versions = ", ".join(f"{name} {v}" for name, v in sorted(content["versions"].items()))
    yield f"{content['machine']}; {versions}. Seconds of processor time."
    yield ""
    yield HEAD
    yield "|---" * 8 + "|"
    for run in content["runs"]:
        yield heading(run, times=True)
        yield from short(run)
    yield ""
    yield "<details><summary>Every point</summary>"
    yield ""
    yield HEAD
    yield "|---" * 8 + "|"
    for run in content["runs"]:
        yield heading(run, times=False)
        yield from (line(row, row["point"]) for row in run["rows"])
    yield ""
    yield "</details>"


def main() -> int:
    """Replace what stands between the marks of the page."""
    if not ROWS_FILE.exists():
        print(f"{ROWS_FILE} is not there: run pytest -m cross_check first", file=sys.stderr)
        return 1
    content = json.loads(ROWS_FILE.read_text(encoding="utf-8"))
    begin, end = "<!-- table -->\n", "<!-- end -->"
    before, rest = PAGE.read_text(encoding="utf-8").split(begin)
    _, after = rest.split(end)
    generated = "\n".join(page(content))
    Path(PAGE).write_text(f"{before}{begin}{generated}\n{end}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
