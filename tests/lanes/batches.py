"""Random bending runs in batches against the same runs alone: ``python tests/lanes/batches.py``.

Every run has its own scenario, seed, sheet, gains, delay and speed; twenty at a time have one arm,
all imperfections, none or one each, so that most are in batches. All columns of a trace but that of
the clock on the wall are compared, bit for bit, and the end. Says how many are the same and how
many were in a batch; exit code 1 where one is not the same. Parts have seeds of their own.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from dualbend.batch.group import grouped
from dualbend.batch.many import run_many
from dualbend.errors import InputError
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario, variants

SCENARIOS = ("fig6", "fig8", "fig9", "exact", "tuned", "tuned-exact")
ERRORS = ("none", "typical", "one each")
ARMS = ("puma560", "puma560", "ur5", "ur10")
AT_ONCE = 20


def drawn(rng: np.random.Generator, errors: str, arm: str) -> Scenario:
    """Return a scenario with a preset of imperfections, or one of them, and an arm."""
    name = str(rng.choice(SCENARIOS))
    settings = [
        f"imperfections={'none' if errors == 'one each' else errors}",
        f"sheet.thickness_m={0.0008 * rng.uniform(0.8, 1.2):.7f}",
        f"sheet.length_m={0.8 * rng.uniform(0.9, 1.1):.6f}",
        f"motion.speed_rad_per_s={rng.uniform(0.3, 0.8):.4f}",
        f"robot.alter.delay_cycles={rng.integers(0, 4)}",
        f"robot.model={arm}",
        "motion.hold_s=0.2",
    ]
    if name in ("fig8", "fig9"):
        settings.append(f"compliance.rotation.b={rng.uniform(0.1, 1.0):.5f}")
    scenario = load_scenario(name, settings, seed=int(rng.integers(2**31)))
    if errors == "one each":
        every = list(variants(scenario, "worst").values())
        return every[rng.integers(len(every))]
    return scenario


def made(scenario: Scenario) -> Run | None:
    """Return the run, None of one that is refused."""
    try:
        return make_run(scenario)
    except InputError:
        return None


def same(found: RunRecord, alone: RunRecord) -> bool:
    """Compare ends and traces."""
    names = [name for name, _ in alone.trace.columns if name not in WALL_CLOCK_COLUMNS]
    return (found.outcome, found.reason, found.trace.columns) == (
        alone.outcome,
        alone.reason,
        alone.trace.columns,
    ) and all(np.array_equal(found.trace[n], alone.trace[n], equal_nan=True) for n in names)


def main() -> int:
    """Compare so many runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    equal = together = 0
    other: list[str] = []
    ends: dict[str, int] = {}
    done = 0
    while done < arguments.count:
        cases = []
        errors, arm = str(rng.choice(ERRORS)), str(rng.choice(ARMS))
        while len(cases) < min(AT_ONCE, arguments.count - done):
            scenario = drawn(rng, errors, arm)
            run = made(scenario)
            if run is not None:
                cases.append((scenario, run))
        runs = [run for _, run in cases]
        together += sum(len(group) for group in grouped(runs, AT_ONCE) if len(group) > 1)
        records = dict(run_many(runs))
        for i, (scenario, _) in enumerate(cases):
            alone = made(scenario)
            assert alone is not None
            record = alone.run()
            ends[record.outcome] = ends.get(record.outcome, 0) + 1
            if same(records[i], record):
                equal += 1
            else:
                other.append(scenario.to_toml())
        done += len(cases)
        print(f"{equal} of {done} the same, {together} of them in a batch; {ends}", flush=True)
    for line in other:
        print(f"other:\n{line}")
    return bool(other)


if __name__ == "__main__":
    sys.exit(main())
