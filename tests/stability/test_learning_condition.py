"""|Q (1 − L P)| of the loop's model: what it refuses, and what the physics say of it."""

import functools
import math

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.stability.learning import LearningPrediction, learning_plants, predict_learning
from dualbend.types import SIDES

FEEDBACK = (
    'compliance={kind="admittance",units="paper",sensing=["left","right"],'
    'complying=["left","right"],rotation={b=0.5,k=10000.0,form="printed"}}'
)
ONE_SENSOR = 'compliance={kind="none",sensing=["left"],complying=[]}'


def predicted(*settings: str) -> LearningPrediction:
    return predict_learning(load_scenario("learned", settings))


def test_the_shipped_law_contracts_at_every_angle_and_frequency() -> None:
    found = predicted()
    found.refuse_divergence()
    worst, frequency, alpha = found.worst
    assert found.law.lead_cycles == 9
    assert worst == pytest.approx(0.74, abs=0.02)
    assert frequency == pytest.approx(1.66, abs=0.1)
    assert alpha == 0.1  # where the sheet is flattest


@pytest.mark.parametrize(
    ("setting", "frequency_hz"), [("learning.lead_cycles=0", 1.48), ("learning.gain=2.2", 0.0)]
)
def test_what_would_grow_is_refused_with_its_frequency(setting: str, frequency_hz: float) -> None:
    found = predicted(setting)
    worst, frequency, _ = found.worst
    assert worst > 1.2
    assert frequency == pytest.approx(frequency_hz, abs=0.1)
    with pytest.raises(InputError, match=rf"at {frequency:.2f} Hz.*would grow from sheet to sheet"):
        found.refuse_divergence()


def test_feedback_is_in_the_plant_and_takes_from_the_lead() -> None:
    """At rest a correction costs K/(1 + K/b) with feedback of 1/b: G = 1/K + 1/b."""
    alone, closed = predicted("path.start_rad=0.5"), predicted("path.start_rad=0.5", FEEDBACK)
    compliance = math.pi / 180.0 / 0.5
    expected = np.linalg.inv(alone.stiffness) + compliance * np.eye(2)
    assert np.linalg.inv(closed.stiffness) == pytest.approx(expected, rel=0.03)
    assert closed.law.lead_cycles < alone.law.lead_cycles


def test_the_stiffness_of_two_arms_is_that_of_their_modes() -> None:
    """Symmetric stiffer than antisymmetric; of one sensor the symmetric one, mirrored."""
    symmetric, antisymmetric = predicted().stiffness @ [[1.0, 1.0], [1.0, -1.0]]
    assert symmetric[0] > 1.5 * abs(antisymmetric[1])
    mirrored = predicted(ONE_SENSOR)
    assert mirrored.stiffness.shape == (1, 1)
    assert mirrored.stiffness[0, 0] == pytest.approx(symmetric[0], rel=1e-6)


def test_a_flat_start_contracts_least_where_it_is_flat() -> None:
    worst, _, alpha = predicted("path.start_rad=0.0").worst
    assert alpha < 0.05
    assert worst > predicted().worst[0] + 0.1


def test_one_arm_that_complies_alone_is_refused() -> None:
    with pytest.raises(InputError, match="both arms comply, or none"):
        predicted(FEEDBACK.replace('complying=["left","right"]', 'complying=["left"]'))


def test_a_loop_that_oscillates_teaches_nothing() -> None:
    with pytest.raises(InputError, match=r"path at .* rad: compliance: the loop is predicted unst"):
        predicted(FEEDBACK.replace("b=0.5", "b=0.1"))


@pytest.mark.parametrize("key", ["settle_s", "hold_s"])
def test_a_correction_needs_time_to_come_in_and_a_force_to_be_told(key: str) -> None:
    with pytest.raises(InputError, match=rf"motion.{key} = 0.2: .* at least 0.5 s"):
        predicted(f"motion.{key}=0.2")


def test_a_scenario_without_the_section_learns_nothing() -> None:
    with pytest.raises(InputError, match="'fig6': has no section learning"):
        predict_learning(load_scenario("fig6"))


ARMS = ("ur3", "ur5", "ur10", "panda", "xarm7")
"""Those that reach the path of this sheet."""


@pytest.mark.slow
@pytest.mark.parametrize("arm", ARMS)
def test_the_law_of_any_shipped_arm_contracts(arm: str) -> None:
    assert predicted(f"robot.model={arm}").worst[0] < 1.0


# --- against the physics ---------------------------------------------------------------------

AMPLITUDE_RAD = 2e-3


@functools.cache
def uncorrected(compliance: tuple[str, ...]) -> RunRecord:
    return make_run(load_scenario("learned", ["imperfections=none", *compliance])).run()


def measured(plain: RunRecord, frequency_hz: float, sign: float) -> complex:
    """Return P [N m/rad] of a mode while the sheet is bent from 0.4 to 0.8 rad, by two runs."""
    t, alpha = plain["time"], plain["nominal_alpha"]
    sine = AMPLITUDE_RAD * np.sin(2.0 * math.pi * frequency_hz * t) * np.minimum(t, 1.0)
    moved = make_run(plain.scenario, correction=np.array([sine, sign * sine])).run()
    left, right = (moved[f"{s}_filtered_moment_y"] - plain[f"{s}_filtered_moment_y"] for s in SIDES)
    rows = np.flatnonzero((alpha >= 0.4) & (alpha <= 0.8) & (plain["phase"] == 1))
    weights = np.hanning(rows.size) * np.exp(-2j * math.pi * frequency_hz * t[rows])
    return complex(-(weights @ (left + sign * right)[rows]) / (2.0 * weights @ sine[rows]))


@pytest.mark.slow
@pytest.mark.parametrize("compliance", [(), (FEEDBACK,)], ids=["alone", "feedback"])
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["symmetric", "antisymmetric"])
@pytest.mark.parametrize("frequency_hz", [0.5, 1.0, 2.0, 3.0])
def test_the_contraction_of_the_physics_is_the_predicted_one(
    compliance: tuple[str, ...], sign: float, frequency_hz: float
) -> None:
    plain = uncorrected(compliance)
    scenario = plain.scenario
    law = predict_learning(scenario).law
    z_inverse = np.exp(-2j * math.pi * frequency_hz * COMMAND_PERIOD_S * np.ones(1))
    alphas = np.linspace(0.4, 0.8, 5)
    model = learning_plants(scenario, alphas, z_inverse).mean(axis=0)[0] @ [1.0, sign]
    gain = (law.gain @ [1.0, sign])[0] * z_inverse[0] ** -law.lead_cycles
    expected, found = (
        law.low_pass(z_inverse)[0] * abs(1.0 - gain * plant)
        for plant in (model[0], measured(plain, frequency_hz, sign))
    )
    assert found == pytest.approx(expected, abs=0.1)
