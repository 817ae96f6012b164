"""The arm under load: the linear cycle is MuJoCo's own, and becomes the rigid one when stiff."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.control.servo import IntegralAction, IntegralConfig, JointServo
from dualbend.scenario.load import load_scenario
from dualbend.stability.plant.arm import CompliantArm, Joints
from dualbend.stability.plant.environment import environments
from dualbend.stability.sampled import LoopElements, SampledLoop
from dualbend.stability.state_space import StateSpace
from support.strip import STRIP8, STRIP9

STEPS, SERVO_K, SHEET_K, INERTIA, TOOL = 16, 2000.0, 30.0, 0.2, 0.03

MODEL = f"""
<mujoco>
  <option timestep="{COMMAND_PERIOD_S / STEPS}" gravity="0 0 0" integrator="discrete"/>
  <worldbody><body><joint name="j" axis="0 1 0" stiffness="{SHEET_K}" damping="0.4"/>
    <inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/></body></worldbody>
  <actuator><general joint="j" biastype="affine" gainprm="{SERVO_K}"
    biasprm="0 -{SERVO_K} -DAMPING"/></actuator>
</mujoco>
"""


INTEGRAL = IntegralAction(
    IntegralConfig(),
    stiffness=np.array([SERVO_K]),
    torque_limit=np.array([1e9]),
    period_s=COMMAND_PERIOD_S,
)


def one_joint(integral_gain: float = 0.0) -> tuple[CompliantArm, JointServo]:
    """Return one hinge about y that turns the grip by its own angle, on a spring for a sheet."""
    servo = JointServo(
        stiffness=np.array([SERVO_K]),
        inertia=np.array([0.15]),
        viscous_friction=np.array([0.4]),
        coulomb_friction=np.zeros(1),
        damping_ratio=1.0,
    )
    turn = np.array([[0.0], [0.0], [1.0]])
    joints = Joints(
        mass=np.array([[INERTIA]]),
        stiffness=servo.stiffness,
        damping=servo.damping + 0.4,
        feed_forward=np.array([0.15]),
        jacobian=turn,
        setpoint=turn.T,
        dry_friction=np.array([4.0]),
        integral_gain=integral_gain,
    )
    sheet, tool = np.diag([0.0, 0.0, SHEET_K]), np.diag([0.0, 0.0, TOOL])
    rows = [0, 2]
    arm = CompliantArm(
        joints=joints,
        deviation_jacobian=np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]),
        stiffness=sheet,
        mass=np.zeros((3, 3)),
        stiffness_read=sheet[rows],
        mass_read=tool[rows],
    )
    return arm, servo


@pytest.mark.parametrize("integrates", [False, True])
@pytest.mark.parametrize("age", [1, 6, STEPS, STEPS + 3])
def test_the_cycle_is_what_mujoco_steps(age: int, integrates: bool) -> None:
    arm, servo = one_joint(INTEGRAL.gain if integrates else 0.0)
    response = CommandResponse(CommandResponseConfig(), 1, STEPS, period_s=COMMAND_PERIOD_S)
    cycle, cycles = arm.cycle(response, age, (False, True))
    model = mujoco.MjModel.from_xml_string(MODEL.replace("DAMPING", str(servo.damping[0])))
    data = mujoco.MjData(model)
    setpoints = 0.1 * np.random.default_rng(2).normal(size=30)
    response.reset(0.0)
    INTEGRAL.reset()
    offset = np.zeros(1)
    wrenches = [0.0] * (age + 1)
    state = np.zeros(cycle.a.shape[0])
    found, expected = [], []
    for setpoint in setpoints:
        found.append((cycle.c @ state + cycle.d[:, 0] * setpoint)[0])
        state = cycle.a @ state + cycle.b[:, 0] * setpoint
        if integrates:
            offset = INTEGRAL.update(response.position - data.qpos)
        # Of the wrenches at the ends of the steps, the one that is `age` steps old next time.
        reference = response.update(np.array([setpoint]))
        for row in servo.setpoint(reference.position, reference.velocity, reference.acceleration):
            before = data.qvel[0]
            data.ctrl[:] = row + offset
            mujoco.mj_step(model, data)
            acceleration = (data.qvel[0] - before) / model.opt.timestep
            wrenches.append(-SHEET_K * data.qpos[0] - TOOL * acceleration)
        expected.append(wrenches[len(wrenches) - age + (cycles - 1) * STEPS])
    # Rounding only: backward Euler on both sides.
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())
    assert state[3] == pytest.approx(data.qpos[0], abs=1e-12)
    assert state[5:] == pytest.approx(offset if integrates else [], abs=1e-12)


def test_integral_action_takes_a_steady_load_off_the_joint() -> None:
    response = CommandResponse(CommandResponseConfig(), 1, STEPS, period_s=COMMAND_PERIOD_S)
    share = SERVO_K / (SERVO_K + SHEET_K)
    for gain in (0.0, 0.02):
        cycle, _ = one_joint(gain)[0].cycle(response, 1, (False, True))
        size = cycle.a.shape[0]
        rest = np.linalg.solve(np.eye(size) - cycle.a, cycle.b[:, 0])
        # Analytic: two springs, the servo's and the sheet's, or the servo's has no end.
        assert rest[3] == pytest.approx(1.0 if gain else share, rel=1e-9)
        if gain:
            # Analytic: z ← z − k_i T K/(K + S) z, where the joint is far quicker than that.
            slowest = max(abs(np.linalg.eigvals(cycle.a)))
            assert 1.0 - slowest == pytest.approx(gain * share, rel=0.01)


def test_a_vanishing_integral_is_none() -> None:
    elements = LoopElements.from_scenario(load_scenario(STRIP9))
    (at,) = environments(load_scenario(STRIP9), [0.3])
    arm = at.arms["single"]

    def growth(gain: float) -> float:
        mover = replace(arm, joints=replace(arm.joints, integral_gain=gain))
        return (
            SampledLoop(elements, at.loops["single"], (True, True), arm=mover).mode().growth_per_s
        )

    # Analytic: what it changes is proportional to a small gain.
    changes = [growth(gain) - growth(0.0) for gain in (1e-5, 2e-5)]
    assert abs(changes[1]) < 1e-3
    assert changes[1] == pytest.approx(2.0 * changes[0], rel=1e-3)


def test_both_modes_of_two_arms_have_the_servos_integral() -> None:
    both = ['compliance.sensing=["left","right"]', 'compliance.complying=["left","right"]']
    with_it = [*both, "robot.servo.integral.rate_per_s=10"]
    (plain,), (at,) = (environments(load_scenario(STRIP9, sets), [0.3]) for sets in (both, with_it))
    assert set(at.arms) == {"symmetric", "antisymmetric"}
    # Analytic: 10 1/s of 28 ms.
    assert [arm.joints.integral_gain for arm in at.arms.values()] == pytest.approx([0.28, 0.28])
    assert all(arm.joints.integral_gain == 0.0 for arm in plain.arms.values())


def test_a_stiff_arm_in_small_steps_does_what_the_response_says() -> None:
    growth = []
    for step_s in (0.00175, 0.000875):
        scenario = load_scenario(
            STRIP9,
            [f"physics.step_s={step_s}", "sensor.latency_ms=10.5", "robot.servo.damping_ratio=1"],
        )
        elements = LoopElements.from_scenario(scenario)
        (at,) = environments(scenario, [0.3])
        arm = at.arms["single"]
        joints = replace(
            arm.joints,
            stiffness=1e6 * arm.joints.stiffness,
            damping=1e3 * arm.joints.damping,
            feed_forward=1e6 * arm.joints.feed_forward,
            mass=1e6 * np.diag(arm.joints.feed_forward),
        )
        stiff = replace(arm, joints=joints)
        inertia = (arm.mass_read @ arm.deviation_jacobian).astype(float)
        loops = [
            SampledLoop(
                elements, arm.stiffness_read @ arm.deviation_jacobian, (True, True), inertia, mover
            )
            for mover in (stiff, None)
        ]
        growth.append([loop.mode().growth_per_s for loop in loops])
    gaps = [abs(with_arm - rigid) for with_arm, rigid in growth]
    # Discretisation-limited, first order in the physics step.
    assert gaps[0] < 0.15
    assert gaps[1] == pytest.approx(gaps[0] / 2.0, rel=0.15)


def test_the_frequency_response_is_the_resolvent() -> None:
    rng = np.random.default_rng(3)
    # A defective pole, as the critically damped response and a delay have.
    a = np.triu(rng.normal(size=(5, 5)), 1) + 0.4 * np.eye(5)
    system = StateSpace(
        a=a, b=rng.normal(size=(5, 2)), c=rng.normal(size=(3, 5)), d=rng.normal(size=(3, 2))
    )
    z_inverse = np.exp(-1j * np.array([0.0, 0.3, 2.0, np.pi]))
    found = system.frequency_response(z_inverse)
    for value, inverse in zip(found, z_inverse, strict=True):
        expected = system.c @ np.linalg.solve(np.eye(5) / inverse - a, system.b) + system.d
        # Rounding only.
        np.testing.assert_allclose(value, expected, rtol=1e-10)


def test_joints_that_nothing_moves_are_left_to_their_friction() -> None:
    (at,) = environments(load_scenario(STRIP8), [0.4])
    # Analytic: in the paper's plane only shoulder, elbow and wrist bend.
    assert at.arms["single"].joints.stiffness.tolist() == [3.3e4, 0.57e4, 2.0e3]
    (aside,) = environments(load_scenario(STRIP8, ["cell.base_lateral_m=0.2"]), [0.4])
    assert len(aside.arms["single"].joints.stiffness) == 6
    arm = at.arms["single"]
    # Analytic: the joints' set-points do what is sent, and nothing else in the plane.
    np.testing.assert_allclose(
        arm.joints.jacobian @ arm.joints.setpoint @ arm.deviation_jacobian,
        arm.deviation_jacobian,
        atol=1e-9,
    )


def test_a_joint_that_rubs_is_read_behind_its_set_point() -> None:
    arm, _ = one_joint()
    # Analytic: 4 N m on the servo's spring, and one joint that turns the grip by its own angle.
    assert arm.friction_lag() == pytest.approx([0.0, 4.0 / SERVO_K])
