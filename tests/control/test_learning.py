"""Learning from sheet to sheet against linear plants of which the answer is known."""

import itertools
import math

import numpy as np
import pytest
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.controller import Observation
from dualbend.control.learning import (
    CorrectedController,
    LearningConfig,
    LearningLaw,
    replayed,
)
from dualbend.errors import InputError
from dualbend.types import PlanarPose, Vector, Wrench

CYCLES, STIFFNESS = 600, np.array([[16.0, 5.0], [5.0, 16.0]])
DELAY = 6


def law(
    lead: int = DELAY, gain: float = 0.85, ramp: int = 0, stiffness: Vector = STIFFNESS
) -> LearningLaw:
    config = LearningConfig(gain=gain)
    compliance = np.linalg.inv(stiffness)
    return LearningLaw(config, compliance, lead, period_s=COMMAND_PERIOD_S, ramp_cycles=ramp)


def late(values: Vector, delay: int = DELAY) -> Vector:
    """Return series (..., cycles) a delay later, at rest before."""
    return np.concatenate((np.zeros((*values.shape[:-1], delay)), values[..., :-delay]), axis=-1)


def disturbance(frequency_hz: float = 0.2) -> Vector:
    """Return moments (2, cycles) [N m] in the middle of a run, other ones on either arm."""
    t = COMMAND_PERIOD_S * np.arange(CYCLES)
    window = np.exp(-(((t - t.mean()) / 2.0) ** 2))
    wave = np.cos(2.0 * math.pi * frequency_hz * (t - t.mean()))
    return np.array([0.3 * window * wave, -0.1 * window * wave])


def test_on_a_plant_that_is_known_a_gain_of_one_learns_all_in_one_sheet() -> None:
    d, one = disturbance(), law(gain=1.0)
    u = one.update(np.zeros_like(d), d)
    left = d - STIFFNESS @ late(u)
    assert np.abs(left).max() < 1e-3 * np.abs(d).max()  # Q of 0.2 Hz at a cutoff of 3 Hz


@pytest.mark.parametrize(
    ("frequency_hz", "lead", "gain"),
    [(0.5, DELAY, 0.85), (1.0, DELAY, 0.6), (1.5, 3, 0.5), (2.0, 4, 0.7), (1.0, 0, 0.8)],
)
def test_what_is_left_shrinks_by_the_predicted_contraction(
    frequency_hz: float, lead: int, gain: float
) -> None:
    """|Q (1 − L P)| of the law that runs, at the frequency of the moment; also where it grows."""
    found, stiffness = law(lead, gain, stiffness=np.array([[20.0]])), np.array([[20.0]])
    d = disturbance(frequency_hz)[:1]
    z_inverse = np.exp(-2j * math.pi * frequency_hz * COMMAND_PERIOD_S * np.ones(1))
    plant = (z_inverse**DELAY)[:, np.newaxis, np.newaxis] * stiffness
    predicted = float(found.contraction(z_inverse, plant)[0])
    # Of the part that Q lets through: the rest is not learned, whatever the sheets.
    limit = np.zeros_like(d)
    moments = []
    for _ in range(3):
        moments.append(d - stiffness @ late(limit))
        limit = found.update(limit, moments[-1])
    sheets = [np.linalg.norm(b - a) for a, b in itertools.pairwise(moments)]
    assert sheets[1] / sheets[0] == pytest.approx(predicted, rel=0.1)


def test_the_modes_of_two_arms_contract_each_by_itself() -> None:
    z_inverse = np.exp(-2j * math.pi * np.array([0.1, 1.0, 2.5]) * COMMAND_PERIOD_S)
    found = law()
    plant = (z_inverse**DELAY)[:, np.newaxis, np.newaxis] * STIFFNESS
    expected = found.low_pass(z_inverse) * 0.15
    assert found.contraction(z_inverse, plant) == pytest.approx(expected)


