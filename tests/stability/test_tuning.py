"""The search for gains: margins are kept, what is written is the scenario that was found."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from dualbend.evaluation.metrics import peak_by_piece
from dualbend.run.known_sheet import make_admittance
from dualbend.scenario.load import load_scenario
from dualbend.stability.path_prediction import PathPrediction
from dualbend.stability.plant.environment import environments
from dualbend.stability.tuning import (
    Candidate,
    Margin,
    Tuning,
    _knobs,
    _turned,
    min_margin,
    write_scenario,
)
from dualbend.task.bending.run import BendingRun


def test_the_prediction_ranks_as_the_simulation_does() -> None:
    """Golden: without compliance the peaks within a sixth; the compliance takes its part away."""
    scenario = load_scenario("tuned", ["path.end_rad=0.4", "motion.hold_s=0"])
    path = PathPrediction(scenario)
    without = path.peaks(None, path.noise(1))
    quiet = np.zeros_like(path.noise(1))
    found = path.peaks(make_admittance(scenario), quiet)
    plain = peak_by_piece(BendingRun(load_scenario("fig6", ["path.end_rad=0.4"])).run())
    assert without == pytest.approx(plain, rel=1 / 6)
    # The noise-free simulation leaves 0.35 and 0.52.
    assert np.all(found < 0.7 * without)


def test_a_piece_shorter_than_a_cycle_has_no_peak_of_its_own() -> None:
    """At 1 rad/s a cycle is 28 mrad: of 20 pieces of 5 mrad most have no row."""
    scenario = load_scenario(
        "tuned",
        [
            "path={kind='pieces',pieces=20,end_rad=0.1}",
            "motion.speed_rad_per_s=1.0",
            "motion.hold_s=0",
        ],
    )
    path = PathPrediction(scenario)
    found = path.peaks(None, path.noise(1))
    assert 0 < np.count_nonzero(found) < 10
    assert np.isfinite(found).all()


def test_margins_of_the_shipped_scenarios_are_those_required() -> None:
    """Golden: 6 dB and 30 degrees, at the tightest place of the path and at its ends."""
    for name in ("tuned", "tuned-exact"):
        scenario = load_scenario(name)
        margin = min_margin(scenario, environments(scenario, [0.0, 0.5]))
        assert margin.fulfils(Margin(gain_db=6.0, phase_deg=30.0)), (name, margin)


def test_a_knob_changes_one_time_and_stays_in_its_range() -> None:
    config = load_scenario("tuned").compliance
    turned = _turned(config, "x.b", 2.0)
    assert turned is not None
    changed = {k for k, v in _knobs(turned).items() if v != _knobs(config)[k]}
    assert changed == {"x.b"}
    assert _turned(config, "x.b", 1e6) is None


def test_what_is_written_is_what_was_found(tmp_path: Path) -> None:
    scenario = load_scenario("tuned")
    compliance = _turned(scenario.compliance, "x.b", 1.5)
    assert compliance is not None
    found = msgspec.structs.replace(scenario, name="fig6-tuned", compliance=compliance)
    margin = Margin(gain_db=math.inf, phase_deg=math.inf)
    tuning = Tuning(
        scenario=found,
        found=Candidate(compliance=compliance, margin=margin, peaks=(0.01,)),
        tried=1,
        without=(0.04,),
        simulated=((0.01,),),
        verified=margin,
    )
    file = tmp_path / "found.toml"
    write_scenario(tuning, "fig6", file)
    loaded = load_scenario(str(file))
    assert loaded.compliance == compliance
    assert loaded.path == scenario.path
