"""The controller of both arms: signs, mirroring, delay, and the closed loop around a spring."""

import math
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.control.alter import AlterMode
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import Admittance, AdmittanceConfig
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.compliance.pair import PairCompliance
from dualbend.control.controller import Command, ControlledPath, Observation
from dualbend.control.filters import LowPass, NoFilterConfig
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.control.wrist import WristSensors
from dualbend.types import PlanarPose

Array = NDArray[np.float64]
LEVER_M = 0.12
IDEAL = ForceTorqueConfig(
    force_noise_n=0.0,
    torque_noise_nm=0.0,
    force_resolution_n=0.0,
    torque_resolution_nm=0.0,
    lever_arm_m=LEVER_M,
)
# In SI: 2000 N/m and 50 N m/rad, with time constants of 0.1 s.
COMPLIANT = AdmittanceConfig(
    x=AxisConfig(b=200.0, k=2000.0, form="static"),
    rotation=AxisConfig(b=5.0, k=50.0, form="static"),
    units="si",
)


class Loop(NamedTuple):
    """What senses, and what decides and executes."""

    sensors: WristSensors
    path: ControlledPath


def make(
    *,
    sensing: tuple[int, ...] = (0,),
    complying: tuple[int, ...] = (0,),
    delay: int = 0,
    mode: AlterMode = "world",
    tool_kg: float = 0.0,
    config: AdmittanceConfig = COMPLIANT,
) -> Loop:
    count = len(sensing)
    chain = WrenchChain(
        Sensor(IDEAL, [np.random.default_rng(0) for _ in sensing], (count,)),
        ToolGravityCompensation(np.full(count, tool_kg), [[0.05, 0.0, 0.0]] * count),
        LowPass(NoFilterConfig(), period_s=COMMAND_PERIOD_S, shape=(count,)),
        np.eye(3),
    )
    admittance = Admittance(config, period_s=COMMAND_PERIOD_S, shape=(count,))
    compliance = PairCompliance(admittance, sensing=sensing, complying=complying)
    return Loop(
        WristSensors(chain, sensing),
        ControlledPath(compliance, delay_cycles=(delay, delay), mode=mode),
    )


def axes(alpha: float, yaw: float) -> Array:
    """Return R_WS of a sensor whose arm has the yaw and whose grip has the end slope α."""
    cz, sz, c, s = math.cos(yaw), math.sin(yaw), math.cos(alpha), math.sin(alpha)
    turn = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return turn @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def at_sensor(force_b: Array, moment_b: Array, alpha: float, tool_kg: float = 0.0) -> Array:
    """Return the wrench at the sensor, in S, of a wrench at the grip given in B, and a tool."""
    to_sensor = axes(alpha, 0.0).T
    force, moment = to_sensor @ force_b, to_sensor @ moment_b
    moment = moment + np.cross([LEVER_M, 0.0, 0.0], force)
    weight = to_sensor @ [0.0, 0.0, -9.81 * tool_kg]
    return np.concatenate((force + weight, moment + np.cross([0.05, 0.0, 0.0], weight)))


def observe(
    loop: Loop,
    loads: tuple[tuple[float, float], tuple[float, float]],
    alpha: float = 0.3,
    tool_kg: float = 0.0,
    vertical: float = 0.0,
) -> Observation:
    """Observe (F_x, M_y) in B on the left and the right arm."""
    wrench = np.array(
        [
            at_sensor(np.array([f, 0.0, vertical]), np.array([0.0, m, 0.0]), alpha, tool_kg)
            for f, m in loads
        ]
    )
    pose = PlanarPose(np.array([[-0.2, 0.7, alpha]] * 2))
    return Observation.of(
        loop.sensors.read(wrench, np.array([axes(alpha, 0.0), axes(alpha, math.pi)])),
        time_s=0.0,
        phase="bend",
        joints_rad=np.zeros(12),
        measured=pose,
        nominal=pose,
    )


def cycle(
    loop: Loop,
    loads: tuple[tuple[float, float], tuple[float, float]],
    alpha: float = 0.3,
    tool_kg: float = 0.0,
    vertical: float = 0.0,
) -> Command:
    """Run one cycle with (F_x, M_y) in B on the left and the right arm."""
    return loop.path.command(observe(loop, loads, alpha, tool_kg, vertical))


