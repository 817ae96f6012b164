"""What the scan says of Figs. 6, 8 and 9: findings and the tables of the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from icra1995.reading import (
    ANGLES,
    DELAYS,
    FILTERS,
    FORMS,
    LENGTHS,
    ROBOTS,
    SHEETS,
    STARTS_RAD,
    Reading,
)
from icra1995.row import Called, Finding, either, finding
from icra1995.scan import CLEARLY, HALF, READABLE_NM, ScanRow
from icra1995.table import Simulated, Table, read_table

Figure = str
_ASK: dict[Figure, Callable[[ScanRow], bool]] = {
    "fig6": lambda row: row.fig6,
    "fig8": lambda row: row.fig8,
    "fig9": lambda row: row.fig9,
    "together": lambda row: row.together,
}


def count(figure: Figure, **wanted: object) -> int:
    """Count readings of the committed table that show a figure (``fig6`` … ``together``)."""
    return counted(read_table().rows, figure, **wanted)


def counted(rows: Sequence[ScanRow], figure: Figure, **wanted: object) -> int:
    """Count readings that show a figure and have the wanted keys, e.g. ``form="printed"``."""
    return sum(
        all(getattr(row.reading, k) == v for k, v in wanted.items()) and _ASK[figure](row)
        for row in rows
    )


def simulated_together(ran: Simulated, clearly: float = CLEARLY) -> bool:
    """Say whether full simulations show all three figures, by the scan's own thresholds."""
    return (
        ran.peak_nm > READABLE_NM
        and ran.exact_ratio < HALF
        and ran.ended == "completed"
        and ran.worst_ratio < 1.0
        and ran.mean_ratio < clearly
        and ran.b_factor > 0.0
    )


def survivors(table: Table, clearly: float = CLEARLY) -> list[Reading]:
    """Return the readings that full simulations confirm."""
    return [r for r, ran in table.simulated.items() if simulated_together(ran, clearly)]


def _next_best(table: Table) -> str:
    """Return what would be let through if any lower moment were enough for Fig. 8."""
    others = [r for r in survivors(table, 1.0) if r not in survivors(table)]
    if not others:
        return "No other one that ran in full lowers the moment in every piece and oscillates."
    best = min(others, key=lambda r: table.simulated[r].mean_ratio)
    return (
        f"Were any reduction enough for Fig. 8, {name(best)} would do too (mean ratio "
        f"{table.simulated[best].mean_ratio:.2f})."
    )


def name(reading: Reading) -> str:
    """Return a reading without what only its loop has."""
    return (
        f"{reading.sheet} mm, {reading.form}, {reading.length} and {reading.angle}, "
        f"from {reading.start_rad:g} rad"
    )


def figures(table: Table) -> list[Finding]:
    """Return the findings on the three figures."""
    rows, total = table.rows, len(table.rows)
    confirmed = survivors(table)
    shown = "; ".join(name(reading) for reading in confirmed)
    return [
        _counted(rows, "Fig. 6", "fig6", "peaks between the knots that the exact path lacks"),
        _counted(rows, "Fig. 8", "fig8", "the published gains clearly reduce the moment"),
        _counted(rows, "Fig. 9", "fig9", "a smaller B makes the loop oscillate"),
        finding(
            "Figs. 6, 8, 9",
            "one experiment shows all three",
            Called("findings_scan.count('together')", float(counted(rows, "together"))),
            f"{{:.0f}} of {total} readings by the cheap model; of {len(table.simulated)} run in "
            f"full {len(confirmed)} hold",
            either(
                bool(confirmed),
                (
                    "confirmed under an assumption",
                    "The three figures are compatible. That the authors' system was this reading "
                    "does not follow: the sheet, the delay and the filter are not in the paper. "
                    + _next_best(table),
                ),
                ("not reproducible", "No simulated reading shows the three figures together."),
            ),
            shown,
        ),
    ]


def _counted(rows: Sequence[ScanRow], where: str, figure: Figure, claim: str) -> Finding:
    number = counted(rows, figure)
    out = excluded(rows, figure)
    return finding(
        where,
        claim,
        Called(f"findings_scan.count({figure!r})", float(number)),
        f"{{:.0f}} of {len(rows)} readings by the cheap model; by form: "
        + ", ".join(f"{form} {counted(rows, figure, form=form)}" for form in FORMS),
        either(
            number > 0,
            (
                "confirmed under an assumption",
                f"Never with: {', '.join(out)}." if out else "No single choice rules it out.",
            ),
            ("not reproducible", "No reading of the scan shows it."),
        ),
        "one of the readings below",
    )


