"""What both arms hold complies with the net force on it: statics, the damper, the loop's limit."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.polynomial import polynomial
from scipy import signal
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from dualbend.control.clock import COMMAND_PERIOD_S, TransferFunction
from dualbend.control.compliance.object import (
    ObjectAdmittance,
    ObjectComplianceConfig,
    critical_rate,
    net_wrench,
)
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import FirConfig, IirConfig, LowPass, NoFilterConfig
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.types import Vector, Wrench

T = COMMAND_PERIOD_S
NO_BAND = ObjectComplianceConfig(deadband_n=0.0, deadband_nm=0.0)
MOBILITY = np.array([[2e-3, 1e-3, 0.2], [1e-3, 4e-4, 0.05]])
VECTOR = arrays(np.float64, 3, elements=st.floats(-40, 40))
RESPONSE = CommandResponseConfig(natural_frequency_hz=2.2, damping_ratio=1.0)


def grips(half: float, rise: float, alpha: float, yaw: float, place: Vector) -> list[tuple]:
    """Return place and axes of both grips in the world, from the frames' definition."""
    found = []
    for turn in (0.0, math.pi):
        frame = Rotation.from_euler("z", yaw + turn)
        axes = frame * Rotation.from_euler("y", alpha)
        found.append((place + frame.apply([-half, 0.0, rise]), axes))
    return found


def sensed(wrenches: Sequence[tuple[Vector, Vector]], axes: Sequence[Rotation]) -> Wrench:
    """Return in the grip frames the forces and moments on the grips that are in the world."""
    return on_grips(
        *(
            (frame.inv().apply(force), frame.inv().apply(torque))
            for (force, torque), frame in zip(wrenches, axes, strict=True)
        )
    )


def on_grips(*wrenches: tuple[Vector, Vector]) -> Wrench:
    """Return both arms' wrenches of forces and torques in their grip frames."""
    return Wrench(np.array([np.concatenate(each) for each in wrenches]), "grip", "grip")


# --- the net wrench -----------------------------------------------------------------------------


@given(
    VECTOR,
    VECTOR,
    VECTOR,
    VECTOR,
    VECTOR,
    st.floats(0.02, 1.0),
    st.floats(-0.1, 0.5),
    st.floats(0.0, 1.5),
    st.floats(-math.pi, math.pi),
)
def test_the_net_wrench_is_the_load_however_the_grips_share_it(
    force: Vector,
    point: Vector,
    torque: Vector,
    share_force: Vector,
    share_torque: Vector,
    half: float,
    rise: float,
    alpha: float,
    yaw: float,
) -> None:
    """A rigid body in equilibrium hands on F at r and M: about the place M + (r − place) × F.

    The left grip may take anything of it, the right one takes the rest.
    """
    place = np.array([0.3, -0.2, 0.7])
    arm = 0.01 * point
    moment = torque + np.cross(arm, force)
    (left, left_axes), (right, right_axes) = grips(half, rise, alpha, yaw, place)
    rest_force = force - share_force
    rest_torque = (
        moment
        - share_torque
        - np.cross(left - place, share_force)
        - np.cross(right - place, rest_force)
    )
    readings = sensed(
        [(share_force, share_torque), (rest_force, rest_torque)], [left_axes, right_axes]
    )
    found = net_wrench(readings.in_bending_frame(alpha), half, yaw)
    # Analytic: rounding of numbers up to some hundreds.
    np.testing.assert_allclose(found, [*force, moment[2]], atol=1e-10)


@given(
    st.floats(-30, 30),
    st.floats(-30, 30),
    st.floats(-3, 3),
    st.floats(0.0, 1.5),
    st.floats(-math.pi, math.pi),
)
def test_symmetric_bending_leaves_only_the_weight(
    along: float, normal: float, moment: float, alpha: float, yaw: float
) -> None:
    """The two grips' bending loads are each other's mirror image, equal in their own frames."""
    same = (np.array([along, 0.0, normal]), np.array([0.0, moment, 0.0]))
    net = net_wrench(on_grips(same, same).in_bending_frame(alpha), 0.2, yaw)
    # Analytic: the horizontal forces and the moments are opposite numbers, cancelled exactly.
    np.testing.assert_allclose(net[[0, 1, 3]], 0.0, atol=1e-12)
    up = 2.0 * (normal * math.cos(alpha) - along * math.sin(alpha))
    assert net[2] == pytest.approx(up, abs=1e-12)


