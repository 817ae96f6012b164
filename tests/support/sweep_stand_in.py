"""Runs that take no time, importable by a worker process that is to start quickly."""

import math
import os
import signal
import time
from pathlib import Path

from dualbend.run.record import Metric
from dualbend.scenario.scenario import Scenario
from dualbend.study.sweep.row import RunRow

CALLS = "DUALBEND_TEST_CALLS"
"""Environment variable: the file to which each run adds its line."""


def called(index: int) -> None:
    if CALLS in os.environ:
        with Path(os.environ[CALLS]).open("a", encoding="utf-8") as file:
            file.write(f"{index} {os.environ.get('OMP_NUM_THREADS')}\n")


def stand_in(index: int, scenario: Scenario) -> RunRow:
    """Two numbers of the scenario's, one of each piece; above a stiffness a protective stop."""
    called(index)
    b, length = scenario.compliance.x.b if scenario.compliance.x else 0.0, scenario.sheet.length_m
    pieces = [math.sin(b), None, b * length][: 2 + index % 2]
    metrics = {
        "peak_moment": Metric(b**2 / length, "N m"),
        "peak_force": Metric(None if b > 8.0 else b, "N"),
        "peak_moment_by_piece": Metric(pieces, "N m"),
        "seed": Metric(float(scenario.seed), "1"),
    }
    if b > 8.0:
        return RunRow(index=index, outcome="protective_stop", reason="b is 8", metrics=metrics)
    return RunRow(index=index, outcome="completed", metrics=metrics)


def slow(index: int, scenario: Scenario) -> RunRow:
    time.sleep(0.0 if index < 2 else 60.0)
    return stand_in(index, scenario)


def steady(index: int, scenario: Scenario) -> RunRow:
    time.sleep(0.1)
    return stand_in(index, scenario)


def deadly(index: int, scenario: Scenario) -> RunRow:
    """Run 3 kills its process, whenever it is tried."""
    if index == 3:
        called(index)
        os.kill(os.getpid(), signal.SIGKILL)
    return stand_in(index, scenario)


def unlucky(index: int, scenario: Scenario) -> RunRow:
    """Run 1's process is killed once."""
    mark = Path(os.environ[CALLS]).with_suffix(".killed")
    if index == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return stand_in(index, scenario)


def never(index: int, scenario: Scenario) -> RunRow:
    raise AssertionError(f"run {index} is done already")
