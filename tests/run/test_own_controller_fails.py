"""A controller brought along that fails ends the run, and says which, when and how."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dualbend import Observation, load_scenario
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario
from dualbend.task.assembly.run import AssemblyRun

SHORT = ["path.end_rad=0.1", "motion.speed_rad_per_s=1", "motion.hold_s=0.1"]
LAST_GOOD = 4


class Failing:
    """Does nothing for some cycles, then what it is told to."""

    fails: Callable[[], Any]

    def __init__(self, _: Scenario) -> None:
        self.cycles = 0

    def __call__(self, observation: Observation) -> Any:
        self.cycles += 1
        return type(self).fails() if self.cycles > LAST_GOOD else np.zeros((2, 6))


def raising() -> None:
    raise KeyError("gain")


CASES = {
    "NaN": (lambda: np.full((2, 6), np.nan), "its deviation is not finite"),
    "shape": (lambda: np.zeros(6), r"its deviation is of shape (6,), not (2, 6)"),
    "nothing": (lambda: None, "its deviation is of shape (), not (2, 6)"),
    "words": (lambda: "stop", "could not convert string to float"),
    "exception": (raising, "KeyError: 'gain' (test_own_controller_fails.py:"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_controller_that_fails_ends_the_run_with_its_name_and_cycle(case: str) -> None:
    kind, said = CASES[case]
    own = type("Mine", (Failing,), {"fails": staticmethod(kind)})
    result = make_run(load_scenario("exact", SHORT), compliance=own).run()
    assert result.outcome == "failed"
    assert f"Mine, cycle {LAST_GOOD + 1}: " in result.reason
    assert said in result.reason
    assert not result.expected
    # What was measured before stays: the failing cycle was observed, and nothing was sent in it.
    assert result.trace.rows == LAST_GOOD + 1


def test_it_does_so_in_an_assembly() -> None:
    class Mine(Failing):
        fails = staticmethod(lambda: np.full((2, 6), np.inf))

    class Assembly(AssemblyRun):
        compliance = Mine

    result = Assembly(load_scenario("pwb")).run()
    assert result.outcome == "failed"
    assert f"Mine, cycle {LAST_GOOD + 1}: its deviation is not finite" in result.reason
