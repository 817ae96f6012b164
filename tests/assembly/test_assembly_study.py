"""The study of the assembly: its designs, what it calls safe, its tables, and that it goes on."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from assembly import study
from assembly.case import Case, Ran, ran, run_case
from assembly.faults import EVENTS, FAULT_FREE, STANDING, fault_free, faults
from assembly.parts import ARMS, LARGEST_M, LARGEST_RAD, PARTS, Part
from assembly.study import run_part
from assembly.table import case_table, wrong
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HOLES
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.program.motions import PHASES
from dualbend.task.assembly.run import columns as columns_of
from support.rows import written_run

CASE = Case("case", 1)
TIMES = {phase: (10.0 * i, 10.0 * i + 4.0) for i, phase in enumerate(PHASES)}


def made_up(case: Case = CASE, outcome: str = "completed", **ended: object) -> Ran:
    fine = {"pin_force_over_limit": 0.4, "edge_force_over_limit": 0.2, "strain_over_yield": 0.2}
    return Ran(case=case, outcome=outcome, **{"pin_force_n": 16.0, **fine, **ended})  # type: ignore[arg-type]


# --- designs ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PARTS)
def test_every_case_changes_something_and_can_be_loaded(name: str) -> None:
    cases = list(PARTS[name].design(1 if PARTS[name].lays else 8))
    assert len(cases) == len(set(cases))
    for case in cases:
        loaded = load_scenario(case.scenario, case.settings, case.seed)
        if "learnt, pwb" not in case.name and "puma560" not in case.name:
            assert loaded != load_scenario(case.scenario, seed=case.seed) or name == "layouts"


@pytest.mark.parametrize("name", ["gross", "seats"])
def test_a_draw_does_not_depend_on_how_many_there_are(name: str) -> None:
    few, many = (list(PARTS[name].design(n)) for n in (5, 9))
    assert few == many[:5]
    assert [case.seed for case in many] == list(range(1, 10))


def test_gross_errors_are_uniform_within_their_bounds() -> None:
    most = np.array([LARGEST_M, LARGEST_M, LARGEST_RAD])
    settings = [case.settings for case in PARTS["gross"].design(400)]
    drawn = np.array([[float(one.partition("=")[2]) for one in each] for each in settings]) / most
    assert np.abs(drawn).max() <= 1.0
    # Statistical: of a uniform draw, 1/√3; four standard errors of 400.
    np.testing.assert_allclose(drawn.std(axis=0), 1 / np.sqrt(3), rtol=4 * 0.45 / np.sqrt(400))


def test_half_of_the_seats_can_be_seated_and_of_the_others_each_kind_is_as_often() -> None:
    found = Counter(case.name for case in PARTS["seats"].design(80))
    assert found.pop("can be seated") == 40
    assert list(found.values()) == [10] * 4


def test_a_layout_is_bent_as_shipped_where_it_can_be_and_else_at_the_best_angle() -> None:
    bent = {case.name: case.settings[3:] for case in PARTS["layouts"].design(1)}
    assert len(bent) == 6 * 4 * 3
    assert bent["sheet 0.5 mm, clearance 0.2 mm, pins 4.76 mm"] == ()
    (best,) = bent["sheet 0.5 mm, clearance 0.05 mm, pins 4.76 mm"]
    # The plan's: between 0.104 and 0.138 rad.
    assert float(best.removeprefix("path.end_rad=")) == pytest.approx(0.113, abs=1e-3)
    # Refused: there is no angle.
    assert bent["sheet 1.5 mm, clearance 0.05 mm, pins 4.76 mm"] == ()


def test_every_arm_is_turned_and_does_both_jobs() -> None:
    cases = list(PARTS["arms"].design(2))
    assert len(cases) == len(ARMS) * 3 * 2 * 2
    yaws = {load_scenario(c.scenario, c.settings).cell.base_yaw_rad for c in cases}
    # Degrees, in six digits.
    assert sorted(np.degrees([y for y in yaws if y])) == pytest.approx([45.0, 137.0], abs=1e-3)


# --- faults -------------------------------------------------------------------------------------


def test_events_happen_in_the_middle_of_every_phase_on_either_side() -> None:
    free = [made_up(case, phases=TIMES) for case in fault_free(2)]
    cases = list(faults(2, free))
    assert len(cases) == len(set(cases)) == (len(EVENTS) * len(PHASES) + len(STANDING)) * 2 * 2
    dropped = next(case for case in cases if case.name == "dropped sheet in grasp")
    # By hand: the second phase, from 10 to 14 s; odd seeds on the right.
    event = load_scenario("pwb", dropped.settings).imperfections.events.power_failure
    assert event is not None
    assert (event.at_s, event.side) == (12.0, "right")
    lost = next(case for case in cases if case.name == "lost sensor in lift" and case.seed == 2)
    sensor = load_scenario("pwb", lost.settings).imperfections.sensor
    assert (sensor.stuck, sensor.stuck_from_s) == (("left",), 22.0)
    stopped = next(case for case in cases if case.name == "stopped arm in approach")
    stop = load_scenario("pwb", stopped.settings).imperfections.events.arm_stop
    assert stop is not None
    assert stop.at_s == 2.0


def test_a_phase_that_the_run_without_faults_does_not_have_gets_none() -> None:
    free = [made_up(case, phases={"lift": (4.0, 5.0)}) for case in fault_free(1)]
    names = [case.name for case in faults(1, free) if case.scenario == "pwb"]
    assert names == [*(f"{event.name} in lift" for event in EVENTS), *STANDING]


def test_some_faults_are_those_of_all_and_need_runs_without_them_for_events_alone() -> None:
    kinds = ("thick pin", "stopped arm")
    assert list(fault_free(2, kinds[:1])) == []
    free = [made_up(case, phases=TIMES) for case in fault_free(2)]
    some = [case for case in faults(2, free) if case.name.startswith(kinds)]
    assert list(faults(2, free, kinds)) == some


def test_only_faults_are_chosen_from(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--only thick pin: is for faults alone, gross has none"):
        run_part("gross", tmp_path, 1, only=["thick pin"])


def test_standing_faults_take_both_signs_and_every_pin() -> None:
    missing = {load(STANDING["missing pin"](seed)).pins.missing for seed in range(1, 5)}
    assert missing == {(hole,) for hole in HOLES}
    thick = {load(STANDING["thick pin"](seed)).pins.thicker_m for seed in range(1, 5)}
    assert len(thick) == 4
    # Exact: more than the clearance.
    assert {max(each) for each in thick} == {3e-4}
    bent = [load_scenario("pwb", STANDING["bent sheet"](seed)) for seed in (1, 2)]
    assert [one.imperfections.sheet.curvature_per_m for one in bent] == [0.5, -0.5]


def load(settings: tuple[str, ...]) -> object:
    return assembly_of(load_scenario("pwb", settings)).layout


# --- how a run ended ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("run", "safe"),
    [
        (made_up(), True),
        (made_up(outcome="aborted", reason="grasp: nothing is between the left jaws"), True),
        (made_up(outcome="refused", reason="out of reach", pin_force_over_limit=None), True),
        (made_up(outcome="failed", reason="withdraw: not seated: there is no pin"), True),
        (made_up(outcome="aborted"), False),  # without a reason
        (made_up(outcome="error", reason="ValueError: a bug"), False),
        (made_up(pin_force_over_limit=1.01), False),
        (made_up(outcome="aborted", reason="lower: why", edge_force_over_limit=1.01), False),
        (made_up(outcome="protective_stop", reason="why", strain_over_yield=1.01), False),
    ],
)
def test_a_safe_end_is_one_with_a_reason_and_nothing_broken(run: Ran, safe: bool) -> None:
    assert run.safe is safe


def test_a_run_tells_its_peaks_over_their_limits_and_its_longest_phases() -> None:
    scenario = load_scenario("pwb", ["imperfections=none", "task.errors.modulus_factor=2"])
    lower, unfold, stopped = PHASES.index("lower"), PHASES.index("unfold"), len(PHASES)
    result = written_run(
        scenario,
        {
            "phase": [lower, unfold, lower, lower, stopped],
            "attempt": [0, 0, 1, 1, np.nan],
            "time": 0.028 * np.arange(5),
            "pin_force_outer_left": [1.0, 10.0, 3.0, 2.0, np.nan],
            "edge_force_outer_left": [1.0, 8.0, 3.0, 2.0, np.nan],
            "bend_010": [0.0, 0.04, 0.0, 0.0, 0.0],
        },
        columns_of(scenario),
        outcome="protective_stop",
        reason="the left arm stops",
    )
    found = ran(CASE, result)
    # Exact: over 40 N.
    assert (found.pin_force_n, found.pin_force_over_limit) == (10.0, 0.25)
    assert found.edge_force_over_limit == 0.2
    assert (found.phase, found.retries, found.holes_seated) == ("lower", 1, 0)
    assert found.phases["lower"] == pytest.approx((0.056, 0.112))
    assert found.phases["unfold"] == pytest.approx((0.028, 0.056))
    # Analytic: κ t/2 of one hinge of 20, over the yield strain of twice the modulus.
    strain = 0.04 / (scenario.sheet.length_m / 20) * scenario.sheet.thickness_m / 2
    limit = scenario.limit_strain
    assert limit is not None
    assert found.strain_over_yield == pytest.approx(strain / (0.5 * limit), rel=0.05)
    # What a stopped arm still does to the pins counts.
    after = ran(CASE, result, (50.0, 0.0))
    assert (after.pin_force_over_limit, after.safe) == (1.25, False)


def test_a_sheet_that_was_let_go_unseated_is_a_false_success() -> None:
    off = np.zeros((4, 3))
    off[2, 2] = 2e-3
    scenario = load_scenario("pwb", ["imperfections=none"])
    for laid, wrongly in ((off, 1), (np.zeros((4, 3)), 0)):
        result = written_run(scenario, {"phase": [0, 12]}, columns_of(scenario), laid=(laid,))
        found = ran(CASE, result)
        assert (found.false_seated, found.false_unseated) == (wrongly, 0)
        assert found.holes_seated == 4 - wrongly


def test_a_run_that_is_refused_and_one_that_stops_are_answers() -> None:
    refused = run_case(Case("", 1, (), "pwb-impossible"))
    assert (refused.outcome, refused.safe, refused.pin_force_n) == ("refused", True, None)
    missed = run_case(Case("", 1, STANDING["missed grasp"](1)))
    assert (missed.outcome, missed.phase, missed.safe) == ("aborted", "grasp", True)
    assert missed.ended == "aborted in grasp: sheet not gripped"
    assert list(missed.phases) != list(TIMES)


# --- tables -------------------------------------------------------------------------------------


def test_a_table_counts_each_name_and_all() -> None:
    runs = [
        *(made_up(Case("a", seed)) for seed in (1, 2, 3)),
        made_up(Case("b", 1), "aborted", reason="lower: not done after 9 s", phase="lower"),
        made_up(Case("b", 2), pin_force_n=44.0, pin_force_over_limit=1.1, false_seated=1),
    ]
    a, b, every = case_table(runs).rows
    assert a[:6] == ["a", 3, "3/3", "29.2-100.0 %", "3/3", "29.2-100.0 %"]
    assert b[2] == b[4] == "1/2"
    assert (b[6], b[9]) == (1, 44.0)
    assert b[-1] == "1 aborted in lower: took too long; 1 completed"
    assert every[:3] == ["all", 5, "4/5"]


def test_what_is_not_as_it_must_be_is_listed_with_a_command_that_repeats_it() -> None:
    settings = STANDING["thick pin"](1)
    failed = made_up(
        Case("thick", 3, settings), "failed", reason="lower: 82.8 N", edge_force_over_limit=2.07
    )
    stopped = made_up(outcome="aborted", reason="lower: given up")
    (item,) = wrong([made_up(), stopped, failed], lays=False)
    assert "thick, seed 3: unsafe: failed, lower: 82.8 N (force on a hole's edge 2.07" in item
    command = shlex.split(item.split("`")[1])
    assert command[:5] == ["dualbend", "run", "pwb", "--seed", "3"]
    assert tuple(command[6::2]) == settings
    assert len(list(wrong([made_up(), stopped, failed], lays=True))) == 2
    sunk = made_up(outcome="failed", reason="lower: which no metal does")
    assert next(wrong([sunk], lays=False)).startswith(
        "* case, seed 1: failed: failed, lower: which"
    )
    refused = made_up(outcome="refused", reason="no angle")
    assert not list(wrong([refused], lays=True))


# --- the study ----------------------------------------------------------------------------------


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Case]:
    """Return the cases whose runs were made, each at once and laid."""
    made: list[Case] = []

    def here(tasks: Mapping[Case, tuple[Case]], _: object) -> Iterator[tuple[Case, Ran]]:
        for (case,) in tasks.values():
            made.append(case)
            yield case, made_up(case, phases=TIMES)

    monkeypatch.setattr(study, "in_processes", lambda _: here)
    return made


def test_a_part_goes_on_where_it_was(tmp_path: Path, made: list[Case]) -> None:
    first = run_part("corners", tmp_path, 1)
    again = run_part("corners", tmp_path, 2)
    assert len(first) == 8
    assert len(again) == len(made) == 16  # none twice
    assert {run.case for run in first} < {run.case for run in again}


def test_faults_come_after_the_runs_without(tmp_path: Path, made: list[Case]) -> None:
    runs = run_part("faults", tmp_path, 2)
    free = [case for case in made if case.name == FAULT_FREE]
    assert made[: len(free)] == free == list(fault_free(2))
    assert [run.case for run in runs] == made[len(free) :]


def test_each_part_has_its_number_of_runs(tmp_path: Path, made: list[Case]) -> None:
    short = Part(about="", count=3, design=PARTS["corners"].design)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PARTS, "corners", short)
        assert len(run_part("corners", tmp_path)) == 3 * 8


def test_it_needs_nothing_that_draws_nor_other_arms() -> None:
    absent = ("rerun", "example_robot_data", "trimesh", "collada", "matplotlib", "bokeh", "PIL")
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({absent})); sys.path[:0] = {sys.path!r}; "
        "import assembly.study, assembly.table; from dualbend.run.make import make_run; "
        "from dualbend.scenario.load import load_scenario; make_run(load_scenario('pwb'))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