@pytest.mark.parametrize(
    ("yaw", "pushed"), [(0.0, [1.0, 0.0]), (math.pi / 2, [0.0, 1.0]), (math.pi, [-1.0, 0.0])]
)
def test_signs_of_each_grip_alone(yaw: float, pushed: list[float]) -> None:
    """Flat: a force along the left grip's x is along the sheet, along the right one's against it.

    Across, the left grip's y turns the sheet clockwise from half the length, and so does the right.
    """
    none, unknown, half = np.zeros(3), np.full(3, np.nan), 0.25
    push, aside = ((axis, none) for axis in np.eye(3)[:2])
    # Analytic: unit forces; an arm without a sensor adds nothing.
    for grips, sign in (
        (on_grips(push, (none, none)), 1.0),
        (on_grips((none, none), push), -1.0),
        (on_grips((unknown, unknown), push), -1.0),
    ):
        net = net_wrench(grips.in_bending_frame(0.0), half, yaw)
        np.testing.assert_allclose(net, [*(sign * np.array(pushed)), 0.0, 0.0], atol=1e-15)
    both = net_wrench(on_grips(aside, aside).in_bending_frame(0.0), half, yaw)
    np.testing.assert_allclose(both, [0.0, 0.0, 0.0, -2.0 * half], atol=1e-15)


# --- the damper ---------------------------------------------------------------------------------


def make(config: ObjectComplianceConfig = NO_BAND) -> ObjectAdmittance:
    return ObjectAdmittance(config, np.array([0.0, 1.0]), MOBILITY, period_s=T)


@pytest.mark.parametrize("bend", [0.0, 0.25, 1.0])
def test_a_constant_force_makes_a_constant_speed(bend: float) -> None:
    admittance, wrench = make(), np.array([0.5, -1.0, 0.02])
    steps = np.array([admittance.update(wrench, bend) for _ in range(20)])
    mobility = (1.0 - bend) * MOBILITY[0] + bend * MOBILITY[1]
    # Analytic: δ[n] = n T F/B, with 1/B between its two given values.
    expected = np.outer(np.arange(1, 21), T * mobility * wrench)
    np.testing.assert_allclose(steps, expected, rtol=1e-12)
    admittance.update(np.zeros(3), bend)
    np.testing.assert_array_equal(admittance.deviation, steps[-1])  # it stays: no spring


@given(arrays(np.float64, (30, 3), elements=st.floats(-1, 1)), st.floats(0.0, 1.0))
def test_the_stream_is_the_transfer_function(wrenches: Vector, bend: float) -> None:
    admittance = make(msgspec.structs.replace(NO_BAND, limit_m=1.0, limit_rad=1.0))
    stream = np.array([admittance.update(wrench, bend) for wrench in wrenches])
    for axis, mobility in enumerate(admittance.mobility(bend)):
        expected = signal.lfilter([T * mobility], [1.0, -1.0], wrenches[:, axis])
        # Analytic: the same sum.
        np.testing.assert_allclose(stream[:, axis], expected, atol=1e-15)


@given(arrays(np.float64, 3, elements=st.floats(-2, 2)))
def test_within_the_band_nothing_moves_and_beyond_it_the_rest_acts(wrench: Vector) -> None:
    config = ObjectComplianceConfig(deadband_n=0.3, deadband_nm=0.1, limit_m=1.0, limit_rad=1.0)
    moved = make(config).update(wrench, 0.0)
    for force, band, mobility, step in zip(
        wrench, [0.3, 0.3, 0.1], MOBILITY[0], moved, strict=True
    ):
        if abs(force) <= band:
            assert step == 0.0
        else:
            # Analytic: continuous at the band's edge.
            rest = math.copysign(abs(force) - band, force)
            assert step == pytest.approx(T * mobility * rest, rel=1e-12)


@given(arrays(np.float64, 3, elements=st.floats(-1e6, 1e6)), st.booleans())
def test_the_deviation_never_leaves_its_bounds(wrench: Vector, seeking: bool) -> None:
    admittance = make()
    for sign in (1.0, 1.0, -1.0):
        moved = admittance.update(sign * wrench, 1.0, seeking)
        assert (np.abs(moved) <= [5e-3, 5e-3, 0.03]).all()


