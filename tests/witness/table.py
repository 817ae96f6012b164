"""Write docs/witnesses.md from the rows that ``pytest -m witness`` left."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from witness_rows import ROOT, ROWS_FILE

PAGE = ROOT / "docs" / "witnesses.md"

HEAD = "| quantity | points | this project | theory | witness | unit | less project | less theory |"


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
    """Return by how much a row's witness differs from whatever it is compared with."""
    return max(
        (abs(row[k]) for k in ("difference", "from_theory") if row[k] is not None), default=0
    )


def line(row: dict[str, Any], points: str) -> str:
    """Return one row of a table."""
    asked = "" if row["asked"] is None else f" (asked {row['asked'] * 100:g} %)"
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
    """Yield one row for each quantity of a run: the point where the witness differs most."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in run["rows"]:
        groups.setdefault(row["quantity"], []).append(row)
    for rows in groups.values():
        worst = max(rows, key=size)
        where = worst["point"] if len(rows) == 1 else f"{len(rows)}, worst at {worst['point']}"
        yield line(worst, where)


def seconds(run: dict[str, Any]) -> str:
    """Return the time that each took."""
    parts = run["seconds"]
    return ", ".join(
        f"{who} {parts[who]:.2g} s" for who in ("project", "theory", "witness") if who in parts
    )


def page(content: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the generated part."""
    versions = ", ".join(f"{name} {v}" for name, v in sorted(content["versions"].items()))
    yield f"{content['machine']}; {versions}. One core, shared with others."
    yield ""
    yield HEAD
    yield "|---" * 8 + "|"
    for run in content["runs"]:
        yield f"| **{run['witness']}: {run['name']}** ({seconds(run)}) |" + " |" * 7
        yield from short(run)
    yield ""
    yield "<details><summary>Every point</summary>"
    yield ""
    yield HEAD
    yield "|---" * 8 + "|"
    for run in content["runs"]:
        yield f"| **{run['witness']}: {run['name']}** |" + " |" * 7
        yield from (line(row, row["point"]) for row in run["rows"])
    yield ""
    yield "</details>"


def main() -> int:
    """Replace what stands between the marks of the page."""
    if not ROWS_FILE.exists():
        print(f"{ROWS_FILE} is not there: run pytest -m witness first", file=sys.stderr)
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