NOTHING = (0.0, 0.0)


def test_no_load_leaves_the_nominal_pose() -> None:
    command = cycle(make(sensing=(0, 1), complying=(0, 1)), (NOTHING, NOTHING))
    np.testing.assert_allclose(command.pose.coordinates, [[-0.2, 0.7, 0.3]] * 2, atol=1e-15)
    assert not command.saturated.any()


@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.2])
def test_an_arm_moves_along_the_force_and_the_moment(alpha: float) -> None:
    """A compressed sheet pushes the gripper outward, −x_B; a moment > 0 turns it to more α."""
    controller = make()
    for _ in range(200):
        command = cycle(controller, ((-10.0, 0.5), NOTHING), alpha)
    # Analytic: δ = F/k after 56 time constants, whatever the end slope, by the sensor's geometry.
    np.testing.assert_allclose(
        command.deviation[0], [-10.0 / 2000.0, 0.0, 0.0, 0.0, 0.5 / 50.0, 0.0], rtol=1e-9
    )
    np.testing.assert_allclose(command.pose.coordinates[0], [-0.205, 0.7, alpha + 0.01], rtol=1e-9)
    np.testing.assert_allclose(command.pose.coordinates[1], [-0.2, 0.7, alpha], rtol=1e-12)


def test_the_observation_is_the_wrench_at_the_grip_and_of_no_sensor_nothing() -> None:
    observed = observe(make(tool_kg=1.3), ((-16.0, 0.25), NOTHING), 0.6, 1.3, vertical=-2.0)
    for wrench in (observed.raw, observed.filtered):
        assert (wrench.frame, wrench.point) == ("bending", "grip")
        # Analytic.
        np.testing.assert_allclose(wrench.force_n[0], [-16.0, 0.0, -2.0], atol=1e-12)
        np.testing.assert_allclose(wrench.torque_nm[0], [0.0, 0.25, 0.0], atol=1e-12)
        assert np.isnan(wrench.components[1]).all()


def test_neither_the_tools_nor_the_sheets_weight_moves_the_arm() -> None:
    command = cycle(make(tool_kg=1.3), (NOTHING, NOTHING), 0.6, tool_kg=1.3, vertical=-5.0)
    np.testing.assert_allclose(command.deviation, 0.0, atol=1e-14)  # analytic


def test_symmetric_loads_give_symmetric_commands() -> None:
    controller = make(sensing=(0, 1), complying=(0, 1))
    for _ in range(5):
        command = cycle(controller, ((-7.0, 0.2), (-7.0, 0.2)), tool_kg=0.0)
    assert command.deviation[0, 0] < 0.0
    # The same in each arm's own frame; the sensor's axes differ by a turn of π: rounding.
    np.testing.assert_allclose(command.pose.coordinates[0], command.pose.coordinates[1], rtol=1e-14)


def test_each_sensing_arm_follows_its_own_load() -> None:
    command = cycle(make(sensing=(0, 1), complying=(0, 1)), ((-7.0, 0.0), (3.0, 0.0)))
    gain = Admittance(COMPLIANT, period_s=COMMAND_PERIOD_S).x
    assert gain is not None
    np.testing.assert_allclose(command.deviation[:, 0], [-7.0 * gain.gain, 3.0 * gain.gain])


@pytest.mark.parametrize(("sensor", "follower"), [(0, 1), (1, 0)])
def test_an_arm_without_a_sensor_mirrors_the_one_with(sensor: int, follower: int) -> None:
    controller = make(sensing=(sensor,), complying=(0, 1))
    loads = ((-7.0, 0.2), NOTHING) if sensor == 0 else (NOTHING, (-7.0, 0.2))
    command = cycle(controller, loads)
    assert command.deviation[sensor, 0] < 0.0
    np.testing.assert_array_equal(command.deviation[follower], command.deviation[sensor])
    pose = command.pose.coordinates
    np.testing.assert_array_equal(pose[follower], pose[sensor])


