"""A scenario's cell made ready to be commanded: IK, servos, response, physics, sensors, link."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property, partial

import mujoco
import numpy as np

from dualbend.arm.pair import ArmPair
from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.control.brake import Brakes
from dualbend.control.calibration import Calibration, calibrated
from dualbend.control.clock import steps_per_cycle
from dualbend.control.filters import LowPass
from dualbend.control.force_torque import Sensor, ToolGravityCompensation, WrenchChain
from dualbend.control.guard import Guard, SensorGuard
from dualbend.control.response import ArmResponses, CommandResponse
from dualbend.control.servo import FrictionEstimate, IntegralAction, JointServo
from dualbend.control.wrist import WristSensors
from dualbend.errors import InputError
from dualbend.imperfection.draws import noise_streams
from dualbend.imperfection.link import CommandLink
from dualbend.imperfection.robot import Stribeck
from dualbend.imperfection.sensor import ErringSensor, SensorErrors
from dualbend.imperfection.weighing import weighed
from dualbend.run.arm_load import refuse_payload
from dualbend.run.arms import arm_pair, joint_stiffness
from dualbend.run.true_scene import compiled_with_looks, composed
from dualbend.scenario.scenario import Scenario
from dualbend.scene.believed import SITES, BelievedArms, Measured
from dualbend.scene.cell import compiled_robots, without_looks
from dualbend.scene.ik import InverseKinematics, carried_targets, grip_targets
from dualbend.scene.observation import SensorSample, tool_mass_and_centre
from dualbend.scene.posed import PosedArms
from dualbend.scene.sheet.model import ShellModel
from dualbend.scene.sheet.strips import StripConfig
from dualbend.scene.simulation import Simulation
from dualbend.types import SIDES, Mask, Side, Vector

_TURN_RAD = 1.6
"""How far the last joints turn to either side for a calibration."""

_EVEN = np.array([0.8191725134, 0.6710436067, 0.5497004779])
"""Powers of the root of x⁴ = x + 1: multiples of them fill a cube evenly (Roberts 2018)."""


class RobotCell:
    """Both arms with the sheet between them, at rest, tracking joint set-points cycle by cycle.

    ``start``: x, z [m] and end slope α [rad] of both grips in their bending frames, (3,).
    ``place``: where these frames are carried to at the start, (4,) as
    :func:`dualbend.scene.ik.carried_targets` has it; None: nowhere. InputError where the start is
    out of reach.

    Attributes
    ----------
    robots, compiled : models of the arms as the controller believes them and of the whole cell
    with_looks : returns the model with its looks; it keeps nothing of the cell's state
    positions : of the physics (nq,), which :meth:`reset` put it in
    """

    positions: Vector

    def __init__(self, scenario: Scenario, start: Vector, place: Vector | None = None) -> None:
        self.scenario, self.start, self.place = scenario, start, place
        self.arms = arms = arm_pair(scenario)
        self.robots = robots = compiled_robots(arms)
        self.home = self.reach(start, arms.home, place)
        self.servo = make_servo(scenario, robots, self.home)
        self.sheet = scenario.true_sheet
        self.compiled = without_looks(composed(scenario, arms, self.servo, looks=False)).compile()
        self.with_looks = partial(compiled_with_looks, scenario, arms, self.servo)
        self._believed = BelievedArms(PosedArms(robots, SITES))
        self.friction_law: Stribeck | None = None
        self.integral = make_integral(scenario, robots)
        self.friction = FrictionEstimate(
            scenario.robot.servo.friction_estimate,
            stiffness=self.servo.stiffness,
            coulomb_friction=robots.dof_frictionloss,
            period_s=scenario.period_s,
        )
        self.response = make_response(scenario, arms)
        self.brakes = Brakes(
            len(self.home),
            self.response.steps,
            period_s=scenario.period_s,
            time_s=scenario.guard.stop_time_s,
        )
        self.reference = self.home
        """Joint angles (n,) that the servos are sent to at the start of a cycle [rad]."""
        self.calibrations = self._calibrated()
        """By side; empty where none is asked for."""

    @cached_property
    def ik(self) -> InverseKinematics:
        """Inverse kinematics of the arms as the controller believes them."""
        return InverseKinematics(self.robots, self.arms.home)

    @cached_property
    def simulation(self) -> Simulation:
        """The physics."""
        scenario, model, config = self.scenario, self.compiled, self.scenario.sheet.model
        simulation = Simulation(
            model,
            scenario.grasp,
            config if isinstance(config, StripConfig) else ShellModel(model, self.sheet, config),
            latency_steps=scenario.sensor.latency_steps(scenario.step_s),
            sampling_steps=scenario.sensor.sampling_steps(scenario.step_s),
            width_m=self.sheet.width_m,
            period_s=scenario.period_s,
        )
        errors, data = scenario.imperfections.robot, simulation.data
        if errors.weighs_wrong:
            simulation.fed_forward = self._believed.coriolis
        if errors.stiction_excess:
            # Once: it overwrites the friction that the model was compiled with.
            law = self.friction_law or Stribeck(errors, model, simulation.dofs)
            self.friction_law = law
            simulation.on_step.append(partial(law.on_step, data.qvel[law.span]))
        return simulation

    @cached_property
    def measured(self) -> Measured:
        """Where the grips are by the encoders."""
        errors, simulation = self.scenario.imperfections.robot, self.simulation
        believed = self._believed if errors.displaces else None
        return Measured(simulation.observer, simulation.data, believed)

    def let_go(self) -> None:
        """Let go of MuJoCo's states, 1.1 MB; what is asked for later is built again, unreset."""
        for name in ("ik", "simulation", "measured"):
            vars(self).pop(name, None)

    @cached_property
    def spec(self) -> mujoco.MjSpec:
        """The whole scene with its looks."""
        return composed(self.scenario, self.arms, self.servo, looks=True)

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The model with its looks, for pictures; the same joints as the simulated one."""
        return self.spec.compile()

    def scene_xml(self, key: str) -> str:
        """Return the MJCF, the present state as a key frame; InputError where it is a shell."""
        if self.scenario.sheet.model.kind == "shell":
            raise InputError(
                'sheet.model = "shell": its elasticity is written after compilation, no MJCF file '
                'can hold it; export "strips"'
            )
        spec, data = self.spec.copy(), self.simulation.data
        spec.add_key(name=key, qpos=data.qpos.copy(), ctrl=data.ctrl.copy())
        spec.compile()
        return str(spec.to_xml())

    def reach(self, pose: Vector, guess: Vector, place: Vector | None = None) -> Vector:
        """Return the joint angles (n,) for both grips at (x, z, α); InputError where none are."""
        both = np.array([pose, pose])
        targets = grip_targets(both) if place is None else carried_targets(both, place)
        return self.ik.solve_from_home(targets, guess).q

    def reset(self) -> SensorSample:
        """Put the cell at rest in its start, the sheet in its zero-moment shape."""
        sheet = self.scenario.sheet
        arcs = np.linspace(0.0, sheet.length_m, sheet.model.sections + 1)
        _, _, slopes = elastica.shape(float(self.start[2]), sheet.length_m, arcs)
        simulation = self.simulation
        self.rest()
        middle = np.array([0.0, 0.0, self.scenario.cell.sheet_height_m])
        ends = self.sheet.thickness_at(np.array([0.0, sheet.length_m]))
        opening = float(ends.max()) / 2
        self.positions = simulation.positions(self.home, opening, slopes, middle)
        return simulation.reset(self.positions)

    def rest(self) -> None:
        """Let response and servos be at rest in the start."""
        self.response.reset(self.home)
        self.brakes.reset()
        self.integral.reset()
        self.friction.reset()
        if self.friction_law is not None:
            self.friction_law.rest()
        self.reference = self.response.position

    def _calibrated(self) -> dict[Side, Calibration]:
        """Return what the calibration of each wrist sensor found; empty where none is asked for."""
        config, scenario = self.scenario.sensor.calibration, self.scenario
        if config is None:
            return {}
        poses = self._attitudes(config.attitudes)
        down = np.array([0.0, 0.0, -GRAVITY_M_PER_S2])
        truly = self.simulation.sensor_axes_at(poses).mT @ down
        believed = BelievedArms(PosedArms(self.ik.model, SITES))
        told = np.array([believed.sensor_axes(q).copy() for q in poses]).mT @ down
        found = {}
        for i, (side, arm) in enumerate(zip(SIDES, self.arms, strict=True)):
            weight = "sensor.calibration.weight_kg ="
            refuse_payload(self.ik.model, side, arm.model, config.weight_kg, weight)
            true_tool = tool_mass_and_centre(self.simulation.model, side)
            of = (scenario.seed, side)
            errors = scenario.imperfections.sensor
            readings = weighed(config, scenario.sensor, errors, of, true_tool, truly[:, i])
            tool = believed_tool(scenario, self.simulation.model, side)
            found[side] = calibrated(config, scenario.sensor, tool, told[:, i], readings)
        return found

    def _attitudes(self, count: int) -> Vector:
        """Return joint angles (count, n): the last three hinges of each arm turned, even spread."""
        poses = np.tile(self.home, (count, 1))
        low, high = self.simulation.joint_range.T
        for side, arm in zip(SIDES, self.arms, strict=True):
            last = np.flatnonzero(~np.array(arm.model.slides))[-3:] + self.arms.joints(side).start
            share = np.modf(np.arange(1, count + 1)[:, np.newaxis] * _EVEN)[0]
            least = np.maximum(low[last], self.home[last] - _TURN_RAD)
            most = np.minimum(high[last], self.home[last] + _TURN_RAD)
            poses[:, last] = least + share * (most - least)
        return poses

    def stop(self, sides: Iterable[Side]) -> Mask:
        """Stop arms from where and how fast their references are; returns which joints (n,)."""
        joints = np.zeros(len(self.home), dtype=np.bool_)
        for side in sides:
            joints[self.arms.joints(side)] = True
        self.brakes.stop(joints, self.response.position, self.response.speed)
        return joints

    def send(self, q: Vector, *, free: bool = False) -> SensorSample:
        """Run one command cycle towards the joint set-points (n,) [rad].

        ``free``: nothing but the arms holds what they hold, so that they can tell their friction.
        """
        error = self.reference - self.simulation.q
        offset = self.integral.update(error)
        if free:
            self.friction.update(error + offset, self.response.speed)
        commanded = self.response.update(q)
        now = self.brakes.update(commanded)
        self.reference = self.brakes.position(commanded.position[-1])
        setpoints = self.servo.setpoint(
            now.position, now.velocity, now.acceleration, self.friction.ratio
        )
        setpoints += offset
        return self.simulation.advance(setpoints)


def make_servo(scenario: Scenario, robots: mujoco.MjModel, home: Vector) -> JointServo:
    """Return the servo of all joints, with the inertia that each sees at the home pose."""
    data = mujoco.MjData(robots)
    data.qpos[:] = home
    mujoco.mj_forward(robots, data)
    inertia = np.zeros((robots.nv, robots.nv))
    mujoco.mj_fullM(robots, data, inertia)
    return JointServo(
        stiffness=joint_stiffness(scenario),
        inertia=np.diag(inertia).copy(),
        viscous_friction=robots.dof_damping.copy().ravel(),
        coulomb_friction=robots.dof_frictionloss.copy().ravel(),
        damping_ratio=scenario.robot.servo.damping_ratio,
    )


def make_response(
    scenario: Scenario, arms: ArmPair, shape: tuple[int, ...] = ()
) -> CommandResponse | ArmResponses:
    """Return the response of all joints to commands, of any leading shape."""
    robot, period_s = scenario.robot, scenario.period_s
    steps = steps_per_cycle(scenario.step_s, period_s)

    def of(side: Side, joints: int) -> CommandResponse:
        return CommandResponse(
            robot.response_of(side), joints, steps, period_s=period_s, shape=shape
        )

    if robot.response_of("left") == robot.response_of("right"):
        return of("left", arms.count)
    return ArmResponses([of(side, arms.of(side).model.count) for side in SIDES])


def make_integral(
    scenario: Scenario, robots: mujoco.MjModel, shape: tuple[int, ...] = ()
) -> IntegralAction:
    """Return the integral action of all joints' servos, of any leading shape."""
    return IntegralAction(
        scenario.robot.servo.integral,
        stiffness=joint_stiffness(scenario),
        torque_limit=robots.jnt_actfrcrange[:, 1],
        period_s=scenario.period_s,
        shape=shape,
    )


