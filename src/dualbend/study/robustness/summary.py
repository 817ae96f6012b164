"""What a Monte Carlo study says: success rates with intervals, failures, forces, and the pairs."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from scipy.stats import binomtest

from dualbend.evaluation.metrics import versions
from dualbend.scenario.scenario import Scenario
from dualbend.study.robustness.run import SCENARIO
from dualbend.study.robustness.trial import Trial, settings
from dualbend.table import Columns, Table, quantity
from dualbend.task.assembly.config import assembly_of

CONFIDENCE = 0.95
NAMES = {True: "with", False: "without"}

RATIO_COMPARED = (
    "peak pin force with compliance over that without, of draws where both runs completed "
    "and touched a pin"
)


def success_interval(successes: int, n: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a success rate (Clopper and Pearson, Biometrika 26, 1934).

    It covers the true rate at least that often, whatever n. (0, 1) for n = 0.
    """
    if n == 0:
        return 0.0, 1.0
    found = binomtest(successes, n).proportion_ci(CONFIDENCE, method="exact")
    return float(found.low), float(found.high)


def summarise(
    scenario: Scenario, seed: int, trials: Sequence[Trial], folder: Path
) -> dict[str, Any]:
    """Return what ``summary.json`` holds; forces in N.

    The ratio is that of easy draws: where arms without compliance fail, nothing is compared. A
    run that fails stops early, so that its peak is of what came before, and one that fails by the
    force on a pin is stopped a little above the limit.
    """
    config = assembly_of(scenario)
    by_case = {
        name: [t for t in trials if t.compliance == case]
        for case, name in NAMES.items()
        if any(t.compliance == case for t in trials)
    }
    return {
        "scenario": scenario.name,
        "seed": seed,
        "draws": len({t.index for t in trials}),
        "confidence": CONFIDENCE,
        "spread": msgspec.to_builtins(config.spread),
        "pin_force_limit_n": config.limits.pin_force_n,
        "versions": versions(),
        "compliance": {name: _case(of, folder) for name, of in by_case.items()},
        "pairs": _pairs(trials) if len(by_case) > 1 else None,
    }


def _case(trials: Sequence[Trial], folder: Path) -> dict[str, Any]:
    n, k = len(trials), sum(t.success for t in trials)
    failed = [t for t in trials if not t.success]
    classes = Counter((t.phase, t.cause) for t in failed)
    return {
        "n": n,
        "successes": k,
        "rate": k / n,
        "interval": success_interval(k, n),
        "failures": [
            {"phase": phase, "cause": cause, "count": count}
            for (phase, cause), count in classes.most_common()
        ],
        "failed": [
            {"index": t.index, "reason": t.reason or t.cause, "command": command(t, folder)}
            for t in failed
        ],
        "peak_pin_force_n": {
            "all": _distribution([t.peak_pin_force_n for t in trials]),
            "completed": _distribution(
                [t.peak_pin_force_n for t in trials if t.outcome == "completed"]
            ),
        },
    }


def _distribution(values: Sequence[float | None]) -> dict[str, float | None]:
    known = [value for value in values if value is not None]
    if not known:
        return {"n": 0, "median": None, "percentile_95": None, "max": None}
    median, high = np.percentile(known, [50.0, 95.0]).tolist()
    return {"n": len(known), "median": median, "percentile_95": high, "max": max(known)}


def _pairs(trials: Sequence[Trial]) -> dict[str, Any]:
    """Compare the two runs of each draw; the test is the exact one of McNemar."""
    found = {(t.index, t.compliance): t for t in trials}
    both = [(t, found[t.index, False]) for t in trials if t.compliance]
    counts = Counter((a.success, b.success) for a, b in both)
    only_with, only_without = counts[True, False], counts[False, True]
    ratios = [
        a.peak_pin_force_n / b.peak_pin_force_n
        for a, b in both
        if a.outcome == b.outcome == "completed" and a.peak_pin_force_n and b.peak_pin_force_n
    ]
    differing = only_with + only_without
    return {
        "n": len(both),
        "both_succeed": counts[True, True],
        "only_with": only_with,
        "only_without": only_without,
        "neither": counts[False, False],
        "p_value": float(binomtest(only_with, differing).pvalue) if differing else 1.0,
        "pin_force_ratio": {"compared": RATIO_COMPARED, **_distribution(ratios)},
    }


def command(trial: Trial, folder: Path) -> str:
    """Return the command that makes a trial's run again."""
    words = ["dualbend", "run", (folder / SCENARIO).as_posix(), "--seed", str(trial.seed)]
    for key, value in settings(trial).items():
        words += ["--set", f"{key}={value}"]
    return shlex.join(words)


def table(summary: dict[str, Any]) -> list[str]:
    """Return the summary as lines of text."""
    lines = [
        f"{summary['scenario']}: {summary['draws']} draws, seed {summary['seed']}",
        _rates(summary).text(),
    ]
    for name, case in summary["compliance"].items():
        for row in case["failures"]:
            lines.append(f"failed {name}: {row['count']:>4}  {row['phase']}: {row['cause']}")
    pairs = summary["pairs"]
    if pairs:
        lines.append(
            f"the same draw: {pairs['both_succeed']} succeed both with and without, "
            f"{pairs['only_with']} only with, {pairs['only_without']} only without, "
            f"{pairs['neither']} neither (McNemar, exact: p = {pairs['p_value']:.2g})"
        )
        ratio = pairs["pin_force_ratio"]
        if ratio["n"]:
            lines.append(
                f"{ratio['compared']}: median {ratio['median']:.2f}, {ratio['n']:.0f} draws"
            )
    return lines


def _rates(summary: dict[str, Any]) -> Table:
    columns: Columns = (
        *("compliance", quantity("success"), quantity("rate")),
        quantity(f"{100 * summary['confidence']:g} % interval"),
        *(quantity(name, "N", ".1f") for name in ("peak pin force: median", "95th", "max")),
    )
    rows = []
    for name, case in summary["compliance"].items():
        low, high = case["interval"]
        force = case["peak_pin_force_n"]["all"]
        rate = (f"{case['successes']}/{case['n']}", f"{100 * case['rate']:.1f} %")
        interval = f"{100 * low:.1f} ..{100 * high:5.1f}"
        forces = (force[key] for key in ("median", "percentile_95", "max"))
        rows.append((name, *rate, interval, *forces))
    return Table(columns, rows)
