"""What ends a run: each limit at its edge, and the joint that the message names."""

import numpy as np
import pytest

from dualbend.control.guard import Guard, GuardConfig, ProtectiveStop, SensorGuard
from dualbend.types import Mask, Vector

NAMES = ("base", "elbow", "wrist")
STILL = np.zeros(3)
RANGE = np.array([[-2.0, 2.0], [-1.0, 3.0], [-4.0, 0.5]])
TORQUE, SPEED = np.array([100.0, 50.0, 8.0]), np.array([2.0, 4.0, 8.0])
# Fractions of two: the limits are exact numbers.
CONFIG = GuardConfig(following_error_rad=0.25, speed_fraction=0.5, torque_cycles=3)


def guard() -> Guard:
    return Guard(CONFIG, NAMES, RANGE, TORQUE, SPEED)


def at(joint: int, value: float) -> Vector:
    return value * np.eye(3)[joint]


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_may_reach_the_limits_of_error_and_speed_but_not_pass_them(
    joint: int, sign: float
) -> None:
    """Exact: the error is against the reference, wherever that is; each joint has its own speed."""
    reference = np.array([0.5, 1.0, -1.0])
    edge, beyond = at(joint, 0.25 * sign), at(joint, 0.26 * sign)
    guard().check(reference + edge, STILL, STILL, reference)
    with pytest.raises(ProtectiveStop, match=f"following error of {NAMES[joint]} is 0.26 rad"):
        guard().check(reference + beyond, STILL, STILL, reference)
    fast = 0.5 * SPEED[joint]
    guard().check(STILL, at(joint, fast * sign), STILL, STILL)
    with pytest.raises(ProtectiveStop, match=f"{NAMES[joint]} is .* rad/s, above {fast:.4g}"):
        guard().check(STILL, at(joint, 1.001 * fast * sign), STILL, STILL)


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_only_cycles_in_a_row_at_the_torque_limit_end_a_run(joint: int, sign: float) -> None:
    checked, full = guard(), at(joint, sign * TORQUE[joint])
    for torque in (full, full, 0.99 * full, full, -full):
        checked.check(STILL, STILL, torque, STILL)
    # Exact: the third in a row, of either sign.
    with pytest.raises(ProtectiveStop, match=f"{NAMES[joint]} is at its torque limit .* 3 cycles"):
        checked.check(STILL, STILL, full, STILL)


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("end", [0, 1])
def test_the_end_of_a_range_is_outside_it(joint: int, end: int) -> None:
    q = at(joint, RANGE[joint, end])
    inside = q + at(joint, 1e-9 * (1 - 2 * end))
    guard().check(inside, STILL, STILL, inside)
    degrees = np.degrees(RANGE[joint, end])
    with pytest.raises(ProtectiveStop, match=f"{NAMES[joint]} .* end, {degrees:.1f} degrees"):
        guard().check(q, STILL, STILL, q)


def test_the_joint_that_is_named_is_the_worst() -> None:
    reference = np.array([1.0, 2.0, -3.0])
    # The largest error is neither that of the largest angle nor that of the largest reference.
    with pytest.raises(ProtectiveStop, match=r"error of elbow is 0\.4 rad"):
        guard().check(reference + np.array([0.3, -0.4, 0.35]), STILL, STILL, reference)
    # The fastest is the one nearest to its own limit: 1.2, 1.5 and 1.1 times it.
    with pytest.raises(ProtectiveStop, match="speed of elbow is 3 rad/s, above 2"):
        guard().check(STILL, np.array([1.2, -3.0, 4.4]), STILL, STILL)
    # An error is told before a speed, both before a torque.
    with pytest.raises(ProtectiveStop, match="following error of wrist"):
        guard().check(at(2, 0.3), at(0, 9.0), TORQUE, STILL)


def test_what_is_outside_is_told_by_kind_and_joint() -> None:
    checked = guard()
    for _ in range(2):
        checked.outside(STILL, STILL, -TORQUE, STILL)
    outside = checked.outside(at(0, 2.0), at(1, 3.0), at(2, 8.0), STILL)
    # Exact: following error and range of the base, speed of the elbow, torque of the wrist.
    assert outside.tolist() == [
        [True, False, False],
        [False, True, False],
        [False, False, True],
        [True, False, False],
    ]


# --- a sensor that tells less than acts ---------------------------------------------------------

FREE = np.zeros((2, 6), dtype=np.bool_)
FRESH = np.ones(2, dtype=np.bool_)


def clipped(arm: int, *axes: int) -> Mask:
    mask = FREE.copy()
    mask[arm, list(axes)] = True
    return mask


@pytest.mark.parametrize(("arm", "side"), [(0, "left"), (1, "right")])
def test_only_cycles_in_a_row_at_the_range_of_a_sensor_end_a_run(arm: int, side: str) -> None:
    checked = SensorGuard(GuardConfig(sensor_cycles=3), ("left", "right"))
    for mask in (clipped(arm, 0), clipped(arm, 0), FREE, clipped(arm, 1), clipped(1 - arm, 0)):
        checked.check(mask, FRESH)
    checked.check(clipped(arm, 2), FRESH)
    checked.check(clipped(arm, 5), FRESH)
    # Exact: the third in a row, of whatever axis; the message has those of now.
    message = rf"the {side} sensor is at the end of its range \(force z, moment x\) for 3 cycles"
    with pytest.raises(ProtectiveStop, match=message):
        checked.check(clipped(arm, 2, 3), FRESH)


@pytest.mark.parametrize(("arm", "side"), [(0, "left"), (1, "right")])
def test_a_sensor_that_tells_nothing_new_for_too_long_ends_a_run(arm: int, side: str) -> None:
    lost = FRESH.copy()
    lost[arm] = False
    checked = SensorGuard(GuardConfig(lost_cycles=3), ("left", "right"))
    for fresh in (lost, lost, FRESH, lost, lost[::-1], lost, lost):
        checked.check(clipped(arm, 0) if fresh is FRESH else FREE, fresh)
    with pytest.raises(ProtectiveStop, match=f"the {side} sensor has told nothing new for 3 cycle"):
        checked.check(FREE, lost)


def test_a_run_is_stopped_after_five_cycles_unless_it_says_otherwise() -> None:
    """Exact: of both kinds, in the order of what is returned."""
    for clip, fresh, kind in ((clipped(0, 0), FRESH, 0), (FREE, ~FRESH, 1)):
        checked = SensorGuard(GuardConfig(), ("left", "right"))
        found = [checked.outside(clip, fresh) for _ in range(5)]
        assert not np.any(found[:4])
        assert found[4][kind, 0] and not found[4][1 - kind].any()
