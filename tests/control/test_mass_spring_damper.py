"""The admittance in full: closed forms, energy, frames, and the paper's filter as a case of it."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from dualbend.control.clock import COMMAND_PERIOD_S as T
from dualbend.control.compliance.admittance import Admittance, AdmittanceConfig
from dualbend.control.compliance.base import AxisConfig, DirectionConfig
from dualbend.control.compliance.mass_spring_damper import (
    DIRECTIONS,
    Frame,
    MassSpringDamper,
    MassSpringDamperConfig,
    SpatialAdmittance,
    in_bending_frame,
    in_frame,
)
from dualbend.control.controller import Observation
from dualbend.types import Mask, PlanarPose, Vector, Wrench

LOADS = arrays(np.float64, (40, 6), elements=st.floats(-30.0, 30.0))
ALPHA = st.floats(0.0, 3.0)


def direction(**given: Any) -> DirectionConfig:
    return DirectionConfig(**{"b": 30.0, "limit": 3.0, **given})


def admittance(frame: Frame = "world", **parts: DirectionConfig) -> SpatialAdmittance:
    config = MassSpringDamperConfig(frame=frame, **parts)
    return SpatialAdmittance(config, period_s=T, sensing=(0, 1), complying=(0, 1))


def observed(loads: Vector, alpha: float, measured: float | None = None) -> Observation:
    """Observe the same wrench (6,) on both arms, at a slope on the path and a measured one."""
    wrench = Wrench(np.array([loads, loads]), "bending", "grip")
    pose = np.array([[-0.2, 0.7, alpha]] * 2)
    there = pose if measured is None else np.array([[-0.2, 0.7, measured]] * 2)
    nothing: Mask = np.zeros((2, 6), dtype=np.bool_)
    return Observation(
        time_s=0.0,
        phase="bend",
        raw=wrench,
        filtered=wrench,
        clipped=nothing,
        fresh=nothing[:, 0],
        joints_rad=np.zeros(12),
        measured=PlanarPose(there),
        nominal=PlanarPose(pose),
    )


def response(config: DirectionConfig, loads: Vector) -> tuple[Vector, Vector]:
    """Return deviations and speeds (n,) of one direction along x."""
    one = admittance(x=config)
    found = []
    for load in loads:
        one.update(np.array([[load, 0, 0, 0, 0, 0]] * 2), np.zeros(2))
        found.append(one._state[0, 0].copy())
    return np.array(found)[:, 0], np.array(found)[:, 1]


# --- time and frequency ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("m", "b", "k"), [(2.0, 10.0, 500.0), (2.0, 90.0, 500.0), (0.01, 40.0, 700.0), (3.0, 20.0, 0.0)]
)
def test_a_step_makes_the_step_response_of_the_continuous_one(m: float, b: float, k: float) -> None:
    """Analytic, to rounding: below, above critical damping, far above it, and without a spring."""
    force, t = 5.0, T * np.arange(1, 81)
    if k:
        omega, decay = math.sqrt(k / m), b / (2.0 * m)
        roots = -decay + np.array([1.0, -1.0]) * np.sqrt(complex(decay**2 - omega**2))
        part = np.exp(np.outer(t, roots)) @ np.array([roots[1], -roots[0]]) / (roots[0] - roots[1])
        expected = force / k * (1.0 + part).real
    else:
        expected = force / b * (t - m / b * (1.0 - np.exp(-b * t / m)))
    found, _ = response(direction(m=m, b=b, k=k), np.full(80, force))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-14)


def test_a_damper_follows_the_load_and_a_spring_rests_at_it() -> None:
    """Analytic: δ̇ = F/B without end; δ = F/K in the end, whatever the mass."""
    found, _ = response(direction(b=50.0), np.full(20, 10.0))
    np.testing.assert_allclose(found, 10.0 / 50.0 * T * np.arange(1, 21), rtol=1e-12)
    for m in (0.0, 1.0):
        found, _ = response(direction(m=m, b=50.0, k=200.0), np.full(400, 10.0))
        assert found[-1] == pytest.approx(10.0 / 200.0, rel=1e-9)


@given(arrays(np.float64, 60, elements=st.floats(-20.0, 20.0)))
def test_the_papers_filter_is_the_case_without_a_mass(loads: Vector) -> None:
    """Exact to rounding: δ[n] = a δ[n−1] + ((1 − a)/K) F[n], the built-in form "static"."""
    axis = AxisConfig(b=30.0, k=400.0, form="static")
    config = AdmittanceConfig(units="si", x=axis, rotation=axis, limit_x_m=0.02)
    built_in = Admittance(config, period_s=T)
    part = DirectionConfig(b=30.0, k=400.0)
    own = admittance(x=part, pitch=part)
    for load in loads:
        theirs = built_in.comply(np.array([load, 0.0, load]), PlanarPose(np.zeros(3)))
        mine = own(observed(np.array([load, 0, 0, 0, load, 0]), 0.0))
        np.testing.assert_allclose(mine[0, ::4], theirs, rtol=1e-13, atol=1e-18)
        np.testing.assert_array_equal(own.saturated[0, ::4], built_in.saturated)


@pytest.mark.parametrize(
    "config", [direction(), direction(k=300.0), direction(m=2.0), direction(m=1.0, k=400.0)]
)
@given(arrays(np.float64, 40, elements=st.floats(-20.0, 20.0)))
def test_the_transfer_function_is_that_of_the_object_that_runs(
    config: DirectionConfig, loads: Vector
) -> None:
    numerator, denominator = MassSpringDamper(config, period_s=T, largest=1.0).transfer_function()
    found, _ = response(config, loads)
    expected = lfilter(numerator, denominator, loads)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


# --- energy ------------------------------------------------------------------------------------


@given(
    arrays(np.float64, 60, elements=st.floats(-20.0, 20.0)),
    st.sampled_from([(0.0, 0.0), (0.0, 500.0), (2.0, 0.0), (2.0, 500.0), (0.1, 3000.0)]),
    st.sampled_from([3.0, 1e-2]),
)
def test_it_is_passive(loads: Vector, mk: tuple[float, float], limit: float) -> None:
    """Analytic: the load's work is at least the energy that is stored, whatever the load.

    A load that is held over a period does the work F (δ[n] − δ[n−1]) exactly.
    """
    m, k = mk
    deviation, speed = response(direction(m=m, k=k, limit=limit), loads)
    work = np.cumsum(loads * np.diff(deviation, prepend=0.0))
    stored = 0.5 * k * deviation**2 + 0.5 * m * speed**2
    assert (work - stored >= -1e-9 * max(1.0, float(np.abs(work).max()))).all()


# --- dead zone, limits, switching on -----------------------------------------------------------


def test_in_the_dead_zone_nothing_acts_and_beyond_it_the_load_less_the_zone() -> None:
    """Exact: the response to F beyond the zone is that of F − zone without one."""
    zone, free = direction(k=100.0, dead_zone=2.0), direction(k=100.0)
    assert not response(zone, np.full(10, 1.9))[0].any()
    for sign in (1.0, -1.0):
        np.testing.assert_array_equal(
            response(zone, sign * np.full(10, 5.0))[0], response(free, sign * np.full(10, 3.0))[0]
        )


@pytest.mark.parametrize("m", [0.0, 1.0])
def test_at_its_limit_it_does_not_wind_up(m: float) -> None:
    """Exact: it leaves the limit at once, as from a rest there, however long it was pushed."""
    config = direction(m=m, k=0.0, limit=0.01)
    ways = []
    for pushed in (20, 200):
        loads = np.concatenate([np.full(pushed, 50.0), np.full(5, -1.0)])
        found, _ = response(config, loads)
        assert found.max() == 0.01
        ways.append(found[-5:])
    np.testing.assert_array_equal(*ways)
    assert (np.diff(ways[0]) < 0.0).all()
    assert ways[0][0] < 0.01


def test_limits_are_the_papers_where_none_is_given() -> None:
    parts = {name: DirectionConfig(b=1e-3) for name in DIRECTIONS}
    one = admittance(**parts)
    one.update(np.full((2, 6), 1e3), np.zeros(2))
    deviation = one.update(np.full((2, 6), 1e3), np.zeros(2))
    np.testing.assert_array_equal(deviation, [[0.02] * 3 + [0.1] * 3] * 2)
    assert one.saturated.all()


def test_a_direction_acts_from_its_bending_angle_on() -> None:
    one = admittance(pitch=direction(k=10.0, from_alpha_rad=0.3))
    load = np.array([0, 0, 0, 0, 1.0, 0])
    assert not one(observed(load, 0.29)).any()
    assert one(observed(load, 0.3))[0, 4] > 0.0
    assert one.transfer_functions(0.29) == (None, None)
    assert one.transfer_functions(0.3)[1] is not None


# --- frames ------------------------------------------------------------------------------------

SIX = {name: direction(m=0.5, b=20.0 + i, k=100.0 + 10.0 * i) for i, name in enumerate(DIRECTIONS)}


@given(LOADS)
def test_all_frames_are_one_where_the_sheet_is_flat(loads: Vector) -> None:
    """Exact: at α = 0 no axis is turned."""
    every = [admittance(frame, **SIX) for frame in ("world", "grip", "tool")]
    for load in loads[:10]:
        first, *others = (one(observed(load, 0.0)) for one in every)
        for other in others:
            np.testing.assert_allclose(other, first, rtol=0.0, atol=1e-15)


@given(LOADS, ALPHA)
def test_what_is_alike_in_all_directions_knows_no_frame(loads: Vector, alpha: float) -> None:
    """Analytic: an isotropic filter commutes with a rotation; of rotations to first order only."""
    part = DirectionConfig(m=0.5, b=40.0, k=100.0, limit=3.0)
    turn = DirectionConfig(m=50.0, b=4e7, k=1e6, limit=3.0)
    parts = {name: part if i < 3 else turn for i, name in enumerate(DIRECTIONS)}
    world, grip = admittance("world", **parts), admittance("grip", **parts)
    for load in loads[:15]:
        one, other = world(observed(load, alpha)), grip(observed(load, alpha))
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-10)


@given(LOADS, ALPHA)
def test_the_grips_axes_are_turned_by_the_slope(loads: Vector, alpha: float) -> None:
    """Analytic: only what acts along the grip's x moves it, and it moves along that."""
    along = np.array([math.cos(alpha), 0.0, -math.sin(alpha)])
    grip, plain = admittance("grip", x=SIX["x"]), admittance("world", x=SIX["x"])
    for load in loads[:10]:
        found = grip(observed(load, alpha))[0]
        force = float(along @ load[:3])
        size = plain(observed(np.array([force, 0, 0, 0, 0, 0]), 0.0))[0, 0]
        np.testing.assert_allclose(found[:3], size * along, rtol=0.0, atol=1e-12)


