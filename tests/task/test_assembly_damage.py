"""What ends an assembly because pins, holes or the simulated contact do not bear it."""

import numpy as np
import pytest

from dualbend.scene.bed.config import HOLES
from dualbend.scene.bed.pin_contacts import PinPeaks
from dualbend.scene.warnings import SimulationFailed
from dualbend.task.assembly.config import LimitsConfig
from dualbend.task.assembly.damage import Resolution, stop_at_damage

LIMITS = LimitsConfig(pin_force_n=40.0, edge_force_n=30.0, penetration_m=5e-5)
SHEET = Resolution(thickness_m=0.5e-3, step_s=0.00175)
AT_THE_LIMITS = {"force_n": 40.0, "edge_force_n": 30.0, "penetration_m": 5e-5, "impact_m": 2.5e-4}


def peaks(**on_the_third: float) -> PinPeaks:
    return PinPeaks(
        **{name: np.array([0.0, 0.0, value, 0.0]) for name, value in on_the_third.items()}
    )


def test_what_is_at_its_limits_goes_on() -> None:
    stop_at_damage("lower", HOLES, peaks(**AT_THE_LIMITS), LIMITS, SHEET)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("force_n", "lower: the force on the outer_left pin is 40.4 N, above 40 N"),
        ("edge_force_n", "lower: the force on the outer_left hole edge is 30.3 N, above 30 N"),
        ("penetration_m", "stays 50 µm deep into the outer_left pin, above 50 µm"),
        ("impact_m", "falls 252 µm deep into the outer_left pin, above 250 µm"),
    ],
)
def test_one_percent_more_ends_the_run_and_is_named(name: str, words: str) -> None:
    more = {**AT_THE_LIMITS, name: 1.01 * AT_THE_LIMITS[name]}
    with pytest.raises(SimulationFailed, match=words):
        stop_at_damage("lower", HOLES, peaks(**more), LIMITS, SHEET)
