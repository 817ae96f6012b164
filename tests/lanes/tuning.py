"""Whether what ``dualbend tune`` says is true: 5 arms, 3 sheets, plain and modelled compliance.

``python tests/lanes/tuning.py`` tunes all 30 cases (half a minute of processor time each) and
simulates no compliance, the scenario's own and the result again, with seeds that tuning has not
seen. A run that stops has an infinite moment. Two criteria are printed for each case:

* strict: with every fresh seed the result has neither a larger rms nor a larger peak of the moment
  than the other two;
* true, which decides: the same, but a controller of which any run stops, of tuning's or of the
  fresh ones, is unsafe. It must not be the result, and the result need not surpass it.

Words choose cases (``ur5 FR-4 plain``), ``--workers`` says how many processes. The exit code is 1
where a statement is not true.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.tuning.search import Margin, simulate, with_compliance
from dualbend.study.tuning.tuning import Outcome, Tuning, tune
from dualbend.table import Columns, Table, quantity

ARMS = ("puma560", "ur5", "ur10", "panda", "xarm7")
SHEETS = {
    "aluminium": (),
    "FR-4": (400, 150, 0.3),
    "6061-T6": (300, 60, 0.6),
}
"""Length, width, thickness [mm]; the first one is the strip of both, 400 x 57 x 0.5 mm."""
STRIP = Path(__file__).parents[2] / "docs" / "studies" / "icra1995" / "strip-fig8.toml"
FORMS = {"plain": str(STRIP), "modelled": "tuned"}
REQUIRED = Margin(gain_db=6.0, phase_deg=30.0)
FRESH_SEEDS = (101, 102)
_ROUNDING = 1e-9

Case = tuple[str, str, str]


def settings(arm: str, sheet: str) -> list[str]:
    """Return what differs from the shipped scenario."""
    found = [f"robot.model={arm}"]
    if SHEETS[sheet]:
        sizes = zip(("length_m", "width_m", "thickness_m"), SHEETS[sheet], strict=True)
        found += [f"sheet.{key}={size / 1e3}" for key, size in sizes]
        found += [f"sheet.material={sheet}"]
    return found


class Judged(NamedTuple):
    """Both criteria, and the rms of the result over that of no compliance, with fresh seeds."""

    true: bool
    strict: bool
    rms_ratio: float


def fresh(found: Tuning, one: Outcome) -> list[tuple[Scenario, int]]:
    """Return a controller's runs with the fresh seeds."""
    return [(with_compliance(found.scenario, one.compliance), seed) for seed in FRESH_SEEDS]


def judged(found: Tuning) -> Judged:
    """Return whether the result is nowhere worse than the others, with the fresh seeds."""
    each = {one.name: one for one in (*found.outcomes[:-1], found.chosen)}
    again = {
        name: np.array([moments for moments, _ in simulate(fresh(found, one))])
        for name, one in each.items()
    }
    result, none = again[found.chosen.name], again["none"]
    safe = {name: not one.stops and np.isfinite(again[name]).all() for name, one in each.items()}
    bears = {name: (result <= old * (1.0 + _ROUNDING)).all() for name, old in again.items()}
    return Judged(
        true=bool(safe[found.chosen.name] and all(bears[name] for name in again if safe[name])),
        strict=bool(all(bears.values())),
        rms_ratio=float(result[:, 0].mean() / none[:, 0].mean()),
    )


def measure(case: Case) -> tuple[object, ...]:
    """Tune one case and return its row."""
    arm, sheet, form = case
    began = time.process_time()
    found = tune(load_scenario(FORMS[form], settings(arm, sheet)), required=REQUIRED)
    spent, verdict = time.process_time() - began, judged(found)
    none, *_ = found.outcomes
    rows = {each.name: each for each in found.outcomes}

    def ratios(each: Outcome) -> str:
        if each.stops:
            return f"{len(each.stops)} of {len(each.moments)} stop: {each.stops[0]}"
        return f"{each.rms_nm / none.rms_nm:.3f} {each.peak_nm / none.peak_nm:.3f}"

    def margins(each: Outcome) -> str:
        return f"{each.margin.gain_db:.1f} dB {each.margin.phase_deg:.0f}°"

    return (
        *(arm, sheet, form, found.chosen.name),
        *(1e3 * none.rms_nm, 1e3 * none.peak_nm),
        *(ratios(rows["own"]), ratios(rows["tuned"])),
        *(margins(rows["own"]), margins(rows["tuned"])),
        *(verdict.rms_ratio, verdict.strict, verdict.true),
        *(found.verdict, "; ".join(found.limits), spent),
    )


def cases(words: list[str]) -> Iterator[Case]:
    """Yield the cases that have all words, those of one sheet after the other."""
    for sheet in SHEETS:
        for form in FORMS:
            for arm in ARMS:
                if set(words) <= {arm, sheet, form}:
                    yield arm, sheet, form


def main() -> int:
    """Tune, print a row as each case ends and the table at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    columns: Columns = [
        *("arm", "sheet", "compliance", "result"),
        *(quantity("rms without", "mN m"), quantity("peak without", "mN m")),
        *("own: rms, peak over without", "tuned: the same"),
        *("own: margins", "tuned: margins", quantity("rms over without, fresh", spec=".3f")),
        *("strict", "true", "verdict", "what limits", quantity("CPU", "s", ".0f")),
    ]
    rows = []
    with ProcessPoolExecutor(given.workers) as pool:
        for row in pool.map(measure, cases(given.words)):
            print(*row, sep=" | ", file=sys.stderr, flush=True)
            rows.append(row)
    print(Table(columns, rows).markdown())
    better, strict, true = (
        sum(row[at] == value for row in rows)
        for at, value in ((3, "tuned"), (11, True), (12, True))
    )
    print(f"\n{len(rows)} cases: {better} with better gains, {true} true ({strict} strictly)")
    return 0 if true == len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