def test_along_x_only_the_worlds_axes_are_those_of_the_analysis() -> None:
    for frame in ("world", "grip", "tool"):
        x, pitch = admittance(frame, x=SIX["x"], pitch=SIX["pitch"]).transfer_functions(0.5)
        assert (x is not None) == (frame == "world")
        assert pitch is not None


def test_the_tools_axes_are_those_that_the_encoders_tell() -> None:
    load = np.array([3.0, 0, -2.0, 0, 0, 0])
    tool = admittance("tool", x=SIX["x"])(observed(load, 0.2, measured=0.5))
    grip = admittance("grip", x=SIX["x"])(observed(load, 0.5))
    np.testing.assert_array_equal(tool, grip)


@given(arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)), ALPHA)
def test_a_rotation_is_told_exactly_along_other_axes(angles: Vector, alpha: float) -> None:
    """Analytic, another program's rotations: R_y(φ) R_z R_x R_y R_y(−φ)."""

    def matrix(roll: float, pitch: float, yaw: float) -> Vector:
        return np.asarray(Rotation.from_euler("ZXY", [yaw, roll, pitch]).as_matrix())

    slope = Rotation.from_euler("y", alpha).as_matrix()
    told = in_bending_frame(np.concatenate((np.zeros(3), angles)), np.array(alpha))[3:]
    expected = slope @ matrix(*angles) @ slope.T
    if abs(expected[2, 1]) < 0.999:  # at a roll of π/2 yaw and pitch are one
        np.testing.assert_allclose(matrix(*told), expected, rtol=0.0, atol=1e-9)