def test_an_arm_that_only_senses_stays_on_its_path() -> None:
    command = cycle(make(sensing=(0,), complying=(1,)), ((-7.0, 0.2), NOTHING))
    np.testing.assert_array_equal(command.deviation[0], 0.0)
    assert command.deviation[1, 0] < 0.0


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_pose_carries_the_deviation_of_whole_cycles_ago(delay: int) -> None:
    controller = make(complying=(0, 1), delay=delay)
    commands = [cycle(controller, ((-5.0 * (n == 0), 0.0), NOTHING)) for n in range(8)]
    executed = [command.pose.coordinates[0, 0] + 0.2 for command in commands]
    sent = [command.deviation[0, 0] for command in commands]
    assert sent[0] != 0.0
    # Analytic: y[n] = u[n − d], the same numbers but for adding and subtracting 0.2.
    np.testing.assert_allclose(executed[delay:], sent[: 8 - delay], atol=1e-16)
    np.testing.assert_allclose(executed[:delay], 0.0, atol=1e-16)


@pytest.mark.parametrize("mode", ["world", "tool", "tool-frozen"])
def test_the_deviation_is_executed_in_the_frame_of_the_mode(mode: AlterMode) -> None:
    controller = make(mode=mode)
    cycle(controller, (NOTHING, NOTHING), alpha=0.2)  # ALTER starts here
    command = cycle(controller, ((-5.0, 0.0), NOTHING), alpha=0.5)
    phi = {"world": 0.0, "tool": 0.5, "tool-frozen": 0.2}[mode]
    dx = command.deviation[0, 0]
    expected = [-0.2 + dx * math.cos(phi), 0.7 - dx * math.sin(phi), 0.5]
    np.testing.assert_allclose(command.pose.coordinates[0], expected, rtol=1e-14)  # analytic


def test_a_bound_that_is_met_is_told() -> None:
    tight = msgspec.structs.replace(COMPLIANT, limit_x_m=0.005)
    for force, met in ((-1e4, True), (-10.0, False)):
        loop = make(config=tight)
        observed = observe(loop, ((force, 0.0), NOTHING))
        assert observed.clipped.any() == met  # of the sensor
        assert loop.path.command(observed).saturated.any() == met  # of the deviation


@pytest.mark.parametrize(("component", "aside"), [(1, 0), (3, 1), (5, 2)])
def test_a_deviation_out_of_the_bending_plane_is_commanded_beside_it(
    component: int, aside: int
) -> None:
    """Exact: after the delay, of its arm and in its direction alone."""
    deviation = np.zeros((2, 6))
    deviation[1, component] = 1e-9
    path = ControlledPath(lambda _: deviation, delay_cycles=(1, 1), mode="world")
    observed = observe(make(), (NOTHING, NOTHING))
    assert not path.command(observed).aside.any()
    command = path.command(observed)
    assert command.aside[1, aside] == 1e-9
    assert np.count_nonzero(command.aside) == 1
    np.testing.assert_array_equal(command.pose.coordinates, observed.nominal.coordinates)


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("stiffness", [200.0, 1900.0])
def test_the_loop_around_a_spring_settles_at_the_static_solution(
    delay: int, stiffness: float
) -> None:
    """The sheet as a spring: F = F₀ − k_e δ and δ = F/k, hence δ = F₀/(k + k_e)."""
    controller = make(delay=delay)
    executed = 0.0
    for _ in range(600):
        command = cycle(controller, ((-12.0 - stiffness * executed, 0.0), NOTHING))
        executed = float(command.pose.coordinates[0, 0]) + 0.2
    # Analytic; the loop gain k_e/k is below 1, so it is stable for any delay.
    assert executed == pytest.approx(-12.0 / (2000.0 + stiffness), rel=1e-9)


def test_the_rotary_loop_around_a_spring_settles_too() -> None:
    controller = make(delay=1)
    turned = 0.0
    for _ in range(600):
        # More α relaxes the moment: dM/dα = −k_α.
        command = cycle(controller, ((0.0, 0.4 - 30.0 * turned), NOTHING))
        turned = float(command.pose.coordinates[0, 2]) - 0.3
    assert turned == pytest.approx(0.4 / (50.0 + 30.0), rel=1e-9)  # analytic
