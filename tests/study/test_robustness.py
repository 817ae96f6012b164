"""The Monte Carlo study: what is drawn, what is kept, and what is said about it."""

import itertools
import json
import math
import shlex
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.assembly import ErrorsConfig, SpreadConfig
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.scene.simulation import Observation, Simulation
from dualbend.study.robustness.figure import misalignment_bins, plot_success
from dualbend.study.robustness.run import SCENARIO, run_study
from dualbend.study.robustness.summary import command, success_interval, summarise, table
from dualbend.study.robustness.trial import (
    NOT_SEATED,
    Trial,
    assembly_of,
    cause_of,
    draw,
    misalignment,
    run_one,
    trial,
    without_compliance,
)
from support.stand_in import PWB, a_trial, never


def with_errors(**errors: float) -> Scenario:
    changed = msgspec.structs.replace(assembly_of(PWB), errors=ErrorsConfig(**errors))
    return msgspec.structs.replace(PWB, assembly=changed)


def trials(n: int = 40) -> list[Trial]:
    return [a_trial(PWB, 7, index, case) for index in range(n) for case in (True, False)]


# -- draws ---------------------------------------------------------------------------------------


def test_draws_have_the_spread_that_the_scenario_gives() -> None:
    """Statistical, n = 2000: a mean is within 4 σ/√n, a standard deviation within 4/√(2n) = 6 %."""
    n, spread = 2000, SpreadConfig()
    drawn = [assembly_of(draw(PWB, 3, i)) for i in range(n)]
    errors = {
        name: np.array([getattr(d.errors, name) for d in drawn])
        for name in ErrorsConfig.__struct_fields__
    }
    for name in ("pickup_x_m", "pickup_y_m", "pickup_yaw_rad"):
        sigma = getattr(spread, name)
        assert abs(errors[name].mean()) < 4.0 * sigma / math.sqrt(n)
        assert errors[name].std() == pytest.approx(sigma, rel=4.0 / math.sqrt(2 * n))
    for name in ("thickness", "modulus", "friction"):
        sigma, factor = getattr(spread, name), errors[f"{name}_factor"]
        assert abs(factor.mean() - 1.0) < 4.0 * sigma / math.sqrt(n)
        # A log-normal's tail is heavier: 20 % makes the deviation's own error 1.2 times larger.
        assert factor.std() == pytest.approx(sigma, rel=1.2 * 4.0 / math.sqrt(2 * n))
        assert factor.min() > 0.0
    holes = np.array([d.layout.holes.errors_m for d in drawn])
    assert holes.std() == pytest.approx(spread.hole_m, rel=4.0 / math.sqrt(16 * n))
    # What is drawn apart is independent: a correlation is within 4/√n.
    columns = np.column_stack((*errors.values(), holes.reshape(n, -1)))
    correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert np.abs(correlation).max() < 4.0 / math.sqrt(n)


def test_the_robots_believe_what_they_believed() -> None:
    """Analytic: only the truth, and the noise's seed, differ from the scenario."""
    drawn = draw(PWB, 1, 5)
    config, nominal = assembly_of(drawn), assembly_of(PWB)
    replace = msgspec.structs.replace
    holes = replace(config.layout.holes, errors_m=nominal.layout.holes.errors_m)
    believed = replace(config, errors=nominal.errors, layout=replace(config.layout, holes=holes))
    assert replace(drawn, assembly=believed, seed=PWB.seed) == PWB
    true, sheet = config.errors.true_sheet(PWB.sheet.sheet()), PWB.sheet.sheet()
    factor = config.errors.thickness_factor
    assert true.mass_kg / sheet.mass_kg == pytest.approx(factor, rel=1e-12)
    assert true.bending_stiffness_nm2 / sheet.bending_stiffness_nm2 == pytest.approx(
        config.errors.modulus_factor * factor**3, rel=1e-12
    )


def test_a_draw_depends_on_its_own_number_and_on_no_other_width() -> None:
    """Analytic: the same draw, alone or among many; draws of other numbers and seeds differ."""
    assert draw(PWB, 1, 5) == draw(PWB, 1, 5)
    seen = {msgspec.json.encode(draw(PWB, seed, i)) for seed in (1, 2) for i in range(20)}
    assert len(seen) == 40
    spread = msgspec.structs.replace(assembly_of(PWB).spread, pickup_x_m=0.0, friction=0.0)
    narrow = msgspec.structs.replace(assembly_of(PWB), spread=spread)
    errors = assembly_of(draw(msgspec.structs.replace(PWB, assembly=narrow), 1, 5)).errors
    wide = assembly_of(draw(PWB, 1, 5)).errors
    assert errors == msgspec.structs.replace(wide, pickup_x_m=0.0, friction_factor=1.0)


