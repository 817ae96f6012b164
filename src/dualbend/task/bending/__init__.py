"""Bending along a path between two grips."""

from dualbend.registry import Task
from dualbend.scenario.motion import PHASES

BENDING = Task(
    kind="bending",
    config=None,
    phases=PHASES,
    run="dualbend.task.bending.run:BendingRun",
    metrics="dualbend.task.bending.metrics:metrics",
    peaks="dualbend.task.bending.metrics:peaks",
    report="dualbend.task.bending.report:sections_of",
)
