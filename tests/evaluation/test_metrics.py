"""The numbers of a run, and what its summary holds."""

import numpy as np
import pytest

from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.stability.prediction import predict
from dualbend.task.bending.run import BendingRun
from support.strip import STRIP6, STRIP8

SHORT = ("motion.speed_rad_per_s=0.4", "path.end_rad=0.4", "motion.settle_s=0.1")


@pytest.fixture(scope="module")
def result() -> RunRecord:
    return BendingRun(load_scenario(STRIP6, SHORT)).run()


def test_peaks_by_piece_are_those_of_the_trace(result: RunRecord) -> None:
    metrics = result.metrics
    pieces = metrics["peak_moment_by_piece"].value
    assert isinstance(pieces, list)
    assert len(pieces) == 2  # analytic: 0.4 rad in pieces of 0.2
    assert max(pieces) == metrics["peak_moment"].value
    rows = (result.trace["phase"] == 1) & (result.trace["nominal_alpha"] < 0.2)
    assert pieces[0] == np.abs(result.trace["left_true_moment_y"][rows]).max()


def test_summary_has_the_keys_that_users_gate_on(result: RunRecord) -> None:
    found = result.summary.to_json()
    assert {"scenario", "seed", "outcome", "versions", "metrics"} <= set(found)
    assert found["versions"]["mujoco"].startswith("4.0")
    for name in (
        "peak_moment",
        "rms_moment",
        "peak_moment_by_piece",
        "peak_force",
        "oscillation",
        "ik_residual_max",
        "realtime_factor",
        "wall_time",
    ):
        assert set(found["metrics"][name]) == {"value", "unit"}


def test_a_metric_that_is_null_says_why_and_others_have_no_note(result: RunRecord) -> None:
    metrics = result.summary.to_json()["metrics"]
    # fig6 has no compliance: nothing oscillates.
    assert metrics["oscillation_growth"]["value"] is None
    assert metrics["oscillation_growth"]["note"] == metrics["oscillation_frequency"]["note"] != ""
    assert "note" not in metrics["oscillation"]


def test_a_loop_that_is_predicted_stable_is_not_said_to_grow() -> None:
    """The compliance's step at 0.2 rad rings at 2.2 Hz; a decay of 0.7-5 1/s as the sheet bends."""
    scenario = load_scenario(STRIP8, ("compliance.x.b=1", "path.end_rad=0.6"))
    assert predict(scenario).verdict == "stable"
    growth = BendingRun(scenario).run().metrics["oscillation_growth"].value
    assert growth is None or (isinstance(growth, float) and growth < 0.0)


def test_surface_strain_is_that_of_the_elastica(result: RunRecord) -> None:
    from dualbend.beam import elastica

    # Discretisation-limited, O(h²), and the arms end near the last nominal angle.
    expected = elastica.surface_strain(
        float(result.trace["left_grip_alpha"][-1]), 0.4, result.scenario.sheet.thickness_m
    )
    assert result.metrics["peak_surface_strain"].value == pytest.approx(expected, rel=0.02)
