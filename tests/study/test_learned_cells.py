"""What learning reaches in whole cells, and what limits it: statements of docs/learning.md."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.stability.learning import LearningPrediction
from dualbend.study.learning.series import Series
from dualbend.study.learning.sheet import Sheet
from dualbend.types import SIDES

pytestmark = pytest.mark.slow

FEEDBACK = (
    'compliance={kind="admittance",units="paper",sensing=["left","right"],'
    'complying=["left","right"],rotation={b=0.5,k=10000.0,form="printed"}}'
)
INTEGRAL = (
    'compliance={kind="mass-spring-damper",sensing=["left","right"],'
    'complying=["left","right"],pitch={b=12.0}}'
)


def rms_beyond(run: RunRecord, alpha_rad: float = 0.2) -> float:
    """Return the rms of the moment [N m] of the arm where it is larger, beyond an angle."""
    rows = (run["phase"] == 1) & (run["nominal_alpha"] >= alpha_rad)
    return max(float(np.sqrt(np.mean(run[f"{s}_true_moment_y"][rows] ** 2))) for s in SIDES)


def bent(series: Series, count: int) -> tuple[list[Sheet], list[float]]:
    pairs = [series.next_sheet() for _ in range(count)]
    return [sheet for sheet, _ in pairs], [rms_beyond(run) for _, run in pairs]


@pytest.mark.parametrize("seed", [1, 4])
def test_a_typical_cell_learns_a_tenth_and_keeps_it(seed: int) -> None:
    sheets, rms = bent(Series(load_scenario("learned", seed=seed)), 15)
    ratio = np.divide(sheets[4].peaks_nm, sheets[0].peaks_nm)
    assert (ratio[1:] < 0.2).all()
    assert ratio[0] < 0.1
    assert max(sheets[4].peaks_nm[1:]) < 0.03  # six times the noise of a reading
    assert max(rms[5:]) < 0.01 < 0.1 * rms[0]
    hold = [np.abs(sheet.hold_nm).max() for sheet in sheets[4:]]
    assert np.median(hold) < 4e-3  # a reading's standard deviation is 2 mN m


@pytest.mark.parametrize("true", [0.7, 1.3])
def test_friction_that_is_told_before_the_first_sheet_leaves_less_at_the_start(true: float) -> None:
    """Joints that break away otherwise than is fed forward: what learning cannot follow."""
    robot = f"robot={{coulomb_ratio={true},stiction_excess=0.1}}"
    settings = [f'imperfections={{preset="none",{robot}}}', "path.end_rad=0.3"]
    first = {
        estimate: bent(
            Series(
                load_scenario("learned", [*settings, f"robot.servo.friction_estimate={estimate}"])
            ),
            6,
        )[0][-1].peaks_nm[0]
        for estimate in ("none", "{}")
    }
    assert first["{}"] < 0.4 * first["none"]


def test_the_error_of_a_sensor_is_what_is_learned() -> None:
    """The reading goes to zero; 0.5 % of scale and cross-talk at 35 N leave tens of mN m."""
    series = Series(load_scenario("learned", ["sensor.calibration=none"], seed=4))
    for _ in range(5):
        sheet, run = series.next_sheet()
    held = np.flatnonzero(run["phase"] == 2)[-50:]
    for side in SIDES:
        assert abs(run[f"{side}_filtered_moment_y"][held].mean()) < 0.006
    assert np.abs(sheet.hold_nm).max() > 0.05


def test_eight_times_the_speed_at_no_more_moment_than_with_feedback() -> None:
    feedback = make_run(load_scenario("fig8")).run().metrics["peak_moment"].value
    series = Series(load_scenario("learned-fast"))
    sheets, _ = bent(series, 11)
    assert all(sheet.outcome == "completed" for sheet in sheets)
    assert sheets[-1].speed_rad_per_s >= 8 * load_scenario("fig6").motion.speed_rad_per_s
    run = make_run(series.scenario_of(11), correction=series.correction).run()
    after = run["phase"] >= 1
    largest = max(np.abs(run[f"{side}_true_moment_y"][after]).max() for side in SIDES)
    assert isinstance(feedback, float)
    assert largest < 0.4 * feedback
    assert max(max(sheet.peaks_nm) for sheet in sheets[1:]) < feedback  # on the way up, too
    unlearned = make_run(load_scenario("learned-fast")).run().metrics["peak_moment"].value
    assert isinstance(unlearned, float)
    assert largest < 0.25 * unlearned


def test_without_lead_the_moment_falls_for_five_sheets_and_then_grows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the condition refuses, by its largest contraction to within a tenth."""
    monkeypatch.setattr(LearningPrediction, "refuse_divergence", lambda _: None)
    series = Series(load_scenario("learned", ["imperfections=none", "learning.lead_cycles=0"]))
    _, rms = bent(series, 10)
    assert rms[4] < 0.3 * rms[0]
    growth = (rms[9] / rms[7]) ** 0.5
    assert 1.2 < growth < series.prediction.worst[0]


