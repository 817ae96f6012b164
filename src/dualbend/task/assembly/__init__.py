"""Assembly of sheets on alignment pins."""

from dualbend.registry import Task
from dualbend.task.assembly.config import AssemblyConfig
from dualbend.task.assembly.program.motions import PHASES

ASSEMBLY = Task(
    kind="assembly",
    config=AssemblyConfig,
    phases=PHASES,
    run="dualbend.task.assembly.run:AssemblyRun",
    columns="dualbend.task.assembly.run:columns",
    cycles="dualbend.task.assembly.run:cycles",
    metrics="dualbend.task.assembly.metrics:metrics",
    tables="dualbend.task.assembly.metrics:tables",
    peaks="dualbend.task.assembly.metrics:peaks",
    tolerances="dualbend.task.assembly.tolerances:TOLERANCES",
    report="dualbend.task.assembly.report:sections_of",
    recording="dualbend.task.assembly.recording:LAYERS",
)
