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
from dualbend.types import SIDES, Vector

FEEDBACK = (
    'compliance={kind="admittance",units="paper",sensing=["left","right"],'
    'complying=["left","right"],rotation={b=0.5,k=10000.0,form="printed"}}'
)
INTEGRAL = (
    'compliance={kind="mass-spring-damper",sensing=["left","right"],'
    'complying=["left","right"],pitch={b=15.0}}'
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


def test_feedback_takes_its_share_of_a_correction_and_shows_it() -> None:
    """At rest a correction costs K/(1 + K/b) with feedback of 1/b, whose turn is 1/b times that."""
    scenario = load_scenario("learned", [FEEDBACK])
    rest = np.exp(-2j * math.pi * 1e-4 * COMMAND_PERIOD_S * np.ones(1))
    found = (each[0, 0].real for each in learning_plants(scenario, np.array([0.5]), rest))
    alone, closed, turned = found
    compliance = math.pi / 180.0 / 0.5
    assert np.linalg.inv(closed) == pytest.approx(
        np.linalg.inv(alone) + compliance * np.eye(2), rel=0.03
    )
    assert turned == pytest.approx(compliance * closed, rel=1e-3)


def test_feedback_that_integrates_is_learned_from() -> None:
    """At rest it leaves no moment to learn from; its own turn is all that a correction lacks."""
    found = predicted(INTEGRAL)
    found.refuse_divergence()
    assert found.contraction[:, 0] == pytest.approx(0.15, abs=0.01)  # 1 − γ
    with pytest.raises(InputError, match="would grow"):
        predicted(INTEGRAL.replace("b=15.0", "b=7.0")).refuse_divergence()


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


def measured(plain: RunRecord, frequency_hz: float, sign: float) -> tuple[complex, complex]:
    """Return P [N m/rad] and D of a mode while the sheet is bent from 0.4 to 0.8 rad, by two runs.

    What moment and feedback's turn lose per correction.
    """
    t, alpha = plain["time"], plain["nominal_alpha"]
    sine = AMPLITUDE_RAD * np.sin(2.0 * math.pi * frequency_hz * t) * np.minimum(t, 1.0)
    corrections = np.array([sine, sign * sine])
    moved = make_run(plain.scenario, correction=corrections).run()
    rows = np.flatnonzero((alpha >= 0.4) & (alpha <= 0.8) & (plain["phase"] == 1))
    weights = np.hanning(rows.size) * np.exp(-2j * math.pi * frequency_hz * t[rows])

    def lost(name: str, added: Vector) -> complex:
        left, right = (
            moved[f"{side}_{name}"] - plain[f"{side}_{name}"] - own
            for side, own in zip(SIDES, added, strict=True)
        )
        return complex(-(weights @ (left + sign * right)[rows]) / (2.0 * weights @ sine[rows]))

    return lost("filtered_moment_y", 0.0 * corrections), lost("deviation_alpha", corrections)


@pytest.mark.slow
@pytest.mark.parametrize(
    "compliance", [(), (FEEDBACK,), (INTEGRAL,)], ids=["alone", "feedback", "integral"]
)
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["symmetric", "antisymmetric"])
@pytest.mark.parametrize("frequency_hz", [0.5, 1.0, 2.0, 3.0])
def test_the_contraction_of_the_physics_is_the_predicted_one(
    compliance: tuple[str, ...], sign: float, frequency_hz: float
) -> None:
    plain = uncorrected(compliance)
    scenario = plain.scenario
    law = predict_learning(scenario).law
    z_inverse = np.exp(-2j * math.pi * frequency_hz * COMMAND_PERIOD_S * np.ones(1))
    _, *plants = learning_plants(scenario, np.linspace(0.4, 0.8, 5), z_inverse)
    model = [(each.mean(axis=0)[0] @ [1.0, sign])[0] for each in plants]
    gain = (law.gain @ [1.0, sign])[0]
    expected, found = (
        law.low_pass(z_inverse)[0]
        * abs(1.0 - z_inverse[0] ** -law.lead_cycles * (gain * plant + law.config.gain * turn))
        for plant, turn in (model, measured(plain, frequency_hz, sign))
    )
    assert found == pytest.approx(expected, abs=0.1)