def test_a_clamped_deviation_comes_back_at_once() -> None:
    """No wind-up: what was cut off at the bound is not owed."""
    admittance = make()
    for _ in range(1000):
        admittance.update(np.array([50.0, -50.0, 5.0]), 0.0)
    np.testing.assert_array_equal(admittance.deviation, [5e-3, -5e-3, 0.03])
    back = admittance.update(np.array([-0.1, 0.1, -0.01]), 0.0)
    # Analytic: one cycle at F/B.
    np.testing.assert_allclose(
        back - [5e-3, -5e-3, 0.03], T * MOBILITY[0] * [-0.1, 0.1, -0.01], rtol=1e-9
    )


# --- seeking ------------------------------------------------------------------------------------


@given(st.floats(-math.pi, math.pi), st.floats(0.2, 30.0))
def test_a_sure_force_seeks_at_the_least_speed_in_its_direction(angle: float, size: float) -> None:
    """Isotropic mobility, so that the direction of the speed is the force's."""
    config = ObjectComplianceConfig(deadband_n=0.0, deadband_nm=0.0, gain_margin=5.0)
    admittance = ObjectAdmittance(config, np.array([0.0, 1.0]), np.full((2, 3), 1e-4), period_s=T)
    force = size * np.array([math.cos(angle), math.sin(angle), 0.0])
    speed = admittance.update(force, 0.5, seeking=True) / T
    # Analytic: the margin 5 is used up to 1.25, so 4 F/B up to 2 N, F/B beyond; not below 0.5 mm/s.
    fast = 1e-4 * (4.0 * min(size, 2.0) + max(size - 2.0, 0.0))
    assert np.hypot(*speed[:2]) == pytest.approx(max(0.5e-3, fast), rel=1e-9)
    np.testing.assert_allclose(speed[:2] / np.hypot(*speed[:2]), force[:2] / size, atol=1e-9)
    assert speed[2] == 0.0


def test_a_doubtful_force_seeks_slower_and_none_does_not_seek() -> None:
    config = ObjectComplianceConfig()

    def fresh() -> ObjectAdmittance:
        return ObjectAdmittance(config, np.array([0.0, 1.0]), np.full((2, 3), 1e-9), period_s=T)

    for share in (0.25, 1.0, 3.0):
        admittance = fresh()
        wrench = np.array([0.1 + 0.2 * share, 0.0, -0.02 - 0.05 * share])
        speed = admittance.update(wrench, 0.0, seeking=True) / T
        # Analytic: in proportion up to 0.2 N and 0.05 N m beyond the band, then constant.
        expected = np.array([0.5e-3, 0.0, -5e-3]) * min(share, 1.0)
        np.testing.assert_allclose(speed, expected, rtol=1e-9, atol=1e-18)
    admittance = fresh()
    admittance.update(np.array([0.1, -0.1, 0.02]), 0.0, seeking=True)
    np.testing.assert_array_equal(admittance.deviation, 0.0)
    # Without seeking there is no least speed.
    plain = admittance.update(np.array([0.3, 0.0, 0.0]), 0.0)
    assert plain[0] == pytest.approx(T * 1e-9 * 0.2)


def test_a_share_of_seeking_is_one_of_the_least_speed_in_turning_alone() -> None:
    admittance = ObjectAdmittance(
        ObjectComplianceConfig(), np.array([0.0, 1.0]), np.full((2, 3), 1e-9), period_s=T
    )
    speed = admittance.update(np.array([1.0, 0.0, 1.0]), 0.0, seeking=0.25) / T
    # Analytic: all of 0.5 mm/s, a quarter of 5 mrad/s.
    np.testing.assert_allclose(speed, [0.5e-3, 0.0, 1.25e-3], rtol=1e-5)


def test_seeking_never_slows_down() -> None:
    """A margin below what seeking leaves is not used up further."""
    config = msgspec.structs.replace(NO_BAND, gain_margin=1.1)
    fast = ObjectAdmittance(config, np.array([0.0, 1.0]), np.full((2, 3), 1e-2), period_s=T)
    wrench = np.array([1.0, -2.0, 0.5])
    # Analytic: F/B as it is.
    np.testing.assert_allclose(fast.update(wrench, 0.0, True), T * 1e-2 * wrench, rtol=1e-12)


# --- the loop's limit ---------------------------------------------------------------------------


def delay(cycles: int) -> TransferFunction:
    return TransportDelay(cycles, 1).transfer_function()


@pytest.mark.parametrize("cycles", range(1, 12))
@pytest.mark.parametrize("as_latency", [False, True])
def test_an_integrator_with_delay(cycles: int, as_latency: bool) -> None:
    path, latency = ([], cycles) if as_latency else ([delay(cycles)], 0.0)
    closed = 2.0 / T * math.sin(math.pi / (2 * (2 * cycles - 1)))
    # Analytic up to the grid: the crossing is found to π/4000, of a frequency of π/(2d − 1).
    assert critical_rate(path, latency, T) == pytest.approx(closed, rel=(2 * cycles - 1) / 4000)


