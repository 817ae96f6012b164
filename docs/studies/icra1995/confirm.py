"""Full simulations of some readings of the scan: two arms, sheet, sensor, noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from dualbend.evaluation.metrics import peak_by_piece
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.task.bending.run import BendingRun
from icra1995.reading import Reading
from icra1995.scan import B_FACTORS, ScanRow
from icra1995.table import Simulated

OSCILLATES = 0.25
"""Oscillation over the first peak of Fig. 6 from which a run is called oscillating; that of the
knots alone is below 0.1."""

_USUAL = {"robot": "2Hz/0.995", "delay": 2, "low_pass": "fir2"}


def select(rows: Sequence[ScanRow]) -> list[Reading]:
    """Return which readings to simulate, all with the usual robot, delay and filter.

    Those that the cheap model lets through, and on the sheet of the one that lowers the moment most
    every form and angle unit.
    """
    usual = [
        row
        for row in rows
        if all(getattr(row.reading, name) == value for name, value in _USUAL.items())
    ]
    passing = sorted((row for row in usual if row.together), key=lambda row: row.mean_ratio)
    if not passing:
        return []
    through = [row.reading for row in passing]
    same = through[0].sheet, through[0].length, through[0].start_rad
    beside = [
        row.reading
        for row in usual
        if (row.reading.sheet, row.reading.length, row.reading.start_rad) == same
    ]
    return list(dict.fromkeys([*through, *beside]))


def simulate(reading: Reading) -> Simulated:
    """Run Figs. 6 and 8, the exact path, and Fig. 9 with ever smaller B until it oscillates."""
    linear = _run(reading.without_compliance())
    exact = _run(reading.without_compliance(exact=True))
    complying = _run(reading.scenario())
    before = np.array(peak_by_piece(linear))
    after = np.array(peak_by_piece(complying))
    first = round(reading.start_rad / 0.2)
    whole = after.size == before.size
    ratios = (after / before)[first:] if whole else np.array([math.nan])
    peak = float(before.max())
    return Simulated(
        peak_nm=peak,
        exact_ratio=float(np.nanmax(peak_by_piece(exact))) / peak,
        worst_ratio=float(ratios.max()),
        mean_ratio=float(ratios.mean()),
        ended=complying.outcome if not oscillates(complying, peak) else "oscillates",
        b_factor=next((f for f in B_FACTORS if oscillates(_run(reading.scenario(f)), peak)), 0.0),
    )


def oscillates(result: RunRecord, peak_nm: float) -> bool:
    """Say whether a run's moment oscillates by a part of Fig. 6's peak, or the robot stopped."""
    found = result.metrics["oscillation"].value
    stopped = result.outcome != "completed"
    return stopped or (isinstance(found, float) and found > OSCILLATES * peak_nm)


def _run(scenario: Scenario) -> RunRecord:
    quiet = msgspec.structs.replace(scenario, seed=1)
    return BendingRun(quiet).run()
