"""Judge the measured growth rate by many synthetic moments: ``tests/lanes/oscillations.py``.

Right: within 10 % or 0.2 1/s; of a moment without oscillation: none. Exit code 1 for a wrong one.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.evaluation.oscillation import Oscillation, oscillation_of
from dualbend.table import Table
from support.synthetic_moments import KINDS, Synthetic, draw, right

ANSWERS = ("right", "null", "wrong")


def main() -> int:
    """Draw, judge, print the counts by kind; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in (*KINDS, "all")}
    for number in range(asked.count):
        case = draw(rng)
        found = oscillation_of(case.moment, COMMAND_PERIOD_S)
        said = verdict(case, found)
        for kind in (case.kind, "all"):
            counts[kind].update([said, *([f"clear {said}"] if case.clear else [])])
        if said == "wrong":
            print(
                f"{number}, {case.kind}: {case.rate_per_s} 1/s at {case.frequency_hz:.2f} Hz,",
                end=" ",
            )
            print(f"said {found.growth_per_s:.2f} 1/s at {found.frequency_hz:.2f} Hz")
    print(table(counts).text())
    return 1 if counts["all"]["wrong"] else 0


def verdict(case: Synthetic, found: Oscillation) -> str:
    """Return what an answer is: ``right``, ``null`` or ``wrong``."""
    if case.rate_per_s is None and found.growth_per_s is None:
        return "right"
    return {True: "right", None: "null", False: "wrong"}[right(found.growth_per_s, case)]


def table(counts: dict[str, Counter[str]]) -> Table:
    """Return the counts by kind; the last column is of those that a method should tell."""
    rows = []
    for kind, of_kind in counts.items():
        clear = [of_kind[f"clear {answer}"] for answer in ANSWERS]
        share = f"{clear[0]} of {sum(clear)}" if sum(clear) else "-"
        rows.append((kind, *(of_kind[answer] for answer in ANSWERS), share))
    return Table(("kind", *ANSWERS, "right of the clear ones"), rows)


if __name__ == "__main__":
    sys.exit(main())
