"""A run by recorded commands, in the place of the scenario's controller."""

from __future__ import annotations

from collections.abc import Callable

from dualbend.errors import InputError
from dualbend.logs.commands import CommandLog
from dualbend.run.loop import Run
from dualbend.run.outcome import TaskStopped
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServeConfig
from dualbend.scene.warnings import warnings_counted_only


def refuse_log(run: Run, log: CommandLog) -> None:
    """Raise InputError where a log cannot drive a run.

    Its rows are not a command period apart, a deviation is beyond ``serve.limit_m`` or
    ``limit_rad``, or the run is none of bending.
    """
    scenario = run.scenario
    if scenario.task.kind != "bending":
        raise InputError(
            f"scenario {scenario.name!r}: task.kind = {scenario.task.kind!r}; replayed is bending"
        )
    bounds = scenario.serve or ServeConfig()
    log.refuse_times(scenario.period_s)
    log.refuse_beyond(bounds.limit_m, bounds.limit_rad)


def replay(run: Run, log: CommandLog, on_cycle: Callable[[int], None] | None = None) -> RunRecord:
    """Simulate the motion by a log's commands, a row a cycle, to its end or that of the log.

    A command is executed as a controller's is: after ``robot.alter.delay_cycles``, in the axes of
    ``robot.alter.mode``, within the guard.
    """
    run.outside, run.records_all_axes = "dualbend replay", True
    walk = run.walk(on_cycle)
    with warnings_counted_only():
        try:
            next(walk)
            while True:
                cycle = run.trace.rows - 1
                if cycle < len(log.deviation):
                    walk.send(log.deviation[cycle].copy())
                else:
                    walk.throw(TaskStopped(f"{log.path} has no command for cycle {cycle}"))
        except StopIteration as end:
            record: RunRecord = end.value
    return record