def test_q_has_no_phase_and_is_the_filter_that_runs() -> None:
    found = law()
    impulse = np.zeros(CYCLES)
    impulse[CYCLES // 2] = 1.0
    response = found.filtered(impulse)
    assert response == pytest.approx(response[::-1][np.arange(-1, CYCLES - 1)], abs=1e-12)
    frequencies = np.array([0.0, 1.0, 3.0, 6.0, 15.0])
    z_inverse = np.exp(-2j * math.pi * frequencies * COMMAND_PERIOD_S)
    _, measured = signal.freqz(response, worN=2.0 * math.pi * frequencies * COMMAND_PERIOD_S)
    assert found.low_pass(z_inverse) == pytest.approx(np.abs(measured), abs=1e-6)
    assert found.low_pass(z_inverse)[[0, 2]] == pytest.approx([1.0, 0.5])


def test_a_lead_takes_the_moment_from_later_and_repeats_the_last_one() -> None:
    moment = np.zeros((1, CYCLES))
    moment[0, 300:] = 1.0
    early, now = (law(lead, stiffness=np.eye(1)).update(0.0 * moment, moment) for lead in (9, 0))
    assert early[0, 50:500] == pytest.approx(now[0, 59:509], abs=1e-9)
    assert early[0, -1] == pytest.approx(now[0, -1], abs=1e-9)


@pytest.mark.parametrize("shape", [(), (1,), (3,), (2, 3)])
def test_any_leading_shape_is_many_single_pairs(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    u, m = 1e-2 * rng.standard_normal((2, *shape, 2, 80))
    found = law(ramp=10).update(u, m)
    assert found.shape == (*shape, 2, 80)
    for index in np.ndindex(shape):
        assert found[index] == pytest.approx(law(ramp=10).update(u[index], m[index]), abs=1e-15)


def test_corrections_are_bounded_and_begin_at_nothing() -> None:
    found = law(ramp=50).update(np.zeros((2, CYCLES)), np.full((2, CYCLES), 100.0))
    assert np.abs(found).max() == LearningConfig().limit_rad
    assert np.array_equal(found[:, 0], [0.0, 0.0])
    assert np.abs(np.diff(found)).max() < 0.01


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_reading_that_is_no_number_teaches_nothing(wrong: float) -> None:
    moment = np.zeros((2, CYCLES))
    moment[1, 7] = wrong
    with pytest.raises(InputError, match="no number"):
        law().update(np.zeros_like(moment), moment)


def test_a_run_of_a_few_cycles_is_too_short() -> None:
    with pytest.raises(InputError, match="5 cycles is too short"):
        law().update(np.zeros((2, 5)), np.zeros((2, 5)))


def test_what_feedback_did_is_learned_as_what_it_read_is() -> None:
    """Of the same cause, G M, both teach the same."""
    d, found = disturbance(), law()
    nothing = np.zeros_like(d)
    read = found.update(nothing, d)
    assert np.abs(read).max() > 1e-3
    assert found.update(nothing, nothing, np.linalg.inv(STIFFNESS) @ d) == pytest.approx(read)


@pytest.mark.parametrize(("averaged", "expected"), [(1, 2.0 / (2.0 - 0.85)), (1000, 1.0)])
def test_what_differs_from_sheet_to_sheet_is_learned_with_its_noise_or_averaged(
    averaged: int, expected: float
) -> None:
    """White from sheet to sheet, variance 1: a gain γ leaves 2/(2 − γ), a mean nothing more."""
    config = LearningConfig(gain=0.85, averaged_sheets=averaged, limit_rad=0.5)
    one = LearningLaw(config, np.eye(1), 0, period_s=COMMAND_PERIOD_S)
    cells, sheets = 2000, 60
    drawn = 0.05 * np.random.default_rng(1).standard_normal((sheets, cells, 1, 1))
    u = np.zeros((cells, 1, 16))
    for i in range(sheets):
        left = drawn[i] - u
        u = one.update(u, left, sheets=i + 1)
    assert (left / 0.05).var() == pytest.approx(expected, abs=0.1)


# --- what a run does with it -----------------------------------------------------------------


def seen(time_s: float) -> Observation:
    nothing = Wrench(np.zeros((2, 6)), "bending", "grip")
    pose = PlanarPose(np.zeros((2, 3)))
    false = np.zeros((1, 6), dtype=np.bool_)
    return Observation(
        time_s=time_s,
        phase="bend",
        raw=nothing,
        filtered=nothing,
        clipped=false,
        fresh=false[:, 0],
        joints_rad=np.zeros(12),
        measured=pose,
        nominal=pose,
    )


def test_a_correction_is_added_in_pitch_at_its_cycle_and_stays_at_its_end() -> None:
    table = np.array([[0.0, 0.1, 0.2], [0.0, -0.1, -0.3]])

    class Constant:
        def __call__(self, _: Observation) -> Vector:
            return np.ones((2, 6))

    both = CorrectedController(Constant(), table, period_s=COMMAND_PERIOD_S)
    for cycle, expected in ((0, [1.0, 1.0]), (1, [1.1, 0.9]), (2, [1.2, 0.7]), (9, [1.2, 0.7])):
        deviation = both(seen(cycle * COMMAND_PERIOD_S))
        assert deviation[:, 4] == pytest.approx(expected)
        assert np.array_equal(np.delete(deviation, 4, axis=1), np.ones((2, 5)))
    assert not both.saturated.any()


def motion(bending: int, settle: int = 20, hold: int = 30) -> Vector:
    bend = np.linspace(0.1, 1.0, bending + 1)
    return np.concatenate((np.full(settle, 0.1), bend, np.full(hold, 1.0)))


def test_what_was_learned_at_one_speed_is_replayed_at_the_angle_of_another() -> None:
    slow, fast = motion(200), motion(100)
    correction = np.array([np.sin(3.0 * slow), np.cos(2.0 * slow)])
    found = replayed(correction, slow, fast)
    assert found == pytest.approx(np.array([np.sin(3.0 * fast), np.cos(2.0 * fast)]), abs=2e-4)


def test_a_replay_at_the_same_speed_is_the_same_whatever_the_lag() -> None:
    alpha = motion(150)
    correction = np.random.default_rng(2).standard_normal((2, alpha.size))
    for lag in (0, 2, 5):
        inner = slice(10, alpha.size - 10)
        found = replayed(correction, alpha, alpha, lag_cycles=lag)
        assert found[:, inner] == pytest.approx(correction[:, inner], abs=1e-9)
