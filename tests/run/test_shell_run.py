"""The paper's experiment with a plate instead of strips, briefly and coarsely."""

import numpy as np
import pytest

from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from support.strip import STRIP6

BRIEF = (
    "path.start_rad=0.5",
    "path.end_rad=0.505",
    "path.interval_rad=0.1",
    "motion.settle_s=0.9",
    "motion.hold_s=0.05",
)
COARSE = ("sheet.model=shell", "sheet.model.cells_along=12", "sheet.model.cells_across=3")


def test_it_runs_in_the_cell_and_the_grippers_carry_it() -> None:
    plate = BendingRun(load_scenario(STRIP6, [*BRIEF, *COARSE])).run()
    strips = BendingRun(load_scenario(STRIP6, BRIEF)).run()
    assert (plate.outcome, plate.reason) == ("completed", "")
    trace, sheet = plate.trace, plate.scenario.sheet.sheet()
    settled = int(np.argmax(trace["phase"] > 0)) - 1
    carried = -(trace["left_true_force_z"] + trace["right_true_force_z"])[settled]
    # Analytic, 1 %: a second after the start the sheet still swings a little.
    assert carried == pytest.approx(sheet.mass_kg * GRAVITY_M_PER_S2, rel=0.01)
    assert trace.bends.shape[1] == 12
    # Analytic: both turn by twice the end slope over the length; half a cell of it is the grips'.
    assert trace.bends[-1].sum() == pytest.approx(strips.trace.bends[-1].sum(), abs=0.01)
    assert trace["sag"][-1] == pytest.approx(strips.trace["sag"][-1], rel=0.02)
    # Between the beam and the plate, as far as 12 cells go (second order, 2 %).
    ratio = trace["left_true_force_x"][settled] / strips.trace["left_true_force_x"][settled]
    assert 1.0 < ratio < 1.0 / (1.0 - sheet.poisson_ratio**2) + 0.03
    assert np.isfinite(trace.qpos).all()


def test_no_file_can_hold_it() -> None:
    run = BendingRun(load_scenario(STRIP6, [*BRIEF, *COARSE]))
    with pytest.raises(InputError, match=r'sheet.model = "shell": .* export "strips"'):
        run.scene_xml()
