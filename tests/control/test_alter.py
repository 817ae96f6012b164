"""The command clock, the transport delay and the path modification."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from dualbend.control import clock
from dualbend.control.alter import AlterMode, PathModification
from dualbend.control.delay import TransportDelay
from dualbend.errors import InputError
from dualbend.types import PlanarPose

T = clock.COMMAND_PERIOD_S


@given(st.integers(1, 1000))
def test_every_whole_fraction_of_the_period_is_accepted(count: int) -> None:
    # Exact: a count.
    assert clock.steps_per_cycle(T / count, T) == count
    assert clock.steps_per_cycle(T / count * (1 + 5e-10), T) == count


@pytest.mark.parametrize(
    ("step_s", "nearest"),
    [(0.001001, ("0.001 s (28 steps)", "27 steps")), (0.003, ("10 steps", "9 steps"))],
)
def test_a_step_that_does_not_divide_the_period_names_both_neighbours(
    step_s: float, nearest: tuple[str, ...]
) -> None:
    with pytest.raises(ValueError, match="does not divide") as caught:
        clock.steps_per_cycle(step_s, T)
    assert all(text in str(caught.value) for text in nearest)


def test_a_step_longer_than_the_period_is_offered_the_period() -> None:
    with pytest.raises(ValueError, match=r"0\.028 s \(1 steps\)") as caught:
        clock.steps_per_cycle(0.03, T)
    assert " or " not in str(caught.value)


@pytest.mark.parametrize("step_s", [0.0, -0.001, math.nan, math.inf])
def test_a_step_that_is_no_time_is_refused(step_s: float) -> None:
    with pytest.raises(ValueError, match="positive"):
        clock.steps_per_cycle(step_s, T)


@pytest.mark.parametrize("cycles", [0, 1, 2, 5])
def test_delay_impulse_response_is_its_transfer_function(cycles: int) -> None:
    delay = TransportDelay(cycles, 2)
    impulse = np.zeros((12, 2))
    impulse[0] = (1.0, -3.0)
    response = np.array([delay.update(row) for row in impulse])
    # Exact: samples are moved, never computed.
    assert np.array_equal(response, signal.lfilter(*delay.transfer_function(), impulse, axis=0))


def test_delay_reset_gives_the_value_until_the_first_new_one_arrives() -> None:
    delay = TransportDelay(2, 3)
    delay.update(np.ones(3))
    delay.reset([4.0, 5.0, 6.0])
    sent = np.array([1.0, 2.0, 3.0])
    received = [delay.update(sent) for _ in range(3)]
    # Exact.
    assert np.array_equal(received, [[4, 5, 6], [4, 5, 6], [1, 2, 3]])


@pytest.mark.parametrize("cycles", [0, 3])
def test_delay_keeps_no_reference_to_what_it_was_given(cycles: int) -> None:
    delay = TransportDelay(cycles, 1)
    sent = np.ones(1)
    received = delay.update(sent)
    before = received.copy()
    sent[:] = 9.0
    for _ in range(cycles):
        last = delay.update(np.zeros(1))
    # Exact.
    assert np.array_equal(received, before)
    assert cycles == 0 or last[0] == 1.0


@pytest.mark.parametrize(("cycles", "size"), [(-1, 6), (1, 0)])
def test_delay_refuses_a_negative_length_and_an_empty_vector(cycles: int, size: int) -> None:
    with pytest.raises(InputError, match="cycles >= 0"):
        TransportDelay(cycles, size)


def compose(
    path: PathModification, pose: tuple[float, ...], dx: float, dz: float, dalpha: float
) -> tuple[float, ...]:
    """Return commanded x, z, α of a nominal (x, z, α) and the planar deviation."""
    deviation = np.array([dx, 0.0, dz, 0.0, dalpha, 0.0])
    return tuple(path.compose(PlanarPose(np.array(pose)), deviation)[0].coordinates.tolist())


def test_modes_agree_on_a_flat_grip_and_part_when_it_turns() -> None:
    start, turned = 0.0, 0.5
    poses = {}
    for mode in ("world", "tool", "tool-frozen"):
        path = PathModification(mode)
        # Analytic: at α = 0 every mode moves along x_B and z_B.
        flat = compose(path, (-0.3, 0.1, start), 0.01, 0.02, 0.2)
        assert flat == pytest.approx((-0.29, 0.12, 0.2), abs=1e-16)
        poses[mode] = compose(path, (-0.3, 0.1, turned), 0.01, 0.02, 0.2)
    # Exact: the controller that never updates the tool matrix moves as in world mode from flat.
    assert poses["tool-frozen"] == poses["world"]
    # Analytic: the tool's x axis is (cos α, −sin α) in (x, z), its z axis (sin α, cos α).
    c, s = math.cos(0.5), math.sin(0.5)
    moved = (-0.3 + 0.01 * c + 0.02 * s, 0.1 - 0.01 * s + 0.02 * c, 0.7)
    assert poses["tool"] == pytest.approx(moved, abs=1e-15)


@pytest.mark.parametrize("mode", ["world", "tool", "tool-frozen"])
def test_deviation_is_not_cumulative(mode: AlterMode) -> None:
    path = PathModification(mode)
    poses = {compose(path, (-0.3, 0.1, 0.4), 0.01, 0.0, 0.2) for _ in range(5)}
    # Exact: the same input gives the same pose, however often.
    assert len(poses) == 1
    assert compose(path, (-0.3, 0.1, 0.4), 0.0, 0.0, 0.0) == (-0.3, 0.1, 0.4)


def test_frozen_tool_frame_is_that_of_the_first_pose() -> None:
    path = PathModification("tool-frozen")
    compose(path, (0.0, 0.0, 0.8), 0.0, 0.0, 0.0)
    # Analytic.
    assert compose(path, (0.0, 0.0, 1.2), 1.0, 0.0, 0.0) == pytest.approx(
        (math.cos(0.8), -math.sin(0.8), 1.2), abs=1e-15
    )
