"""Whole closed loops on a device against the same with MuJoCo: how they end, their peak moments.

``python tests/lanes/device.py fig8 fig9 --device cpu``, without names all shipped bending scenarios
(needs the extra ``gpu``). What ends early on the device is run again with MuJoCo; 7-joint arms
are, too, from the beginning.
"""

import argparse

import numpy as np

from dualbend.batch.gpu.benchmark import FLAT_RAD
from dualbend.batch.group import alone
from dualbend.batch.many import run_many
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.task.bending.config import BendingConfig
from dualbend.types import SIDES


def runs_of(name: str, settings: list[str], seeds: int) -> list[Run]:
    """Return runs of a scenario with so many seeds."""
    return [make_run(load_scenario(name, settings, seed)) for seed in range(1, seeds + 1)]


def peak(record: RunRecord, after_rad: float) -> float:
    """Return the largest true moment at the sensors [N m] beyond an end slope."""
    bent = record.trace["nominal_alpha"] > after_rad
    return max(np.abs(record.trace[f"{side}_true_moment_y"][bent]).max() for side in SIDES)


def main() -> None:
    """Print a row for each scenario that a device can run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenarios", nargs="*", default=list(list_scenarios()))
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args()
    print(f"{'largest deviation of the peak moment':>56}, bent beyond {FLAT_RAD} rad and all of it")
    for name in given.scenarios:
        if not isinstance(load_scenario(name).task, BendingConfig):
            continue
        runs = runs_of(name, given.settings, given.seeds)
        if alone(runs[0]):
            continue
        there = dict(run_many(runs, batch=given.seeds, device=given.device))
        here = dict(run_many(runs_of(name, given.settings, given.seeds)))
        told, outcomes = "", set()
        for after in (FLAT_RAD, -1.0):
            peaks = []
            for i, one in here.items():
                other = there[i]
                assert isinstance(one, RunRecord), one
                assert isinstance(other, RunRecord), other
                outcomes.add(f"{one.outcome}={other.outcome}")
                peaks.append((peak(one, after), peak(other, after)))
            mine, theirs = np.array(peaks).T
            worst = np.abs(theirs - mine).argmax()
            off = theirs[worst] - mine[worst]
            told += f"  {1e3 * mine[worst]:7.1f} mN m {1e3 * off:+.2f} ({off / mine[worst]:+.1e})"
        print(f"{name:<14}{' '.join(sorted(outcomes)):<22}{told}", flush=True)


if __name__ == "__main__":
    main()
