"""The sheets of a series as a recording shows them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dualbend.errors import writing
from dualbend.recording.learning import SheetSeries, write_sheets_recording
from dualbend.scenario.scenario import Scenario
from dualbend.study.learning.sheet import Sheet
from dualbend.types import SIDES


def record_sheets(scenario: Scenario, sheets: Sequence[Sheet], path: Path) -> None:
    """Write moments and corrections of a series; InputError where that is not possible."""
    arms = len(scenario.compliance.sensing)
    shown = [
        SheetSeries(
            name=f"sheet {sheet.sheet}, {sheet.speed_rad_per_s:g} rad/s",
            time_s=np.array(sheet.time_s),
            moment_nm=np.array(sheet.moment_nm),
            correction_rad=np.repeat(sheet.correction_rad, len(SIDES) // arms, axis=0),
        )
        for sheet in sheets
    ]
    with writing(path, "--out"):
        write_sheets_recording(shown, scenario.name, path, scenario.period_s)
