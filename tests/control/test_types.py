"""Wrenches and planar poses: the same force and place, told about other points and axes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from dualbend.types import PlanarPose, Vector, Wrench, matvec

VECTOR = arrays(np.float64, 3, elements=st.floats(-50, 50))


def power(wrench: Wrench, velocity: Vector, omega: Vector) -> float:
    """Return F·v + M·ω, with the velocity of the point about which the torque is told."""
    return float(wrench.force_n @ velocity + wrench.torque_nm @ omega)


@given(VECTOR, VECTOR, VECTOR, VECTOR)
def test_moving_a_moment_keeps_the_power_of_the_wrench(
    force: Vector, torque: Vector, lever: Vector, omega: Vector
) -> None:
    at_sensor = Wrench.of(force, torque, "sensor", "sensor")
    at_grip = at_sensor.moved(lever, "grip")
    velocity = np.array([0.3, -1.0, 2.0])
    # Analytic: the same about both points when v_grip = v_sensor + ω × r; terms of up to 50³.
    assert math.isclose(
        power(at_sensor, velocity, omega),
        power(at_grip, velocity + np.cross(omega, lever), omega),
        rel_tol=1e-12,
        abs_tol=1e-8,
    )
    assert (at_grip.frame, at_grip.point) == ("sensor", "grip")


@given(VECTOR, VECTOR, VECTOR, VECTOR)
def test_moves_of_a_moment_add_up(
    force: Vector, torque: Vector, first: Vector, second: Vector
) -> None:
    wrench = Wrench.of(force, torque, "sensor", "sensor")
    twice = wrench.moved(first, "middle").moved(second, "grip")
    once = wrench.moved(first + second, "grip")
    # Analytic, relative to terms of up to 50².
    np.testing.assert_allclose(twice.components, once.components, atol=1e-9)


@given(VECTOR, VECTOR, VECTOR)
def test_turning_keeps_the_power_of_the_wrench(
    force: Vector, torque: Vector, omega: Vector
) -> None:
    turn = Rotation.from_euler("xyz", [0.3, -0.8, 1.9]).as_matrix()
    velocity = np.array([0.3, -1.0, 2.0])
    wrench = Wrench.of(force, torque, "sensor", "grip")
    turned = wrench.turned(turn, "grip")
    # Analytic: a scalar; terms of up to 50².
    assert power(turned, turn @ velocity, turn @ omega) == pytest.approx(
        power(wrench, velocity, omega), abs=1e-10
    )
    assert (turned.frame, turned.point) == ("grip", "grip")


@given(st.floats(-1.5, 1.5), st.floats(0, 100), st.floats(-100, 100))
def test_horizontal_force_has_no_part_of_a_vertical_one(
    alpha: float, weight: float, push: float
) -> None:
    c, s = math.cos(alpha), math.sin(alpha)
    to_grip = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])  # Inverse of the turn by +α about y.
    loads = np.array([push, 3.0, -weight])
    grip = Wrench.of(to_grip @ loads, to_grip @ loads, "grip", "grip")
    # Analytic: gravity drops out and the push stays, up to rounding of 100 N.
    bending = grip.in_bending_frame(alpha)
    np.testing.assert_allclose(bending.components, [*loads, *loads], atol=1e-12)
    np.testing.assert_array_equal(bending.planar, bending.components[[0, 2, 4]])


def test_a_wrench_is_turned_to_the_bending_frame_from_the_grip_frame_only() -> None:
    with pytest.raises(ValueError, match="'sensor'; needs 'grip'"):
        Wrench(np.zeros(6), "sensor", "sensor").in_bending_frame(0.3)


def test_the_coordinates_of_a_pose_are_broadcast() -> None:
    pose = PlanarPose.of(-0.2, np.array([0.7, 0.8]), 0.3)
    np.testing.assert_array_equal(pose.coordinates, [[-0.2, 0.7, 0.3], [-0.2, 0.8, 0.3]])


@given(st.integers(0, 2**32 - 1))
def test_a_stack_of_products_is_each_product_to_the_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, vectors = rng.standard_normal((6, 6)), rng.standard_normal((3, 5, 6))
    stacked = matvec(matrix, vectors)
    for index in np.ndindex(3, 5):
        np.testing.assert_array_equal(stacked[index], matvec(matrix, vectors[index]))