@pytest.mark.parametrize(("start_rad", "tension_n"), [(0.0, (30.0, 60.0)), (0.1, (0.0, 1.0))])
def test_a_flat_start_builds_up_tension(start_rad: float, tension_n: tuple[float, float]) -> None:
    series = Series(load_scenario("learned", ["imperfections=none", f"path.start_rad={start_rad}"]))
    for _ in range(5):
        _, run = series.next_sheet()
    largest = max(float(run[f"{side}_true_force_x"].max()) for side in SIDES)
    assert tension_n[0] <= max(largest, 0.0) <= tension_n[1]


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("thickness_ratio=1.1", "sensor is at the end of its range"),
        ("modulus_ratio=0.8", "another"),
    ],
)
def test_another_sheet_in_between_changes_nothing_for_the_next(key: str, said: str) -> None:
    """One that is a third stiffer overloads a sensor; the arms stop, and the next one is bent."""
    series = Series(load_scenario("learned"))
    _, rms = bent(series, 6)
    name, value = key.split("=")

    def vary(scenario: Scenario) -> Scenario:
        errors = scenario.imperfections
        sheet = msgspec.structs.replace(errors.sheet, **{name: float(value)})
        return msgspec.structs.replace(
            scenario, imperfections=msgspec.structs.replace(errors, sheet=sheet)
        )

    other, _ = series.next_sheet(vary)
    assert said in other.note
    _, run = series.next_sheet()
    usual = float(np.mean(rms[3:]))
    assert rms_beyond(run) < usual + max(0.2 * usual, 2e-3)  # a noise of 2 mN m


def test_what_grips_leave_that_do_not_repeat_is_what_passes_through_the_feedback() -> None:
    """0.1 mm and 1 mrad, drawn anew for each sheet: a learner adds little to that by averaging.

    The bound: the same grips with the correction that right grips have taught, frozen.
    """
    spread = "task.misalignment={along_spread_m=1e-4,pitch_spread_rad=1e-3}"
    left = {}
    for name, feedback in (("paper", FEEDBACK), ("integral", INTEGRAL)):
        settings = ["imperfections=none", feedback]
        right = Series(load_scenario("learned", settings))
        bent(right, 6)
        series = Series(
            load_scenario("learned", [*settings, spread, "learning.averaged_sheets=10"])
        )
        _, rms = bent(series, 10)
        bound = [
            rms_beyond(make_run(series.scenario_of(i), correction=right.correction).run())
            for i in range(5, 11)
        ]
        left[name], least = (float(np.sqrt(np.mean(np.square(r)))) for r in (rms[4:], bound))
        assert 0.7 * least < left[name] < 1.3 * least + 3e-3
        assert left[name] < 0.2 * rms[0]
    assert left["integral"] < 0.6 * left["paper"]


@pytest.mark.parametrize("arm", ["ur5", "ur10"])
def test_other_arms_that_bear_the_sheet_learn_as_well(arm: str) -> None:
    series = Series(load_scenario("learned", ["imperfections=none", f"robot.model={arm}"]))
    _, rms = bent(series, 5)
    assert rms[4] < 0.02 * rms[0]
