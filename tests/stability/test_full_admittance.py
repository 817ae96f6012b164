"""The loop of an admittance with a mass: predicted from the object that runs, and simulated."""

import math
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import least_squares

from dualbend import load_scenario, make_run, predict
from dualbend.cli import main
from dualbend.control.compliance.admittance import AdmittanceConfig
from dualbend.control.compliance.base import AxisConfig, DirectionConfig
from dualbend.control.compliance.mass_spring_damper import MassSpringDamperConfig
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.study.tuning.gains import Knob, knobs, softened, turned
from dualbend.study.tuning.search import Margin, with_compliance
from dualbend.study.tuning.tuning import tune
from dualbend.types import SIDES

QUIET = (
    *("imperfections=none", "sensor.force_noise_n=0", "sensor.torque_noise_nm=0"),
    *("sensor.force_resolution_n=0", "sensor.torque_resolution_nm=0"),
    *("path.end_rad=0.4", "motion.speed_rad_per_s=0.5", "motion.settle_s=0.5", "motion.hold_s=6"),
)


def full(**parts: Any) -> MassSpringDamperConfig:
    return MassSpringDamperConfig(sensing=SIDES, complying=SIDES, **parts)


def scenario(*settings: str, **pitch: float) -> Scenario:
    return with_compliance(
        load_scenario("fig6", [*QUIET, *settings]), full(pitch=DirectionConfig(limit=0.5, **pitch))
    )


def test_without_a_mass_the_prediction_is_that_of_the_static_form() -> None:
    """Exact: the same transfer functions, one of them with a common factor."""
    axes = {"x": (3e4, 5e4), "pitch": (20.0, 5.0)}
    one = full(**{name: DirectionConfig(b=b, k=k) for name, (b, k) in axes.items()})
    static = {name: AxisConfig(b=b, k=k, form="static") for name, (b, k) in axes.items()}
    other = AdmittanceConfig(
        sensing=SIDES, complying=SIDES, units="si", x=static["x"], rotation=static["pitch"]
    )
    base = load_scenario("fig6", [*QUIET, "path.end_rad=0.2"])
    found, expected = (predict(with_compliance(base, config)).rows for config in (one, other))
    assert len(found) == len(expected) > 3
    for mine, theirs in zip(found, expected, strict=True):
        assert mine.axes == theirs.axes == ("x", "rotation")
        assert mine.spectral_radius == pytest.approx(theirs.spectral_radius, rel=1e-9)
        assert mine.gain_margin_db == pytest.approx(theirs.gain_margin_db, abs=1e-6)


def test_a_pure_damper_has_its_rest_where_nothing_pushes() -> None:
    """A limit: a very weak spring's prediction is the damper's."""
    weak, none = (predict(scenario(b=20.0, k=k)).rows[-1] for k in (1e-6, 0.0))
    assert none.spectral_radius == pytest.approx(weak.spectral_radius, abs=1e-5)
    assert none.gain_margin_db == pytest.approx(weak.gain_margin_db, abs=1e-3)


def decay(run: RunRecord) -> tuple[float, float]:
    """Return growth rate [1/s] and frequency [Hz] of the moment while it is held."""
    hold = run["phase"] == run.phases.index("hold")
    time, moment = run["time"][hold], run["left_true_moment_y"][hold]
    time, moment = time[len(time) // 6 :] - time[-1], moment[len(moment) // 6 :]

    def missed(p: Any) -> Any:
        turn = 2.0 * math.pi * p[4] * time
        return p[0] + np.exp(p[3] * time) * (p[1] * np.cos(turn) + p[2] * np.sin(turn)) - moment

    start = (moment.mean(), moment.std(), 0.0)
    fits = [least_squares(missed, (*start, 0.0, f)) for f in np.linspace(0.3, 2.0, 8)]
    best = min(fits, key=lambda fit: fit.cost)
    return float(best.x[3]), abs(float(best.x[4]))


@pytest.mark.slow
@pytest.mark.parametrize(("m", "b"), [(0.0, 2.0), (0.0, 4.0), (0.5, 4.0), (0.5, 8.0), (2.0, 8.0)])
def test_its_oscillation_is_the_predicted_one(m: float, b: float) -> None:
    """The sheet is linear at rest: 0.05 1/s and 3 % of the frequency, unstable and stable."""
    given = scenario(m=m, b=b, k=2.0)
    row = predict(given).rows[-1]
    rate, frequency_hz = decay(make_run(given).run())
    assert rate == pytest.approx(row.growth_per_s, abs=0.05)
    assert frequency_hz == pytest.approx(row.frequency_hz, rel=0.03)


def test_more_mass_lowers_the_frequency_and_the_margin() -> None:
    """A trend that a Routh table has as well: the mass takes phase where the loop crosses."""
    rows = [predict(scenario(m=m, b=4.0, k=2.0)).rows[-1] for m in (0.0, 0.5, 2.0)]
    assert rows[0].gain_margin_db > rows[1].gain_margin_db > rows[2].gain_margin_db
    assert rows[0].frequency_hz > rows[1].frequency_hz > rows[2].frequency_hz


def test_one_line_says_what_is_not_predicted() -> None:
    given = "compliance={kind='mass-spring-damper',pitch={b=20,dead_zone=0.1},yaw={b=50}}"
    shown = CliRunner().invoke(main, ["stability", "fig6", "--set", given]).output
    left = "yaw in the frame 'world'; the dead zone of pitch; limits"
    assert f"not in the prediction: {left}" in shown
    given = "compliance={kind='mass-spring-damper',yaw={b=50}}"
    shown = CliRunner().invoke(main, ["stability", "fig6", "--set", given]).output
    assert "no compliance along x of the world or in pitch" in shown
    assert "not in the prediction" not in CliRunner().invoke(main, ["stability", "fig8"]).output


def test_a_search_scales_a_direction_or_its_times() -> None:
    """Analytic: all of it by c is 1/c as compliant; b by c, m by c² is c as slow, alike damped."""
    config = full(pitch=DirectionConfig(m=1.0, b=4.0, k=2.0), z=DirectionConfig(b=100.0))
    names = knobs(config, 1.0)
    assert names == [Knob("z", "compliance"), Knob("pitch", "compliance"), Knob("pitch", "lag")]
    soft = turned(config, Knob("pitch", "compliance"), 2.0, 0.028)
    slow = turned(config, Knob("pitch", "lag"), 2.0, 0.028)
    stiff = softened(config, 0.5)
    assert isinstance(soft, MassSpringDamperConfig)
    assert isinstance(slow, MassSpringDamperConfig)
    assert isinstance(stiff, MassSpringDamperConfig)
    assert soft.pitch == DirectionConfig(m=0.5, b=2.0, k=1.0)
    assert slow.pitch == DirectionConfig(m=4.0, b=8.0, k=2.0)
    assert stiff.pitch == DirectionConfig(m=2.0, b=8.0, k=4.0)
    assert stiff.z == DirectionConfig(b=200.0)


@pytest.mark.slow
def test_tune_finds_gains_of_it() -> None:
    given = scenario("motion.hold_s=0.2", m=0.05, b=20.0, k=5.0)
    found = tune(given, required=Margin(gain_db=6.0, phase_deg=30.0), seeds=3)
    assert found.chosen.name == "tuned"
    assert found.found.rms_nm < found.outcomes[1].rms_nm