def test_errors_that_the_scenario_has_stay_the_mean() -> None:
    """Analytic: an offset is added, a factor multiplied."""
    base, moved = PWB, with_errors(pickup_y_m=1e-3, modulus_factor=1.5)
    plain, errors = (assembly_of(draw(s, 1, 2)).errors for s in (base, moved))
    assert errors.pickup_y_m - plain.pickup_y_m == pytest.approx(1e-3, rel=1e-12)
    assert errors.modulus_factor / plain.modulus_factor == pytest.approx(1.5, rel=1e-12)
    assert errors.pickup_x_m == plain.pickup_x_m


def test_misalignment_is_the_distance_of_the_worst_hole() -> None:
    """Analytic: a shift moves all holes alike, a turn the outer ones by 2 s₁ sin(ψ/2)."""
    assert misalignment(with_errors(pickup_x_m=3e-4, pickup_y_m=-4e-4)) == pytest.approx(5e-4)
    turned = with_errors(pickup_yaw_rad=0.01)
    assert misalignment(turned) == pytest.approx(2.0 * 0.14 * math.sin(0.005), rel=1e-9)
    both = with_errors(pickup_yaw_rad=0.01, pickup_y_m=1e-3)
    assert misalignment(both) == pytest.approx(1e-3 + 0.14 * math.sin(0.01), rel=1e-3)


@pytest.mark.parametrize("name", SpreadConfig.__struct_fields__)
def test_a_negative_width_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=rf"assembly\.spread\.{name} = -0\.1"):
        load_scenario("pwb", [f"assembly.spread.{name}=-0.1"])


# -- the study -----------------------------------------------------------------------------------


@pytest.mark.usefixtures("in_process")
def test_what_is_done_is_not_repeated(tmp_path: Path) -> None:
    """Analytic: the trials by draw, with compliance first; fewer draws are the first ones."""
    assert run_study(PWB, tmp_path, runs=3, seed=7, run=a_trial) == trials(3)
    assert run_study(PWB, tmp_path, runs=2, seed=7, run=never) == trials(2)
    assert run_study(PWB, tmp_path, runs=4, seed=7, run=a_trial) == trials(4)


@pytest.mark.usefixtures("in_process")
def test_the_folder_of_another_study_is_refused(tmp_path: Path) -> None:
    run_study(PWB, tmp_path, runs=1, seed=7, run=a_trial)
    for scenario, seed, what in (
        (PWB, 8, "another seed .*seed = 7, now 8"),
        (with_errors(pickup_x_m=1e-3), 7, "another scenario"),
    ):
        with pytest.raises(InputError, match=what):
            run_study(scenario, tmp_path, runs=1, seed=seed, run=a_trial)
    with pytest.raises(InputError, match="has no assembly"):
        run_study(load_scenario("fig8"), tmp_path / "other", runs=1, run=a_trial)


# -- one real run --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stopped() -> Trial:
    """A run that ends early, in the grasp: the sheet lies too far off for a jaw to reach it."""
    scenario = load_scenario("pwb", ["assembly.errors.pickup_x_m=0.03"])
    return run_one(scenario, 1, 0, True)


def test_a_real_run_says_in_which_phase_it_failed_and_why(stopped: Trial) -> None:
    """Analytic but for the phase: nothing is between one pair of jaws."""
    assert (stopped.success, stopped.outcome, stopped.phase) == (False, "aborted", "grasp")
    assert stopped.cause == "sheet not gripped"
    assert stopped.holes_seated == 0
    assert stopped.peak_pin_force_n == 0.0
    assert stopped.misalignment_m > 0.029


def test_the_command_makes_the_same_run_again(stopped: Trial, tmp_path: Path) -> None:
    """Analytic: its words, loaded, are the drawn scenario."""
    base = load_scenario("pwb", ["assembly.errors.pickup_x_m=0.03"])
    (tmp_path / SCENARIO).write_text(base.to_toml(), encoding="utf-8")
    rigid = msgspec.structs.replace(stopped, compliance=False)
    for case, expected in (
        (stopped, draw(base, 1, 0)),
        (rigid, without_compliance(draw(base, 1, 0))),
    ):
        words = shlex.split(command(case, tmp_path))
        settings = [b for a, b in itertools.pairwise(words) if a == "--set"]
        seed = int(words[words.index("--seed") + 1])
        assert load_scenario(words[2], settings, seed) == expected


def test_a_run_that_cannot_be_made_is_a_trial() -> None:
    """Analytic: a bending angle outside the plan's range is refused before the run."""
    found = run_one(load_scenario("pwb", ["path.end_rad=0.02"]), 1, 0, True)
    assert (found.outcome, found.phase, found.cause) == ("refused", "before the run", "refused")
    assert "path.end_rad = 0.02" in found.reason
    assert found.peak_pin_force_n is None


