"""A stop: from the speed at the stop to rest in the given time, and held there."""

import numpy as np
import pytest

from dualbend.control.brake import Brakes
from dualbend.control.response import CommandReference, CommandResponse, CommandResponseConfig

PERIOD_S, STEPS, TIME_S = 0.028, 16, 0.1


def commanded(value: float) -> CommandReference:
    rows = np.full((STEPS, 3), value)
    return CommandReference(position=rows, velocity=rows, acceleration=rows)


def test_no_stop_changes_nothing() -> None:
    brakes = Brakes(3, STEPS, period_s=PERIOD_S, time_s=TIME_S)
    reference, place = commanded(1.0), np.ones(3)
    assert brakes.update(reference) is reference
    assert brakes.position(place) is place


def test_a_joint_slows_down_evenly_and_the_others_follow_their_commands() -> None:
    brakes = Brakes(3, STEPS, period_s=PERIOD_S, time_s=TIME_S)
    brakes.stop(np.array([False, True, False]), np.full(3, 0.5), np.full(3, 0.2))
    rows = [brakes.update(commanded(1.0)) for _ in range(6)]
    position, velocity, acceleration = (
        np.concatenate([getattr(row, name) for row in rows])
        for name in ("position", "velocity", "acceleration")
    )
    t = PERIOD_S / STEPS * np.arange(1, 6 * STEPS + 1)
    braking = np.minimum(t, TIME_S)
    # Analytic: v₀ (1 − t/T) and its integral.
    np.testing.assert_allclose(velocity[:, 1], 0.2 * (1.0 - braking / TIME_S), atol=1e-15)
    way = 0.5 + 0.2 * (braking - braking**2 / (2.0 * TIME_S))
    np.testing.assert_allclose(position[:, 1], way, rtol=1e-13)
    assert position[-1, 1] == pytest.approx(0.5 + 0.2 * TIME_S / 2.0, rel=1e-13)
    np.testing.assert_allclose(acceleration[t < TIME_S - 1e-9, 1], -2.0, rtol=1e-12)
    assert not acceleration[t > TIME_S, 1].any()
    assert (position[:, [0, 2]] == 1.0).all()
    np.testing.assert_allclose(brakes.position(np.ones(3)), position[-1])


def test_a_stop_goes_on_from_the_place_and_speed_of_the_response() -> None:
    response = CommandResponse(CommandResponseConfig(), 3, STEPS, period_s=PERIOD_S)
    before = [response.update(np.full(3, 0.01 * i)) for i in range(20)][-1]
    brakes = Brakes(3, STEPS, period_s=PERIOD_S, time_s=TIME_S)
    brakes.stop(np.ones(3, dtype=np.bool_), response.position, response.speed)
    after = brakes.update(response.update(np.zeros(3)))
    # Analytic: the first step's change of place and of speed.
    step = PERIOD_S / STEPS
    slowed = before.velocity[-1] * (1.0 - step / TIME_S)
    np.testing.assert_allclose(after.velocity[0], slowed, rtol=1e-12)
    mean = 0.5 * (before.velocity[-1] + slowed)
    np.testing.assert_allclose(after.position[0] - before.position[-1], mean * step, rtol=1e-9)


def test_a_second_stop_does_not_move_what_has_stopped() -> None:
    brakes = Brakes(2, STEPS, period_s=PERIOD_S, time_s=TIME_S)
    brakes.stop(np.array([True, False]), np.zeros(2), np.ones(2))
    for _ in range(2):
        brakes.update(
            CommandReference(
                position=np.zeros((STEPS, 2)),
                velocity=np.zeros((STEPS, 2)),
                acceleration=np.zeros((STEPS, 2)),
            )
        )
    before = brakes.position(np.zeros(2))[0]
    brakes.stop(np.ones(2, dtype=np.bool_), np.full(2, 9.0), np.ones(2))
    assert brakes.position(np.zeros(2)).tolist() == [before, 9.0]
