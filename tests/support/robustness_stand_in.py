"""Runs that take no time, importable by a worker process that is to start quickly."""

import os
import time
from pathlib import Path

from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.robustness.trial import Trial, draw, misalignment, trial, without_compliance

PWB = load_scenario("pwb")
CALLS = "DUALBEND_TEST_CALLS"
"""Environment variable: the file to which each run adds its line."""


def stand_in(scenario: Scenario, seed: int, index: int, compliance: bool) -> Trial:
    """Succeed below a misalignment that compliance makes larger, as a real run might."""
    if CALLS in os.environ:
        with Path(os.environ[CALLS]).open("a", encoding="utf-8") as file:
            file.write(f"{index} {compliance} {os.environ.get('OMP_NUM_THREADS')}\n")
    drawn = draw(scenario, seed, index)
    drawn = drawn if compliance else without_compliance(drawn)
    worst = misalignment(drawn)
    success = worst < (1.0e-3 if compliance else 0.3e-3)
    ended = {"outcome": "completed"} if success else {"outcome": "aborted", "phase": "seat middle"}
    force = (1.0 if compliance else 4.0) * 1e3 * worst
    return trial(drawn, index, success=success, peak_pin_force_n=force, **ended)


def slow(scenario: Scenario, seed: int, index: int, compliance: bool) -> Trial:
    time.sleep(60.0 if index else 0.0)
    return stand_in(scenario, seed, index, compliance)


def dying(scenario: Scenario, seed: int, index: int, compliance: bool) -> Trial:
    if index:
        os._exit(1)
    return stand_in(scenario, seed, index, compliance)