@given(LOADS, ALPHA)
def test_a_wrench_is_turned_there_and_back(loads: Vector, alpha: float) -> None:
    slope = np.full(len(loads), alpha)
    turned = in_frame(loads, slope)
    rotation = Rotation.from_euler("y", alpha).as_matrix()
    np.testing.assert_allclose(turned[:, :3], loads[:, :3] @ rotation, atol=1e-12)
    np.testing.assert_allclose(turned[:, 3:], loads[:, 3:] @ rotation, atol=1e-12)


# --- arms --------------------------------------------------------------------------------------


def test_an_arm_without_a_sensor_mirrors_the_other() -> None:
    config = MassSpringDamperConfig(sensing=("left",), complying=("left", "right"), **SIX)
    one = SpatialAdmittance(config, period_s=T, sensing=(0,), complying=(0, 1))
    load = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    found = one(observed(load, 0.0))
    assert found[0].all()
    np.testing.assert_array_equal(found[0], found[1])


def test_what_is_not_predicted_is_said() -> None:
    assert MassSpringDamperConfig().not_predicted == ""
    assert MassSpringDamperConfig(x=direction(), pitch=direction()).not_predicted == "limits"
    parts = {"x": direction(dead_zone=1.0), "yaw": direction()}
    assert MassSpringDamperConfig(**parts).not_predicted == (
        "yaw in the frame 'world'; the dead zone of x; limits"
    )
    assert MassSpringDamperConfig(frame="grip", **parts).not_predicted.startswith("x, yaw in")
    assert MassSpringDamperConfig(frame="grip", x=direction()).in_space
    assert not MassSpringDamperConfig(x=direction(), pitch=direction()).in_space
