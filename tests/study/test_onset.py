"""Prediction against simulation: the criterion of an onset, the cases, and two runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from dualbend.cli import main
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.folder import RUNS
from dualbend.study.onset import study as module
from dualbend.study.onset.design import Point, drawn, grid
from dualbend.study.onset.figure import plot_onsets
from dualbend.study.onset.held import dominant_frequency, evaluate, held, oscillate
from dualbend.study.onset.prediction import RayLoop
from dualbend.study.onset.report import report, summary
from dualbend.study.onset.results import Case, OnsetStudy, Rate, Simulated
from dualbend.study.onset.study import onset_study
from dualbend.study.onset.threshold import AGREEING, STEP, threshold
from support.strip import STRIP6, STRIP9

Vector = NDArray[np.float64]
FIG9 = load_scenario(STRIP9)
LIMIT = 0.1


def wave(growth_per_s: float, frequency_hz: float = 2.3, size: float = 1e-3) -> Vector:
    times = COMMAND_PERIOD_S * np.arange(200)
    return size * np.exp(growth_per_s * times) * np.sin(2 * math.pi * frequency_hz * times)


@pytest.mark.parametrize("growth", [-0.8, -0.1, 0.1, 0.6])
def test_a_growing_wave_grows_at_its_rate_and_frequency(growth: float) -> None:
    found = evaluate(wave(growth), 200, LIMIT, COMMAND_PERIOD_S)
    assert found.grows == (growth > 0.0)
    # Discretisation-limited: a window does not hold a whole number of periods.
    assert found.growth_per_s == pytest.approx(growth, abs=0.05)
    assert found.frequency_hz == pytest.approx(2.3, rel=0.02)


def test_what_is_held_by_the_bound_or_ended_early_oscillates() -> None:
    assert evaluate(
        np.clip(wave(2.0, size=0.05), -LIMIT, LIMIT), 200, LIMIT, COMMAND_PERIOD_S
    ).grows
    cut = evaluate(wave(-1.0)[:120], 200, LIMIT, COMMAND_PERIOD_S)
    assert cut.grows
    assert math.isinf(cut.final)


def test_a_remainder_does_not_flatten_the_rate_that_is_told() -> None:
    left = 3e-5 * np.sin(2 * math.pi * 4.0 * COMMAND_PERIOD_S * np.arange(200))
    found = evaluate(wave(-1.5) + left, 200, LIMIT, COMMAND_PERIOD_S)
    assert not found.grows
    # The remainder is a third of the wave where the rate is last looked at: its square counts.
    assert found.growth_per_s == pytest.approx(-1.5, rel=0.1)
    assert found.final == pytest.approx(3e-5 / math.sqrt(2.0), rel=0.1)


def test_frequency_lies_between_the_lines_of_the_spectrum() -> None:
    times = COMMAND_PERIOD_S * np.arange(110)
    # Discretisation-limited: a parabola through a padded line.
    assert dominant_frequency(
        3.0 + np.sin(2 * math.pi * 5.613 * times), COMMAND_PERIOD_S
    ) == pytest.approx(5.613, rel=2e-3)


@pytest.mark.parametrize("frequency_hz", [1.5, 2.3, 6.0])
@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 2.4])
def test_a_run_grows_where_its_mode_does(frequency_hz: float, phase: float) -> None:
    times = COMMAND_PERIOD_S * np.arange(199)
    for growth in (-0.1, 0.1):
        mode = 0.02 * np.exp(growth * times) * np.cos(2 * math.pi * frequency_hz * times + phase)
        # Discretisation-limited: half a period in four changes rms by 2 %, 0.01 /s of the rate.
        assert evaluate(mode, 199, LIMIT, COMMAND_PERIOD_S).grows == (growth > 0.0)


@pytest.mark.parametrize("frequency_hz", [0.8, 1.3, 2.3, 7.0])
@pytest.mark.parametrize("growth", [-1.0, -0.1, 0.1, 1.0])
def test_a_run_with_a_drift_grows_where_its_oscillation_does(
    growth: float, frequency_hz: float
) -> None:
    random = np.random.default_rng(7)
    times = COMMAND_PERIOD_S * np.arange(199)
    for _ in range(100):
        time_constant = math.exp(random.uniform(math.log(0.3), math.log(30.0)))
        drift = random.uniform(-10.0, 10.0) * np.exp(-times / time_constant)
        phase = 2.0 * math.pi * (frequency_hz * times + random.uniform())
        both = 1e-3 * (np.exp(growth * times) * np.cos(phase) + drift)
        # Discretisation-limited: 0.05 /s at 0.8 Hz, where a half holds two periods.
        assert evaluate(both, 199, LIMIT, COMMAND_PERIOD_S).grows == (growth > 0.0)


def test_a_drift_has_no_frequency() -> None:
    times = COMMAND_PERIOD_S * np.arange(100)
    drift = 10.0 * np.exp(-times / 2.0)
    # Discretisation-limited: a parabola through a padded line, beside what is left of the drift.
    assert dominant_frequency(
        drift + np.sin(2 * math.pi * 1.3 * times), COMMAND_PERIOD_S
    ) == pytest.approx(1.3, rel=0.02)


def swelling(*sizes: float) -> Vector:
    """An oscillation at 5 Hz that has one size after another, each as long."""
    size = np.repeat(sizes, 200 // len(sizes))
    return 1e-3 * size * np.sin(2 * math.pi * 5.0 * COMMAND_PERIOD_S * np.arange(size.size))


def test_the_whole_second_half_counts_and_not_where_a_swell_lies() -> None:
    """Analytic: rms of the halves by the sizes of their quarters."""
    # Larger in the second half, and just then at its smallest: rms² 1.0 against 1.7.
    assert evaluate(
        swelling(1.0, 1.0, 1.0, 1.0, 2.0, 1.6, 0.8, 0.1), 200, LIMIT, COMMAND_PERIOD_S
    ).grows
    # Comes back once, larger than it began, and is smaller all in all: 2.1 against 0.6.
    assert not evaluate(
        swelling(1.0, 2.0, 1.6, 0.9, 0.1, 1.5, 0.2, 0.1), 200, LIMIT, COMMAND_PERIOD_S
    ).grows


def test_at_the_bound_it_grows_no_further() -> None:
    # The first half at the bound all the time, the second at 0.9 of it: a limit cycle.
    assert evaluate(100.0 * LIMIT * 10.0 * swelling(1.0, 0.9), 200, LIMIT, COMMAND_PERIOD_S).grows
    # It was at the bound and dies out.
    assert not evaluate(
        100.0 * LIMIT * 10.0 * swelling(1.0, 0.9, 0.4, 0.1), 200, LIMIT, COMMAND_PERIOD_S
    ).grows


def sharp(asked: Sequence[float]) -> list[bool]:
    return [b < 1.0 for b in asked]


@pytest.mark.parametrize("guess", [0.2, 0.9, 1.0, 1.1, 5.0])
def test_the_onset_does_not_depend_on_the_guess(guess: float) -> None:
    found = threshold(sharp, guess)
    # Analytic: the middle of the step in which the change is.
    assert found.b == threshold(sharp, 1.0).b
    assert found.b == pytest.approx(1.0, rel=0.51 * STEP)
    assert found.unstable < 1.0 <= found.stable <= 1.0001 * (1.0 + STEP) * found.unstable


def power(b: float) -> int:
    return round(math.log(b) / math.log1p(STEP))


def erring(*powers: int) -> Callable[[Sequence[float]], list[bool]]:
    """An onset between the powers −1 and 0 of the grid, with runs that say the opposite."""
    return lambda asked: [(i < 0) != (i in powers) for i in map(power, asked)]


@pytest.mark.parametrize("guess", [0.5, 0.93, 1.0, 1.08, 2.0])
def test_runs_that_err_move_the_onset_by_a_step_each(guess: float) -> None:
    """A bisection of the same runs ends at any of five changes of sign, 11 % apart."""
    # Analytic: −5 and −3 do not grow, 2, 3 and 6 do: one more than on the other side.
    found = threshold(erring(-5, -3, 2, 3, 6), guess)
    assert math.log(found.b) / math.log1p(STEP) == pytest.approx(-0.5 + 1.0)
    ends = [math.log(b) / math.log1p(STEP) for b in (found.unstable, found.stable)]
    assert ends == pytest.approx([-6.0, 7.0])
    assert found.runs >= 13 + 2 * (AGREEING - 1)


@pytest.mark.parametrize("guess", [0.5, 0.93, 1.0, 1.08, 2.0])
def test_no_run_is_made_that_is_not_needed_one_by_one(guess: float) -> None:
    """The scan as it would be one by one: up to ten that do not grow, down to ten that do."""
    grow, made = erring(-5, -3, 2, 3, 6, 12), []
    nearest, needed = power(guess), set()
    for way, wanted in ((1, False), (-1, True)):
        row, i = 0, nearest
        while row < AGREEING:
            needed.add(i)
            row = row + 1 if grow([math.exp(i * math.log1p(STEP))]) == [wanted] else 0
            i += way

    def counted(asked: Sequence[float]) -> list[bool]:
        made.append([power(b) for b in asked])
        return grow(asked)

    threshold(counted, guess)
    assert sorted(i for asked in made for i in asked) == sorted(needed)
    assert len(made[0]) == 2 * AGREEING - 1


def test_of_runs_that_chance_decides_it_is_the_middle() -> None:
    random = np.random.default_rng(1)

    def by_chance(asked: Sequence[float]) -> list[bool]:
        # A logistic of scale 0.03 in ln b: runs disagree over some 20 %.
        return [random.uniform() < 1.0 / (1.0 + b ** (1.0 / 0.03)) for b in asked]

    found = [math.log(threshold(by_chance, 1.0).b) for _ in range(400)]
    # Statistical, n = 400: the estimate of one has a standard deviation of sqrt(STEP * 0.03).
    deviation = math.sqrt(STEP * 0.03)
    assert np.std(found) == pytest.approx(deviation, rel=0.15)
    assert np.mean(found) == pytest.approx(0.0, abs=4.0 * deviation / 20.0)


def test_an_onset_that_is_nowhere_is_said() -> None:
    with pytest.raises(InputError, match=r"between b = 1 and 8: .* row that do not grow"):
        threshold(lambda asked: [True] * len(asked), 1.0)
    with pytest.raises(InputError, match=r"between b = 0\.12\d and 1: .* row that grow"):
        threshold(lambda asked: [False] * len(asked), 1.0)


FRESH = (
    *(("x", 0.34, 200.0), ("rotation", 0.57, 42.0), ("x", 0.48, 480.0), ("rotation", 0.92, 14.0)),
    *(("x", 0.72, 28.0), ("rotation", 0.97, 1000.0), ("x", 0.71, 380.0), ("rotation", 0.61, 590.0)),
    *(("x", 0.56, 35.0), ("rotation", 0.42, 18.0), ("x", 0.62, 60.0), ("rotation", 0.73, 5.4)),
)
"""The cases of docs/stability.md, written down before any was run."""


def test_the_fresh_cases_are_the_ones_that_were_written_down() -> None:
    assert tuple(drawn(12, 2026)) == FRESH
    old = {(point.axis, point.alpha_rad, point.ratio_per_s) for point in grid()}
    assert not old & set(FRESH)


def test_drawn_cases_are_those_of_their_seed() -> None:
    points = drawn(40, 3)
    assert points[:12] == drawn(12, 3) != drawn(12, 4)
    assert [point.axis for point in points[:4]] == ["x", "rotation", "x", "rotation"]
    assert all(0.2 <= p.alpha_rad <= 1.0 and 5.0 <= p.ratio_per_s <= 1600.0 for p in points)
    assert {p.axis for p in drawn(4, 3, ("rotation",))} == {"rotation"}
    # Statistical, n = 40: as many rays below the middle of the logarithm as above.
    assert 10 <= sum(p.ratio_per_s < math.sqrt(5.0 * 1600.0) for p in points) <= 30


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
        STRIP9, ['compliance.complying=["left","right"]', 'compliance.sensing=["left","right"]']
    )
    led = load_scenario(STRIP9, ['compliance.complying=["left","right"]'])
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
    (run,) = oscillate([ray.held(b)], axis, friction=False)  # type: ignore[arg-type]
    # Golden: 0.02 /s and 0.3 % when this was written; the windows allow 0.1 /s.
    assert run.growth_per_s == pytest.approx(mode.growth_per_s, abs=0.1)
    assert run.frequency_hz == pytest.approx(mode.frequency_hz, rel=0.01)


def test_with_integral_action_a_stiff_sheet_grows_and_swings_as_predicted() -> None:
    """The prediction without it has a decay of 0.3 /s, and 2.5 Hz."""
    stiff = load_scenario(
        "fig6",
        [
            *("imperfections=none", "sheet.rigidity=beam"),
            *("sheet.length_m=0.8", "sheet.width_m=0.3", "sheet.thickness_m=0.001"),
            *("sheet.material=2024-T3", "cell.base_distance_m=1.09", "cell.base_height_m=1.0"),
            *("robot.servo.integral.rate_per_s=10", "compliance.kind=admittance"),
            *('compliance.sensing=["left","right"]', 'compliance.complying=["left","right"]'),
            "compliance.rotation.b=0.5",
            "compliance.rotation.k=10000",
            "compliance.rotation.from_alpha_rad=0",
        ],
    )
    ray = RayLoop(stiff, "rotation", 0.2, 20000.0)
    mode = ray.mode(0.09)
    (run,) = oscillate([ray.held(0.09)], "rotation", friction=False)
    assert run.growth_per_s == pytest.approx(mode.growth_per_s, abs=0.1)
    assert run.frequency_hz == pytest.approx(mode.frequency_hz, rel=0.01)


@pytest.mark.parametrize("friction", [True, False])
def test_with_integral_action_the_onset_is_where_it_is_predicted(friction: bool) -> None:
    ray = RayLoop(load_scenario("fig8", ["imperfections=none"]), "rotation", 0.2, 5.0)
    onset = ray.predict().sampled
    # Golden: 1.1 % when this was written.
    held_at = [ray.held(part * onset) for part in (0.97, 1.03)]
    found = oscillate(held_at, "rotation", friction=friction)
    assert [run.grows for run in found] == [True, False]


def test_without_friction_is_without_stiction_too() -> None:
    found = []
    for excess in (0.0, 0.5):
        settings = ["imperfections=none", f"imperfections.robot.stiction_excess={excess}"]
        ray = RayLoop(load_scenario("fig8", settings), "rotation", 0.2, 5.0)
        found += oscillate([ray.held(0.9)], "rotation", friction=False)
    # Exact: the same run.
    assert found[0] == found[1]


def test_no_unsolved_force_kicks_an_arm_near_rest() -> None:
    ray = RayLoop(FIG9, "x", 0.2, 80.0)
    # Golden: −0.26 /s when this was written, 0.35 /s with MuJoCo's own tolerance.
    (run,) = oscillate([ray.held(0.69)], "x")
    assert run.growth_per_s == pytest.approx(-0.26, abs=0.1)


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
        ({"points": ()}, "points: none given"),
        ({"points": [Point("x", 0.5, -5.0)]}, "ray: -5.0 must be positive"),
        ({"points": [Point("x", math.nan, 5.0)]}, "angle: nan must be positive"),
        ({"points": [Point("x", 3.0, 5.0)]}, r"angle 3\.0"),
        ({"points": [Point("rotation", 1e-3, 5.0)]}, "must be above"),
        ({"workers": 0}, "workers = 0"),
    ],
)
def test_what_makes_no_study_is_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        onset_study(FIG9, **{"points": grid(), **changed})  # type: ignore[arg-type]


def test_a_scenario_without_the_axis_is_refused() -> None:
    with pytest.raises(InputError, match=r"compliance\.x is off"):
        onset_study(load_scenario(STRIP6), grid())
    with pytest.raises(InputError, match="no compliance"):
        onset_study(load_scenario(STRIP9, ["compliance.complying=[]"]), grid())
    with pytest.raises(InputError, match=r"compliance\.x\.k = -1\.0: must be positive"):
        held(FIG9, "x", 0.5, (0.2, -1.0))


def a_case(key: str, ratio: float) -> Case:
    simulated = Simulated(
        b=0.5,
        unstable_b=0.498,
        stable_b=0.502,
        growing_b=0.498,
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
    given = {"points": grid(("x",), (0.5,), (5.0, 80.0)), "workers": 1}
    with pytest.raises(KeyboardInterrupt):
        onset_study(FIG9, **given, folder=tmp_path)  # type: ignore[arg-type]
    found = onset_study(FIG9, **given, folder=tmp_path)  # type: ignore[arg-type]
    assert done == [5.0, 80.0, 80.0]
    assert [case.ratio_per_s for case in found.cases] == [5.0, 80.0]
    # Another scenario is another case.
    onset_study(load_scenario(STRIP9, ["robot.alter.delay_cycles=3"]), **given, folder=tmp_path)  # type: ignore[arg-type]
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
    assert "| x | 0.5 | 80 | 0.5 | -0 to +0 % | 0.55 (+10.0 %) |" in report(found)
    plot_onsets(FIG9, found, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="cannot be written"):
        plot_onsets(FIG9, found, tmp_path / "nowhere" / "map.png")
    assert msgspec.json.decode(msgspec.json.encode(found), type=OnsetStudy) == found


@pytest.mark.parametrize(
    ("name", "expected"),
    [("fig8", {"rotation"}), (STRIP9, {"x", "rotation"}), (STRIP6, {"x", "rotation"})],
)
def test_the_axes_that_comply_are_studied(
    name: str, expected: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: set[str] = set()

    def study(_: Scenario, points: list[Point], **__: object) -> OnsetStudy:
        seen.update(point.axis for point in points)
        raise InputError("enough")

    monkeypatch.setattr(module, "onset_study", study)
    assert CliRunner().invoke(main, ["stability", name, "--validate"]).exit_code == 2
    assert seen == expected


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.001, 0.002, 0.004, 0.008])
@pytest.mark.parametrize("axis", ["x", "rotation"])
def test_the_onset_is_within_a_tenth_of_the_prediction_at_any_command_period(
    axis: Literal["x", "rotation"], period_s: float
) -> None:
    """Without the joints' dry friction, which the loop's model has not: grows below, decays above.

    With a command every millisecond the onset is at 30 Hz, beyond the servos' own 20 Hz.
    """
    ray = RayLoop(load_scenario(STRIP9, [f"robot.command_period_s={period_s}"]), axis, 0.5, 80.0)
    onset = ray.predict().sampled
    below, above = oscillate([ray.held(part * onset) for part in (0.9, 1.1)], axis, friction=False)
    assert below.grows
    assert not above.grows
    # Discretisation-limited: of the decay, over some periods of its own.
    assert above.growth_per_s == pytest.approx(ray.mode(1.1 * onset).growth_per_s, rel=0.3)
