"""Runs of sweeps and of assemblies that take no time."""

import math
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np

from dualbend.run.record import Metric
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.robustness.trial import Trial, trial
from dualbend.study.sweep.run import RunRow
from dualbend.task.assembly.draws import draw, misalignment, without_compliance
from support.small_runs import called

PWB = load_scenario("pwb")


class InProcess(Executor):
    """Runs at once, where the processes are not what is tested: each takes a second to start."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        pass

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def a_sweeps_run(index: int, scenario: Scenario) -> RunRow:
    """Two numbers of the scenario's, one of each piece; above a stiffness a protective stop."""
    called(index)
    axis, length = scenario.compliance.rotation, scenario.sheet.length_m
    b = axis.b if axis else 0.0
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


def a_trial(scenario: Scenario, seed: int, index: int, compliance: bool) -> Trial:
    """Succeed below a misalignment that compliance makes larger, as a real run might."""
    called(index)
    drawn = draw(scenario, seed, index)
    drawn = drawn if compliance else without_compliance(drawn)
    worst = misalignment(drawn)
    success = worst < (1.0e-3 if compliance else 0.3e-3)
    ended = {"outcome": "completed"} if success else {"outcome": "aborted", "phase": "seat middle"}
    force = (1.0 if compliance else 4.0) * 1e3 * worst
    return trial(drawn, index, success=success, peak_pin_force_n=force, **ended)


def each_by(one: Callable[[Scenario, int], tuple[np.ndarray, str]]) -> Callable[..., object]:
    """Return a ``simulate`` of tuning that asks ``one`` of each scenario and its seed."""
    return lambda cases: [one(*case) for case in cases]
