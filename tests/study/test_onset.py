"""Prediction against simulation: the bisection, the evaluation of a run, and two runs."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.folder import RUNS
from dualbend.study.onset import bisection as module
from dualbend.study.onset.bisection import bracketed, onset_study
from dualbend.study.onset.figure import plot_onsets
from dualbend.study.onset.held import dominant_frequency, evaluate, held, oscillate
from dualbend.study.onset.prediction import RayLoop
from dualbend.study.onset.report import report, summary
from dualbend.study.onset.results import Case, OnsetStudy, Rate, Simulated

Vector = NDArray[np.float64]
FIG9 = load_scenario("fig9")
LIMIT = 0.1


def wave(growth_per_s: float, frequency_hz: float = 2.3, size: float = 1e-3) -> Vector:
    times = COMMAND_PERIOD_S * np.arange(200)
    return size * np.exp(growth_per_s * times) * np.sin(2 * math.pi * frequency_hz * times)


@pytest.mark.parametrize("growth", [-0.8, -0.1, 0.1, 0.6])
def test_a_growing_wave_grows_at_its_rate_and_frequency(growth: float) -> None:
    found = evaluate(wave(growth), 200, LIMIT)
    assert found.grows == (growth > 0.0)
    # Discretisation-limited: a window does not hold a whole number of periods.
    assert found.growth_per_s == pytest.approx(growth, abs=0.05)
    assert found.frequency_hz == pytest.approx(2.3, rel=0.02)


def test_what_is_held_by_the_bound_or_ended_early_oscillates() -> None:
    assert evaluate(np.clip(wave(2.0, size=0.05), -LIMIT, LIMIT), 200, LIMIT).grows
    cut = evaluate(wave(-1.0)[:120], 200, LIMIT)
    assert cut.grows
    assert math.isinf(cut.final)


def test_a_remainder_does_not_flatten_the_rate_that_is_told() -> None:
    left = 3e-5 * np.sin(2 * math.pi * 4.0 * COMMAND_PERIOD_S * np.arange(200))
    found = evaluate(wave(-1.5) + left, 200, LIMIT)
    assert not found.grows
    # The remainder is a third of the wave where the rate is last looked at: its square counts.
    assert found.growth_per_s == pytest.approx(-1.5, rel=0.1)
    assert found.final == pytest.approx(3e-5 / math.sqrt(2.0), rel=0.1)


def test_frequency_lies_between_the_lines_of_the_spectrum() -> None:
    times = COMMAND_PERIOD_S * np.arange(110)
    # Discretisation-limited: a parabola through a padded line.
    assert dominant_frequency(3.0 + np.sin(2 * math.pi * 5.613 * times)) == pytest.approx(
        5.613, rel=2e-3
    )


@pytest.mark.parametrize("guess", [0.2, 0.9, 1.0, 1.1, 5.0])
def test_the_onset_is_found_from_either_side(guess: float) -> None:
    low, high = bracketed(lambda b: b < 1.0, guess)
    # Analytic.
    assert low < 1.0 <= high <= 1.0101 * low


def test_an_onset_that_is_nowhere_is_said() -> None:
    with pytest.raises(InputError, match="all oscillate"):
        bracketed(lambda _: True, 1.0)
    with pytest.raises(InputError, match="none oscillates"):
        bracketed(lambda _: False, 1.0)


def test_a_ray_scales_the_loop_and_the_onset_is_on_the_unit_circle() -> None:
    ray = RayLoop(FIG9, "rotation", 0.5, 80.0)
    found = ray.predict()
    # Discretisation-limited: the sweep's steps, second order.
    assert ray.mode(found.sampled).spectral_radius == pytest.approx(1.0, abs=3e-5)
    other = ray.on(20.0)
    assert other.mode(other.predict().sampled).spectral_radius == pytest.approx(1.0, abs=3e-5)
    assert found.paper < found.sampled


def test_two_sensing_arms_are_looked_at_as_they_are_disturbed() -> None:
    both = load_scenario(
        "fig9", ['compliance.complying=["left","right"]', 'compliance.sensing=["left","right"]']
    )
    led = load_scenario("fig9", ['compliance.complying=["left","right"]'])
    onsets = [RayLoop(s, "rotation", 0.5, 80.0).predict().sampled for s in (both, led)]
    # Analytic: alike, both arms move as one that the other mirrors.
    assert onsets[0] == pytest.approx(onsets[1], rel=1e-6)


@pytest.mark.parametrize(
    ("axis", "b", "ratio"), [("rotation", 0.008, 1600.0), ("rotation", 0.008, 20.0)]
)
def test_without_dry_friction_a_run_grows_and_swings_as_predicted(
    axis: str, b: float, ratio: float
) -> None:
    ray = RayLoop(FIG9, axis, 0.8, ratio)  # type: ignore[arg-type]
    mode = ray.mode(b)
    run = oscillate(ray.held(b), axis, friction=False)  # type: ignore[arg-type]
    # Golden: 0.02 /s and 0.3 % when this was written; the windows allow 0.1 /s.
    assert run.growth_per_s == pytest.approx(mode.growth_per_s, abs=0.1)
    assert run.frequency_hz == pytest.approx(mode.frequency_hz, rel=0.01)


def test_a_held_scenario_rests_at_its_angle_without_noise() -> None:
    found = held(FIG9, "x", 0.5, (0.2, 3.0))
    assert found.path.end_rad == 0.5
    assert found.compliance.rotation is None
    assert found.compliance.tare
    assert found.sensor.force_noise_n == 0.0
    # What is not about motion, noise and this axis is the scenario's own.
    assert (found.robot, found.filter) == (FIG9.robot, FIG9.filter)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rays": ()}, "rays: none given"),
        ({"angles": ()}, "angles: none given"),
        ({"axes": ()}, "axes: none given"),
        ({"rays": (-5.0,)}, "rays: -5.0 must be positive"),
        ({"angles": (math.nan,)}, "angles: nan must be positive"),
        ({"angles": (3.0,)}, r"angle 3\.0"),
        ({"angles": (1e-3,)}, "must be above"),
        ({"workers": 0}, "workers = 0"),
    ],
)
def test_what_makes_no_study_is_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        onset_study(FIG9, **changed)  # type: ignore[arg-type]


def test_a_scenario_without_the_axis_is_refused() -> None:
    with pytest.raises(InputError, match=r"compliance\.x is off"):
        onset_study(load_scenario("fig6"))
    with pytest.raises(InputError, match="no compliance"):
        onset_study(load_scenario("fig9", ["compliance.complying=[]"]))
    with pytest.raises(InputError, match=r"compliance\.x\.k = -1\.0: must be positive"):
        held(FIG9, "x", 0.5, (0.2, -1.0))


def a_case(key: str, ratio: float) -> Case:
    simulated = Simulated(
        b=0.5,
        unstable_b=0.498,
        stable_b=0.502,
        frequency_hz=2.5,
        residual=1e-5,
        rates=(Rate(b=0.45, predicted_per_s=0.6, simulated_per_s=0.5),),
        runs=9,
    )
    return Case(
        key=key,
        axis="x",
        alpha_rad=0.5,
        ratio_per_s=ratio,
        paper_b=0.05,
        delayed_b=0.6,
        sampled_b=0.55,
        sampled_hz=2.4,
        same_gains_hz=2.6,
        simulated=simulated,
        frictionless=simulated,
    )


@pytest.mark.usefixtures("in_process")
def test_what_is_found_is_kept_and_not_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = []

    def work(key: str, _: Scenario, axis: str, alpha_rad: float, ratio_per_s: float) -> Case:
        done.append(ratio_per_s)
        if ratio_per_s == 80.0 and len(done) == 2:
            raise KeyboardInterrupt
        return a_case(key, ratio_per_s)

    monkeypatch.setattr(module, "work", work)
    given = {"rays": (5.0, 80.0), "angles": (0.5,), "axes": ("x",), "workers": 1}
    with pytest.raises(KeyboardInterrupt):
        onset_study(FIG9, **given, folder=tmp_path)  # type: ignore[arg-type]
    found = onset_study(FIG9, **given, folder=tmp_path)  # type: ignore[arg-type]
    assert done == [5.0, 80.0, 80.0]
    assert [case.ratio_per_s for case in found.cases] == [5.0, 80.0]
    # Another scenario is another case.
    onset_study(load_scenario("fig9", ["robot.alter.delay_cycles=3"]), **given, folder=tmp_path)  # type: ignore[arg-type]
    assert len(done) == 5
    assert onset_study(FIG9, **given, folder=tmp_path) == found  # type: ignore[arg-type]
    assert len(done) == 5
    with pytest.raises(InputError, match="cannot be written"):
        onset_study(FIG9, **given, folder=tmp_path / RUNS)  # type: ignore[arg-type]


def test_errors_are_told_with_their_sign(tmp_path: Path) -> None:
    found = OnsetStudy(scenario="fig9", cases=(a_case("a", 5.0), a_case("b", 80.0)))
    # Analytic: 0.55 of 0.5, 0.05 of 0.5, 2.6 of 2.5, 0.6 less 0.5.
    text = summary(found)
    assert "x, sampled: onset median error 10.0 %, worst +10.0 % (n = 2)" in text
    assert "x, paper (23): onset median error 90.0 %, worst -90.0 %" in text
    assert "x, frequency: median error 4.0 %" in text
    assert "off by 0.10 /s in the median" in text
    assert "| x | 0.5 | 80 | 0.5 | 0.55 (+10.0 %) |" in report(found)
    plot_onsets(FIG9, found, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="cannot be written"):
        plot_onsets(FIG9, found, tmp_path / "nowhere" / "map.png")
    assert msgspec.json.decode(msgspec.json.encode(found), type=OnsetStudy) == found
