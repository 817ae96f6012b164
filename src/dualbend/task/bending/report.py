"""The report of a bending run."""

from __future__ import annotations

from dualbend.report.over_time import OverTime
from dualbend.report.plot import Axis
from dualbend.report.section import Section
from dualbend.report.sections.bent_sheet import moment_section, path_section, shape_section
from dualbend.report.sections.stability import stability_section
from dualbend.report.sections.tables import metrics_section
from dualbend.report.sections.time import (
    deviation_section,
    panels_by_side,
    phase_section,
    wrench_section,
)
from dualbend.run.record import RunRecord
from dualbend.task.bending.config import is_in_space

_OUT_OF_PLANE = (
    (
        Axis("lateral force", "N"),
        1.0,
        (("across", "true_force_y"),),
        "True force across the sheet on each gripper, along y of that arm's bending frame. "
        "Shaded: every second phase.",
    ),
    (
        Axis("moment out of the plane", "mN m"),
        1e3,
        (("about x (twist)", "true_moment_x"), ("about z (yaw)", "true_moment_z")),
        "True moment on each gripper about x (inward: it twists the sheet) and z (up) of that "
        "arm's bending frame, at the gripper's centre.",
    ),
)


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


def misalignment_section(over_time: OverTime) -> Section | None:
    """Return the wrench out of the bending plane; None where grips and arms are right."""
    if not is_in_space(over_time.run.scenario):
        return None
    return Section("Misaligned grips", [panels_by_side(over_time, _OUT_OF_PLANE)])
