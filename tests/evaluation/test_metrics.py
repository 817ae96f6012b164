"""The oscillation measure, against signals whose amplitude, frequency and growth are known."""

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.evaluation.metrics import oscillation_of
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun

SHORT = ("motion.speed_rad_per_s=0.4", "path.end_rad=0.4", "motion.settle_s=0.1")


@pytest.fixture(scope="module")
def result() -> RunRecord:
    return BendingRun(load_scenario("fig6", SHORT)).run()


def times(duration_s: float) -> np.ndarray:
    return np.arange(0.0, duration_s, COMMAND_PERIOD_S)


@pytest.mark.parametrize("frequency_hz", [2.0, 3.0, 5.0])
def test_amplitude_and_frequency_of_a_sine(frequency_hz: float) -> None:
    amplitude, frequency, growth = oscillation_of(
        0.1 * np.sin(2 * np.pi * frequency_hz * times(10.0))
    )
    # Discretisation-limited: extremes are found on a grid of 28 ms, the window is no whole period.
    assert amplitude == pytest.approx(0.1, rel=0.1)
    assert frequency == pytest.approx(frequency_hz, rel=0.1)
    assert growth is not None


def test_growth_of_a_growing_oscillation() -> None:
    t = times(4.0)
    rate = 1.5
    _, _, growth = oscillation_of(1e-3 * np.exp(rate * t) * np.sin(2 * np.pi * 2.5 * t))
    # Discretisation-limited: extremes are read on a grid of 28 ms.
    assert growth == pytest.approx(rate, rel=0.1)


def test_a_decaying_oscillation_does_not_grow() -> None:
    t = times(4.0)
    _, _, growth = oscillation_of(np.exp(-1.5 * t) * np.sin(2 * np.pi * 2.5 * t))
    assert growth == 0.0  # analytic: no extreme is above the one before


def test_slow_pieces_are_no_oscillation() -> None:
    t = times(10.0)
    amplitude, frequency, growth = oscillation_of(0.1 * np.abs(np.sin(np.pi * t / 2.0)))
    # Golden bound: what is left of 0.1 N m arches of 2 s after the high-pass is their cusps.
    assert amplitude is not None
    assert amplitude < 0.03
    assert frequency is None
    assert growth == 0.0


def test_a_short_record_tells_nothing() -> None:
    assert oscillation_of(np.zeros(10)) == (None, None, None)


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


def test_surface_strain_is_that_of_the_elastica(result: RunRecord) -> None:
    from dualbend.beam import elastica

    # Discretisation-limited, O(h²), and the arms end near the last nominal angle.
    expected = elastica.surface_strain(
        float(result.trace["left_grip_alpha"][-1]), 0.4, result.scenario.sheet.thickness_m
    )
    assert result.metrics["peak_surface_strain"].value == pytest.approx(expected, rel=0.02)
