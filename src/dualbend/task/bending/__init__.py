"""Bending along a path between two grips."""

from dualbend.registry import Task
from dualbend.scenario.motion import PHASES
from dualbend.task.bending.config import BendingConfig

BENDING = Task(
    kind="bending",
    config=BendingConfig,
    phases=PHASES,
    run="dualbend.task.bending.run:BendingRun",
    columns="dualbend.task.bending.run:columns",
    cycles="dualbend.task.bending.run:cycles",
    metrics="dualbend.task.bending.metrics:metrics",
    peaks="dualbend.task.bending.metrics:peaks",
    tolerances="dualbend.task.bending.tolerances:TOLERANCES",
    report="dualbend.task.bending.report:sections_of",
)