def test_a_run_that_raises_is_a_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """Analytic: the study goes on, and says in which phase the error was."""
    observe = Simulation.observe

    def raising(simulation: Simulation) -> Observation:
        if simulation.data.time > 0.1:
            raise ZeroDivisionError("by nothing")
        return observe(simulation)

    monkeypatch.setattr(Simulation, "observe", raising)
    found = run_one(PWB, 1, 0, True)
    assert (found.outcome, found.phase, found.cause) == ("error", "approach", "error")
    assert found.reason == "ZeroDivisionError: by nothing"


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        ("seat middle: the middle holes did not find their pins in 7", "middle holes not found"),
        ("unfold: the force on the outer_left pin is 41.0 N, above 40 N", "force on a pin"),
        ("lower: the force on the outer_left hole edge is 41.0 N", "force on a hole's edge"),
        ("following error of left_joint1 is 0.03 rad, above 0.02", "following error"),
        ("something new", "other"),
    ],
)
def test_reasons_are_classed(reason: str, cause: str) -> None:
    assert cause_of(reason) == cause


# -- what is said --------------------------------------------------------------------------------


def test_the_interval_is_the_exact_one() -> None:
    """Analytic: without a failure, its lower end p has pⁿ = 0.025; symmetric in what is counted."""
    low, high = success_interval(40, 40)
    assert high == 1.0
    assert low**40 == pytest.approx(0.025, rel=1e-9)
    assert success_interval(0, 40) == pytest.approx((0.0, 1.0 - low), abs=1e-12)
    assert success_interval(0, 0) == (0.0, 1.0)


def test_the_summary_counts_and_compares_the_same_draws(tmp_path: Path) -> None:
    """Analytic: counts are those of the rows; the forces' ratio is the stand-in's 1/4."""
    rows = trials(40)
    found = summarise(PWB, 7, rows, tmp_path)
    json.dumps(found, allow_nan=False)
    k = {case: sum(t.success for t in rows if t.compliance == case) for case in (True, False)}
    for case, name in ((True, "with"), (False, "without")):
        of = found["compliance"][name]
        assert (of["n"], of["successes"], of["rate"]) == (40, k[case], k[case] / 40)
        assert sum(row["count"] for row in of["failures"]) == len(of["failed"]) == 40 - k[case]
        assert of["peak_pin_force_n"]["completed"]["n"] == k[case]
    assert 0 < k[False] < k[True]
    pairs = found["pairs"]
    # The stand-in with compliance succeeds wherever the one without does.
    assert (pairs["only_with"], pairs["only_without"]) == (k[True] - k[False], 0)
    assert pairs["p_value"] == pytest.approx(2.0 * 0.5 ** pairs["only_with"])
    assert pairs["pin_force_ratio"]["median"] == pytest.approx(0.25)
    assert pairs["pin_force_ratio"]["n"] == k[False]
    text = "\n".join(table(found))
    assert f"{k[True]}/40" in text
    assert "only with" in text


@pytest.mark.usefixtures("in_process")
def test_a_scenario_without_compliance_has_one_case(tmp_path: Path) -> None:
    """Analytic: there is nothing to compare, and no pair."""
    rigid = without_compliance(PWB)
    rows = run_study(rigid, tmp_path, runs=2, seed=7, run=a_trial)
    assert [row.compliance for row in rows] == [False, False]
    found = summarise(rigid, 7, rows, tmp_path)
    assert (list(found["compliance"]), found["pairs"]) == (["without"], None)
    assert table(found)


def test_a_run_that_completes_with_a_hole_beside_its_pin_is_a_failure(tmp_path: Path) -> None:
    """Analytic: a failure has a phase and a cause in the table."""
    ended: dict[str, Any] = {"outcome": "completed", "phase": "after the run", "cause": NOT_SEATED}
    row = trial(draw(PWB, 7, 0), 0, success=False, holes_seated=3, **ended)
    found = summarise(PWB, 7, [row], tmp_path)
    assert found["compliance"]["with"]["failed"][0]["reason"] == NOT_SEATED
    assert "after the run: holes not seated" in "\n".join(table(found))


@pytest.mark.parametrize("n", [1, 9, 40])
def test_the_picture_is_written_for_few_and_many_draws(n: int, tmp_path: Path) -> None:
    """Analytic: bins hold equally many, at least eight where there are as many."""
    rows = trials(n)
    far = np.array([row.misalignment_m for row in rows if row.compliance])
    edges = misalignment_bins(far)
    counts, _ = np.histogram(far, edges)
    assert counts.sum() == n
    assert counts.min() >= min(8, n)
    plot_success(rows, PWB, tmp_path / "success.png")
    assert (tmp_path / "success.png").read_bytes()[:4] == b"\x89PNG"
