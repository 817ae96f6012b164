"""Rows of the witnesses' table, and the file in which they wait to be written down."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

ROOT = Path(__file__).parents[2]
ROWS_FILE = ROOT / "runs" / "witnesses.json"

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity: this project, theory, witness, and what the difference is a part of.

    ``difference`` is witness less project, ``from_theory`` witness less theory, both over
    ``scale``: |theory| unless the row's name says otherwise. None where there is no such number.
    """

    witness: str
    quantity: str
    unit: str
    project: float | None
    theory: float | None
    found: float
    difference: float | None
    from_theory: float | None


@dataclass(kw_only=True)
class Report:
    """What one session of witnesses found: rows, the seconds that each part took, remarks."""

    rows: list[Row] = field(default_factory=list)
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)

    def row(
        self,
        witness: str,
        quantity: str,
        unit: str,
        *,
        found: float,
        project: float | None = None,
        theory: float | None = None,
        scale: float | None = None,
    ) -> Row:
        """Add a row."""
        reference = theory if theory is not None else project
        size = scale if scale is not None else abs(reference or 0.0)

        def part(other: float | None) -> float | None:
            return None if other is None or not size else (float(found) - float(other)) / size

        made = Row(
            witness=witness,
            quantity=quantity,
            unit=unit,
            project=None if project is None else float(project),
            theory=None if theory is None else float(theory),
            found=float(found),
            difference=part(project),
            from_theory=part(theory),
        )
        self.rows.append(made)
        return made

    def timed(self, witness: str, who: str, work: Callable[[], T]) -> T:
        """Do some work and add the seconds that it took to the account of ``who``."""
        begin = time.perf_counter()
        try:
            return work()
        finally:
            account = self.seconds.setdefault(witness, {})
            account[who] = account.get(who, 0.0) + time.perf_counter() - begin

    def save(self, path: Path = ROWS_FILE) -> None:
        """Write the rows; those of witnesses that this session did not call stay."""
        called = {row.witness for row in self.rows}
        old: dict[str, Any] = {"rows": [], "seconds": {}, "versions": {}}
        if path.exists():
            old = json.loads(path.read_text(encoding="utf-8"))
        kept = [row for row in old["rows"] if row["witness"] not in called]
        content = {
            "rows": kept + [asdict(row) for row in self.rows],
            "seconds": {**old["seconds"], **self.seconds},
            "versions": {**old["versions"], **self.versions},
        }
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def worst(parts: Iterable[float | None]) -> float:
    """Return the largest magnitude."""
    return max(abs(part) for part in parts if part is not None)
