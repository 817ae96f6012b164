"""Rows of the table of cross-checks, and the file in which they wait to be written down."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

ROOT = Path(__file__).parents[2]
ROWS_FILE = ROOT / "runs" / "cross-checks.json"

T = TypeVar("T")


def _processor_time() -> float:
    """Return the seconds of this process and of its finished children: others do not disturb."""
    return sum(os.times()[:4])


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity at one point: this project, theory and cross-check, all in ``unit``.

    ``difference`` is the cross-check less the project, ``from_theory`` less the theory, both over
    |theory| (|project| where there is none) unless ``scale`` [unit] was given. None: no number.
    ``asked``: what was asked for of both, None where nothing was.
    """

    code: str
    run: str
    quantity: str
    point: str
    unit: str
    project: float | None
    theory: float | None
    found: float
    difference: float | None
    from_theory: float | None
    asked: float | None

    def within(self, tolerance: float) -> bool:
        """Say whether the cross-check differs from project and theory by less than a part."""
        parts = [p for p in (self.difference, self.from_theory) if p is not None]
        # A NaN is not within anything.
        return bool(parts) and all(abs(part) < tolerance for part in parts)


@dataclass(kw_only=True)
class Run:
    """One calculation by another code, with its rows and the seconds that each part took."""

    code: str
    name: str
    rows: list[Row] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    def row(
        self,
        quantity: str,
        point: str,
        unit: str,
        *,
        found: float,
        project: float | None = None,
        theory: float | None = None,
        scale: float | None = None,
        asked: float | None = None,
    ) -> Row:
        """Add a row."""
        reference = theory if theory is not None else project
        size = scale if scale is not None else abs(reference or 0.0)

        def part(other: float | None) -> float | None:
            return None if other is None or not size else (float(found) - float(other)) / size

        made = Row(
            code=self.code,
            run=self.name,
            quantity=quantity,
            point=point,
            unit=unit,
            project=None if project is None else float(project),
            theory=None if theory is None else float(theory),
            found=float(found),
            difference=part(project),
            from_theory=part(theory),
            asked=asked,
        )
        self.rows.append(made)
        return made

    def timed(self, who: str, work: Callable[[], T]) -> T:
        """Do some work and add its seconds of processor time to the account of ``who``."""
        begin = _processor_time()
        try:
            return work()
        finally:
            self.seconds[who] = self.seconds.get(who, 0.0) + _processor_time() - begin


@dataclass(kw_only=True)
class Report:
    """What one session of cross-checks found."""

    runs: list[Run] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)

    def run(self, code: str, name: str) -> Run:
        """Begin a calculation."""
        made = Run(code=code, name=name)
        self.runs.append(made)
        return made

    def save(self, path: Path = ROWS_FILE) -> None:
        """Write the runs; those of codes that this session did not call stay."""
        called = {run.code for run in self.runs}
        old: dict[str, Any] = {}
        if path.exists():
            old = json.loads(path.read_text(encoding="utf-8"))
        content = {
            "machine": f"Python {platform.python_version()}, {platform.machine()}",
            "versions": {**old.get("versions", {}), **self.versions},
            "runs": [run for run in old.get("runs", []) if run["code"] not in called]
            + [asdict(run) for run in self.runs],
        }
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