def test_a_damper_that_acts_on_what_it_reads_at_once_is_stable_at_any_rate() -> None:
    # Analytic: the phase of 1/(1 − z⁻¹) lies between −π/2 and 0.
    assert critical_rate([], 0.0, T) == math.inf


def poles(path: Sequence[TransferFunction], latency: int, rate: float) -> Vector:
    """Return the loop's poles: roots in z⁻¹ of (1 − z⁻¹) D + rate T z⁻ˡ N, turned over."""
    above, below = np.array([1.0]), np.array([1.0, -1.0])
    for numerator, denominator in path:
        above, below = np.convolve(above, numerator), np.convolve(below, denominator)
    above = np.concatenate((np.zeros(latency), rate * T * above))
    return 1.0 / polynomial.polyroots(polynomial.polyadd(above, below))


def shipped(kind: str, cycles: int) -> list[TransferFunction]:
    low_pass = {
        "fir": FirConfig(cutoff_hz=10.0, taps=2),
        "iir": IirConfig(),
        "none": NoFilterConfig(),
    }[kind]
    return [
        LowPass(low_pass, period_s=T).transfer_function(),
        delay(cycles),
        CommandResponse(RESPONSE, 1, 16, period_s=T).transfer_function(),
    ]


@pytest.mark.parametrize("kind", ["fir", "iir", "none"])
@pytest.mark.parametrize(("cycles", "latency"), [(0, 0), (2, 1), (5, 3)])
def test_at_the_critical_rate_a_pole_meets_the_circle(kind: str, cycles: int, latency: int) -> None:
    path = shipped(kind, cycles)

    def largest(rate: float) -> float:
        return float(np.abs(poles(path, latency, rate)).max()) - 1.0

    rate = critical_rate(path, latency, T)
    edge = brentq(largest, 0.05 * rate, 20.0 * rate)
    # Analytic up to the grid of frequencies: first order in π/4000.
    assert rate == pytest.approx(edge, rel=1e-2)
    assert largest(0.9 * rate) < 0.0 < largest(1.1 * rate)


def swing(rate: float, path_delay: int, latency: int, cycles: int = 600) -> float:
    """Return how the loop's swing grows, streamed through the loop's own elements.

    An object of stiffness k is held 1 mm off its place; damper B = k / rate.
    """
    stiffness = 2000.0
    admittance = ObjectAdmittance(
        msgspec.structs.replace(NO_BAND, limit_m=1e3),
        np.array([0.0, 1.0]),
        np.full((2, 3), rate / stiffness),
        period_s=T,
    )
    low_pass = LowPass(FirConfig(cutoff_hz=10.0, taps=2), 3, period_s=T)
    line, age = TransportDelay(path_delay, 3), TransportDelay(latency, 3)
    response = CommandResponse(RESPONSE, 3, 16, period_s=T)
    place = []
    for _ in range(cycles):
        place.append(float(response.position[0]) - 1e-3)
        force = -stiffness * np.array([place[-1], 0.0, 0.0])
        deviation = admittance.update(low_pass.update(age.update(force)), 0.0)
        response.update(line.update(deviation))
    late = np.abs(place[-150:]).max()
    return float(late / np.abs(place[150:300]).max())


@pytest.mark.parametrize(("path_delay", "latency"), [(2, 1), (4, 0)])
def test_the_streamed_loop_swings_up_only_beyond_it(path_delay: int, latency: int) -> None:
    """The order of the run's own loop: place, force, age, filter, damper, delay, response."""
    rate = critical_rate(shipped("fir", path_delay), latency, T)
    assert swing(0.95 * rate, path_delay, latency) < 0.5
    assert swing(1.05 * rate, path_delay, latency) > 2.0


def test_a_fraction_of_a_cycle_is_between_its_neighbours() -> None:
    path = shipped("fir", 2)
    rates = [critical_rate(path, age, T) for age in (0.0, 0.0625, 0.375, 1.0)]
    assert rates == sorted(rates, reverse=True)
    # Discretisation-limited: the rate is smooth in the age, so the secant is close.
    assert rates[2] == pytest.approx(rates[0] + 0.375 * (rates[3] - rates[0]), rel=0.03)
