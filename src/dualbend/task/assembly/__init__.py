"""Assembly of sheets on alignment pins."""

from dualbend.registry import Task
from dualbend.task.assembly.motions import PHASES

ASSEMBLY = Task(
    kind="assembly",
    config=None,
    phases=PHASES,
    run="dualbend.task.assembly.run:AssemblyRun",
    metrics="dualbend.task.assembly.metrics:metrics",
    tables="dualbend.task.assembly.metrics:tables",
    peaks="dualbend.task.assembly.metrics:peaks",
    report="dualbend.task.assembly.report:sections_of",
    recording="dualbend.task.assembly.recording:LAYERS",
)