def excluded(rows: Sequence[ScanRow], figure: Figure) -> list[str]:
    """Return the single choices with which no reading shows a figure."""
    keys: dict[str, tuple[str, Sequence[object]]] = {
        "sheet": ("sheet", list(SHEETS)),
        "form": ("form", FORMS),
        "length": ("length in", LENGTHS),
        "angle": ("angle in", ANGLES),
        "start_rad": ("start at", STARTS_RAD),
        "robot": ("robot", list(ROBOTS)),
        "delay": ("delay", DELAYS),
        "low_pass": ("filter", list(FILTERS)),
    }
    return [
        f"{title} {value}"
        for key, (title, values) in keys.items()
        for value in values
        if not counted(rows, figure, **{key: value})
    ]


def tables(table: Table) -> str:
    """Return the tables of the scan as Markdown."""
    return "\n\n".join([_by_reading(table), _by_loop(table), _in_full(table)])


def _by_reading(table: Table) -> str:
    """Return how many loops of each reading show the figures, for readings that show Fig. 8."""
    loops = len(ROBOTS) * len(DELAYS) * len(FILTERS)
    lines = [
        f"| sheet [mm], form, units, start | Fig. 6 | Fig. 8 | Fig. 9 | all three, of {loops} |",
        "|---|---|---|---|---|",
    ]
    groups: dict[str, list[ScanRow]] = {}
    for row in table.rows:
        groups.setdefault(name(row.reading), []).append(row)
    for title, rows in groups.items():
        found = [counted(rows, figure) for figure in _ASK]
        if counted(rows, "fig8"):
            lines.append(f"| {title} | " + " | ".join(str(n) for n in found) + " |")
    return "\n".join(lines)


def _by_loop(table: Table) -> str:
    """Return how many readings show all three figures, by robot, delay, filter and threshold."""
    lines = ["| choice in the loop | readings with all three figures |", "|---|---|"]
    choices: list[tuple[str, str, Sequence[object]]] = [
        ("robot", "robot", list(ROBOTS)),
        ("delay, cycles", "delay", DELAYS),
        ("filter", "low_pass", list(FILTERS)),
    ]
    for title, key, values in choices:
        found = (f"{v}: {counted(table.rows, 'together', **{key: v})}" for v in values)
        lines.append(f"| {title} | {', '.join(found)} |")
    bounds = (
        f"{b:g}: {sum(_shows(row, b) for row in table.rows)} ({len(survivors(table, b))})"
        for b in (0.6, 0.7, CLEARLY, 0.9, 1.0)
    )
    lines.append(f"| bound on Fig. 8's mean ratio (in full) | {', '.join(bounds)} |")
    return "\n".join(lines)


def _shows(row: ScanRow, clearly: float) -> bool:
    return row.fig6 and row.fig9 and row.worst_ratio < 1.0 and row.mean_ratio < clearly


def _in_full(table: Table) -> str:
    """Return what full simulations say beside the cheap model."""
    by = {row.reading: row for row in table.rows}
    lines = [
        "| reading, run in full | exact / linear | Fig. 8 / Fig. 6 worst, mean (cheap model) | "
        "oscillates from B × (cheap model) | all three |",
        "|---|---|---|---|---|",
    ]
    for reading, ran in table.simulated.items():
        cheap = by[reading]
        held = simulated_together(ran)
        ended = "" if ran.ended == "completed" else f", {ran.ended}"
        lines.append(
            f"| {name(reading)} | {ran.exact_ratio:.2f} ({cheap.exact_ratio:.2f}) | "
            f"{ran.worst_ratio:.2f}, {ran.mean_ratio:.2f}{ended} "
            f"({cheap.worst_ratio:.2f}, {cheap.mean_ratio:.2f}) | "
            f"{_factor(ran.b_factor)} ({_factor(cheap.b_factor)}) | "
            f"{'**yes**' if held else 'no'} |"
        )
    return "\n".join(lines)


def _factor(value: float) -> str:
    return f"{value:g}" if value else "none"
