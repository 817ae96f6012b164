"""The report of a bending run."""

from __future__ import annotations

from dualbend.report.over_time import OverTime
from dualbend.report.section import Section
from dualbend.report.sections.bent_sheet import moment_section, path_section, shape_section
from dualbend.report.sections.stability import stability_section
from dualbend.report.sections.tables import metrics_section
from dualbend.report.sections.time import (
    deviation_section,
    misalignment_section,
    phase_section,
    wrench_section,
)
from dualbend.run.record import RunRecord


def sections_of(run: RunRecord) -> list[Section | None]:
    """Return the sections of a bending run; None where it has not what one would show."""
    over_time = OverTime(run)
    return [
        moment_section(run),
        metrics_section([run], ["value"], "while bending"),
        path_section(run),
        shape_section(run),
        wrench_section(over_time),
        misalignment_section(over_time),
        deviation_section(over_time),
        phase_section(over_time),
        stability_section(run),
    ]
