"""The motion without a sheet that tells the joints' friction before the first one."""

from __future__ import annotations

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.task.bending.rehearsal import Rehearsal
from dualbend.types import Vector

MOVING = [1, 2, 4, 7, 8, 10]
"""Of a PUMA that bends in its own plane: shoulder, elbow and the wrist's bend, left and right."""


def short(*settings: str) -> Scenario:
    quick = ("path.end_rad=0.35", "motion.settle_s=0.5", "motion.hold_s=0.5")
    return load_scenario("learned", [*quick, "sheet.model.hinges=4", *settings])


def rehearsed_friction(scenario: Scenario) -> Vector:
    run = Rehearsal(scenario)
    return run.told(run.run())


@pytest.mark.parametrize("true", [0.7, 1.3])
def test_the_path_without_a_sheet_tells_the_friction(true: float) -> None:
    """And no weight that is not known: links that are 5 % heavier pull at shoulder and elbow."""
    errors = f'{{preset="none",robot={{coulomb_ratio={true},link_mass_ratio=1.05}}}}'
    found = rehearsed_friction(short(f"imperfections={errors}"))
    np.testing.assert_allclose(found[MOVING], true, atol=0.06)
    np.testing.assert_array_equal(np.delete(found, MOVING), 1.0)  # at rest they tell nothing


def test_no_sheet_is_between_the_arms() -> None:
    run = Rehearsal(short("imperfections=none"))
    result = run.run()
    assert result.outcome == "completed"
    bent = slice(50, None)  # what a sheet pushes with is tens of newtons
    assert np.abs(result["left_true_force_x"][bent]).max() < 0.5
    assert np.abs(result["right_true_moment_y"][bent]).max() < 0.05
    assert result["nominal_alpha"][-1] == pytest.approx(0.1)  # forth and back


def test_arms_that_do_not_get_to_the_end_tell_nothing() -> None:
    """An arm whose friction is more than the guard lets it lag behind."""
    stuck = 'imperfections={preset="none",robot={coulomb_ratio=3.0}}'
    with pytest.raises(InputError, match="motion without a sheet ended with protective stop"):
        rehearsed_friction(short(stuck, "guard.following_error_rad=0.001"))


def test_what_happens_to_a_sheet_happens_to_none_before_it() -> None:
    stop = "imperfections.events.arm_stop={side='left',at_s=1.0}"
    np.testing.assert_array_equal(rehearsed_friction(short(stop)), rehearsed_friction(short()))


def test_nothing_complies_without_a_sheet() -> None:
    """Wrong sensors move arms that comply: by some mrad in a typical cell."""
    quick = ("path.end_rad=0.2", "motion.settle_s=0.1", "motion.hold_s=0.1")
    result = Rehearsal(load_scenario("fig8", quick)).run()
    assert result.outcome == "completed"
    assert not result["left_deviation_alpha"].any()
