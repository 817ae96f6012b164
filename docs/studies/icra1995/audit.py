"""The audit: every number and equation of the paper that can be checked, as a page.

`audit()` computes all findings; `page()` writes them as Markdown. Only the scan of Figs. 6, 8 and 9
is read from a table, which `run_scan()` makes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec

from dualbend.errors import writing
from icra1995 import findings_beam as beam
from icra1995 import findings_filter as filters
from icra1995 import findings_scan as figures
from icra1995 import findings_stability as stability
from icra1995.confirm import select, simulate
from icra1995.row import EXACT, PAPER, VERDICTS, Finding, Printed, rounding
from icra1995.scan import CLEARLY, HALF, ScanRow, scan
from icra1995.table import TABLE, Table, read_table, stamp, to_csv


class Section(msgspec.Struct, frozen=True, kw_only=True):
    """Findings that belong together."""

    title: str
    findings: tuple[Finding, ...]


class Audit(msgspec.Struct, frozen=True, kw_only=True):
    """The audit of a set of printed numbers, and when the scan's table was made."""

    printed: Printed
    scanned: str
    sections: tuple[Section, ...]

    def findings(self) -> list[Finding]:
        """Return all findings, in the page's order."""
        return [finding for section in self.sections for finding in section.findings]


def audit(printed: Printed = PAPER, table: Table | None = None) -> Audit:
    """Compute all findings; the scan's come from a table, the committed one by default.

    Raises InputError where there is no table.
    """
    scanned = read_table() if table is None else table
    parts: dict[str, list[Finding]] = {
        "The bent sheet: (1)-(6)": beam.closed_form(printed),
        "Linear pieces and the loads they make": beam.pieces(printed) + beam.loads(printed),
        "The discrete admittance: (7)-(15), (26), (27)": filters.admittance(printed)
        + filters.gains(printed),
        "Clock, robot, low-pass filter": filters.clock(printed) + filters.low_pass(printed),
        "The loop and Routh's condition: (16)-(25)": stability.algebra(printed)
        + stability.limits(printed),
        "What (23) leaves out": stability.delay(printed),
        "The figures": figures.figures(scanned),
    }
    return Audit(
        printed=printed,
        scanned=scanned.made,
        sections=tuple(
            Section(title=title, findings=tuple(found)) for title, found in parts.items()
        ),
    )


def run_scan(path: Path = TABLE, on_row: Callable[[ScanRow], None] | None = None) -> Table:
    """Scan all readings, run the chosen ones in full, write the table and return it.

    Takes ten minutes. Raises InputError where the table cannot be written.
    """
    made = stamp()
    with writing(path):  # known before the minutes are spent, not after
        path.open("a", encoding="utf-8").close()
    rows = scan(on_row=on_row)
    simulated = {reading: simulate(reading) for reading in select(rows)}
    path.write_text(to_csv(rows, simulated, made), encoding="utf-8")
    return read_table(path)


def page(found: Audit, table: Table | None = None) -> str:
    """Return the audit as Markdown."""
    scanned = read_table() if table is None else table
    parts = [_head(found)]
    number = 0
    calls: list[str] = []
    for section in found.sections:
        lines = [
            f"## {section.title}\n",
            "| # | where | the paper | found | verdict | so |",
            "|---|---|---|---|---|---|",
        ]
        for f in section.findings:
            number += 1
            under = f", if: {f.assumption}" if f.assumption else ""
            lines.append(
                f"| {number} | {f.where} | {f.claim} | {f.found} | **{f.verdict}**{under} | "
                f"{f.conclusion} |"
            )
            calls.append(f"{number}. `{f.call}` gives {_shown(f.number)}")
        parts.append("\n".join(lines))
    parts += [_scan_text(scanned), figures.tables(scanned), _calls_text() + "\n".join(calls)]
    return "\n\n".join(parts) + "\n"


def _shown(number: float) -> str:
    return rounding(number) if abs(number) < EXACT and number else f"{number:.6g}"


def _head(found: Audit) -> str:
    verdicts = [f.verdict for f in found.findings()]
    counts = ", ".join(f"{verdicts.count(v)} {v}" for v in VERDICTS)
    return f"""# Audit of the paper

Made by `python docs/studies/icra1995`; do not edit. Every equation and number of *Trajectory
Planning for Two Manipulators to Deform Flexible Materials Using Compliant Motion* (ICRA 1995) that
can be checked without the authors' hardware: {len(verdicts)} statements, {counts}.

* **confirmed**: holds as printed.
* **confirmed under an assumption**: holds, if what is named is granted; the paper does not say it.
* **not reproducible**: does not follow from the paper's own numbers, or is contradicted by theory.
* **misprint**: as printed it contradicts a neighbouring equation that is right.

Equation numbers are the paper's. All numbers but the scan's are computed when the page is made, by
the calls listed at its end. The curves of Figs. 6, 8 and 9 carry no scale in the text that was
available, so their shapes are compared and not their values."""


def _scan_text(table: Table) -> str:
    return f"""## How the figures were scanned

Table `docs/studies/icra1995/scan.csv`, made {table.made}
(`python docs/studies/icra1995 --scan` makes it again). The paper leaves open the sheet, the form
and units of the filter, from where the compliance acts, the robot, the delay and the low-pass
filter. Each of {len(table.rows)} combinations was evaluated by the state of rest of sheet, arms and
filter (rod with weight) at three angles in each piece, and by the eigenvalues of the sampled
28 ms loop at seven or eight angles.
One arm senses and complies.

* Fig. 6: the first peak is readable, and the exact path's largest moment is below {HALF:g} of it.
* Fig. 8: stable; no acting piece's peak is raised; their mean ratio is below {CLEARLY:g}.
* Fig. 9: stable, and B times 0.5, 0.25, 0.1, 0.05 or 0.02 is unstable.

Below: how many of a reading's loops show each figure (readings without Fig. 8 are left out), what
the loop's own choices do, and what full simulations say. The cheap model has no lag behind the
knots and no noise: it flatters Fig. 8, most where the rotation alone does the work,
and in rotation it also calls loops stable that are not. Trust the last table."""


def _calls_text() -> str:
    return """## The calls

In `docs/studies`, after `from icra1995 import beam, filter, findings_scan, stability` and
`from dualbend.stability import continuous`:

"""
