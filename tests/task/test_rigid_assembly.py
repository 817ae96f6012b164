"""Arms that do not yield: what a millimetre of misalignment costs, and that nothing else does."""

from itertools import islice

import pytest

from dualbend.scenario.load import load_scenario
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.draws import misalignment, play
from dualbend.task.assembly.metrics import seated
from dualbend.task.assembly.run import AssemblyRun
from dualbend.validation.cases.assembly import _rigid

ALIGNED = [f"task.errors.{error}=0.0" for error in ("pickup_x_m", "pickup_y_m", "pickup_yaw_rad")]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5])
def test_rigid_arms_press_a_misaligned_sheet_on_a_pin_until_they_are_stopped(seed: int) -> None:
    scenario = load_scenario("pwb-rigid", seed=seed)
    assert "completed" not in scenario.expect.outcome
    assert misalignment(scenario) > 10.0 * play(scenario)
    result = AssemblyRun(scenario).run()
    # Nobody feels anything here, so that the noise decides nothing.
    assert result.outcome == "failed"
    limit = assembly_of(scenario).limits.pin_force_n
    assert f"N, above {limit:g} N" in result.reason
    assert not seated(result).any()
    rows = list(_rigid(result, AssemblyRun(load_scenario("pwb-misaligned")).run()))
    assert [row.name for row in rows if not row.passed] == []


def test_rigid_arms_lay_a_sheet_that_is_where_it_should_be() -> None:
    result = AssemblyRun(load_scenario("pwb-rigid", ALIGNED)).run()
    # So the misalignment is what fails, not the arms: and this run is not expected.
    assert result.outcome == "completed"
    assert seated(result).all()
    assert not result.expected
    rows = islice(_rigid(result, result), 3)
    assert [row.passed for row in rows] == [False] * 3