def make_guard(scenario: Scenario, cell: RobotCell, shape: tuple[int, ...] = ()) -> Guard:
    """Return what checks all joints, of any leading shape."""
    simulation, slides = cell.simulation, cell.arms.slides
    return Guard(
        scenario.guard,
        simulation.joints,
        simulation.joint_range,
        simulation.torque_limit,
        cell.arms.speed_limit,
        shape,
        slides=[name for name, slide in slides.items() if slide],
    )


def make_sensor_guard(
    scenario: Scenario, sensors: WristSensors, shape: tuple[int, ...] = ()
) -> SensorGuard:
    """Return what checks the wrist sensors, of any leading shape."""
    return SensorGuard(
        scenario.guard,
        [SIDES[i] for i in sensors.arms],
        shape,
        reading_cycles=scenario.sensor.reading_cycles(scenario.period_s),
    )


def make_sensors(
    scenario: Scenario,
    model: mujoco.MjModel,
    calibrations: Mapping[Side, Calibration] | None = None,
) -> WristSensors:
    """Return the wrist sensors of the sensing arms, each with a noise stream of its own."""
    streams = noise_streams(scenario.seed, len(SIDES), scenario.repeat)
    arms = [i for i, side in enumerate(SIDES) if side in scenario.compliance.sensing]
    shape = (len(arms),)
    errors, noise = scenario.imperfections.sensor, [streams[i] for i in arms]
    named = [(scenario.seed, SIDES[i]) for i in arms]
    sensor = (
        Sensor(scenario.sensor, noise, shape)
        if errors == SensorErrors()
        else ErringSensor(
            scenario.sensor,
            noise,
            errors,
            named,
            shape,
            period_s=scenario.sensor.reading_period_s(scenario.period_s),
            repeat=scenario.repeat,
        )
    )
    known = [calibrations[side] for _, side in named] if calibrations else []
    tools = [(each.mass_kg, each.centre_m) for each in known] or [
        believed_tool(scenario, model, side) for _, side in named
    ]
    chain = WrenchChain(
        sensor,
        ToolGravityCompensation([mass for mass, _ in tools], [centre for _, centre in tools]),
        LowPass(scenario.filter, period_s=scenario.period_s, shape=shape),
        np.eye(3),
        [each.matrix for each in known] or None,
    )
    return WristSensors(chain, arms)


def believed_tool(scenario: Scenario, model: mujoco.MjModel, side: Side) -> tuple[float, Vector]:
    """Return mass [kg] and centre (3,) [m], in the sensor's axes, of what a wrist sensor bears.

    As the controller believes them.
    """
    errors = scenario.imperfections.sensor
    return errors.believed_tool(scenario.seed, side, *tool_mass_and_centre(model, side))


def make_link(scenario: Scenario, cell: RobotCell) -> CommandLink | None:
    """Return the link of both arms' commands; None where it makes no error."""
    config, joints = scenario.imperfections.link, cell.simulation.joints
    if not config.errs:
        return None
    counts = [sum(name.startswith(side) for name in joints) for side in SIDES]
    return CommandLink(
        config,
        scenario.seed,
        SIDES,
        counts,
        cell.home,
        period_s=scenario.period_s,
        repeat=scenario.repeat,
    )
