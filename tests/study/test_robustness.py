"""The Monte Carlo study: what is drawn, what is kept, and what is said about it."""

import itertools
import json
import shlex
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scene.observation import Observation
from dualbend.scene.simulation import Simulation
from dualbend.study.robustness.figure import misalignment_bins, plot_success
from dualbend.study.robustness.run import SCENARIO, run_study
from dualbend.study.robustness.summary import command, success_interval, summarise, table
from dualbend.study.robustness.trial import Trial, cause_of, run_one, trial
from dualbend.task.assembly.draws import draw, without_compliance
from support.small_runs import never
from support.stand_in import PWB, a_trial


def trials(n: int = 40) -> list[Trial]:
    return [a_trial(PWB, 7, index, case) for index in range(n) for case in (True, False)]


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
        (load_scenario("pwb", ["task.errors.pickup_x_m=1e-3"]), 7, "another scenario"),
    ):
        with pytest.raises(InputError, match=what):
            run_study(scenario, tmp_path, runs=1, seed=seed, run=a_trial)
    with pytest.raises(InputError, match=r"task\.kind"):
        run_study(load_scenario("fig8"), tmp_path / "other", runs=1, run=a_trial)


# -- one real run --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stopped() -> Trial:
    """A run that ends early, in the grasp: the sheet lies too far off for a jaw to reach it."""
    scenario = load_scenario("pwb", ["task.errors.pickup_x_m=0.03"])
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
    base = load_scenario("pwb", ["task.errors.pickup_x_m=0.03"])
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


def test_a_sheet_that_is_let_go_with_a_hole_beside_its_pin_is_a_failure(tmp_path: Path) -> None:
    """Analytic: a failure has a phase and a cause in the table."""
    reason = "withdraw: not seated: the left middle hole is 3.00 mm off its pin's axis"
    ended: dict[str, Any] = {"outcome": "failed", "phase": "withdraw", "reason": reason}
    row = trial(draw(PWB, 7, 0), 0, success=False, holes_seated=3, cause=cause_of(reason), **ended)
    found = summarise(PWB, 7, [row], tmp_path)
    assert "withdraw: holes not seated" in "\n".join(table(found))


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
