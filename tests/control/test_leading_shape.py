"""Many worlds at once are as many single ones, bit for bit: every class of the control package.

Each case streams random inputs (cycles, *worlds, ...) through the objects of a leading shape and
through single ones; nothing in its outputs may differ by a bit.
"""

import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dualbend.control.alter import AlterMode, PathModification
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import (
    Admittance,
    AdmittanceConfig,
    ModelAdmittanceConfig,
)
from dualbend.control.compliance.base import AxisConfig, DirectionConfig
from dualbend.control.compliance.mass_spring_damper import (
    DIRECTIONS,
    Frame,
    MassSpringDamperConfig,
    SpatialAdmittance,
)
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.compliance.object import (
    ObjectAdmittance,
    ObjectComplianceConfig,
    net_wrench,
)
from dualbend.control.compliance.pair import PairCompliance
from dualbend.control.compliance.predictor import PredictorConfig, ResponseLead, ResponseModel
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.control.compliance.schedule import FusionConfig, KnownSheet, ScheduleConfig
from dualbend.control.controller import ControlledPath, Observation
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import FirConfig, IirConfig, LowPass, LowPassConfig, NoFilterConfig
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.control.guard import Guard, GuardConfig, SensorGuard
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.control.servo import (
    FrictionEstimate,
    FrictionEstimateConfig,
    IntegralAction,
    IntegralConfig,
    JointServo,
)
from dualbend.control.wrist import WristSensors
from dualbend.types import PlanarPose, Vector, Wrench

T = COMMAND_PERIOD_S
CYCLES = 8
Shape = tuple[int, ...]
WORLDS = st.sampled_from([(1,), (3,), (2, 2), (5,)])
SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=5)
"""Each example is some hundred numbers, and a difference shows in most of them."""
RESPONSE = CommandResponseConfig(natural_frequency_hz=2.2, damping_ratio=0.9)

Stream = Callable[..., list[tuple[Any, ...]]]
"""Leading shape, seeds of its noise in C order, inputs (cycles, ...) → outputs of each cycle."""


def assert_worlds_are_single_ones(
    stream: Stream, worlds: Shape, seed: int, inputs: dict[str, tuple[float, Shape]]
) -> None:
    """Compare; ``inputs`` by name: scale and shape of what one world is given in one cycle."""
    rng = np.random.default_rng(seed)
    drawn = {
        name: scale * rng.standard_normal((CYCLES, *worlds, *shape))
        for name, (scale, shape) in inputs.items()
    }
    seeds = rng.integers(2**32, size=worlds)
    together = stream(worlds, seeds.ravel().tolist(), **drawn)
    for world in np.ndindex(worlds):
        alone = stream(
            (), [int(seeds[world])], **{name: a[(slice(None), *world)] for name, a in drawn.items()}
        )
        for all_worlds, one in zip(together, alone, strict=True):
            for whole, part in zip(all_worlds, one, strict=True):
                np.testing.assert_array_equal(np.asarray(whole)[world], part)


def noises(seeds: list[int], arms: int = 1) -> list[np.random.Generator]:
    """Return the streams of each world's arms."""
    return [np.random.default_rng([seed, arm]) for seed in seeds for arm in range(arms)]


# --- filters, delay, response, servo ------------------------------------------------------------


@pytest.mark.parametrize(
    "config",
    [
        NoFilterConfig(),
        FirConfig(taps=2),
        FirConfig(taps=5, window="boxcar"),
        IirConfig(order=4),
    ],
    ids=str,
)
@FEW
@given(WORLDS, SEEDS)
def test_low_pass(config: LowPassConfig, worlds: Shape, seed: int) -> None:
    def stream(shape: Shape, _: list[int], value: Vector) -> list[tuple[Any, ...]]:
        low_pass = LowPass(config, 4, period_s=T, shape=shape)
        low_pass.reset(value[0])
        return [(low_pass.update(sample),) for sample in value]

    assert_worlds_are_single_ones(stream, worlds, seed, {"value": (30.0, (4,))})


@FEW
@given(WORLDS, SEEDS, st.integers(0, 3))
def test_transport_delay(worlds: Shape, seed: int, cycles: int) -> None:
    def stream(shape: Shape, _: list[int], value: Vector) -> list[tuple[Any, ...]]:
        delay = TransportDelay(cycles, 3, shape)
        delay.reset(value[0])
        return [(delay.update(sample),) for sample in value]

    assert_worlds_are_single_ones(stream, worlds, seed, {"value": (1.0, (3,))})


@FEW
@given(WORLDS, SEEDS, st.integers(1, 16))
def test_command_response(worlds: Shape, seed: int, steps: int) -> None:
    def stream(shape: Shape, _: list[int], setpoint: Vector) -> list[tuple[Any, ...]]:
        response = CommandResponse(RESPONSE, 5, steps, period_s=T, shape=shape)
        response.reset(setpoint[0])
        found = []
        for u in setpoint:
            parts = response.update(u)
            found.append((parts.position, parts.velocity, parts.acceleration, response.position))
        return found

    assert_worlds_are_single_ones(stream, worlds, seed, {"setpoint": (2.0, (5,))})


@FEW
@given(WORLDS, SEEDS)
def test_joint_servo(worlds: Shape, seed: int) -> None:
    one = np.linspace(1.0, 2.0, 6)
    servo = JointServo(
        stiffness=2e3 * one,
        inertia=one,
        viscous_friction=3.0 * one,
        coulomb_friction=5.0 * one,
        damping_ratio=1.0,
    )

    def stream(_: Shape, __: list[int], **reference: Vector) -> list[tuple[Any, ...]]:
        rows = zip(*reference.values(), strict=True)
        return [(servo.setpoint(*row),) for row in rows]

    scales = {"position": 1.0, "speed": 1e-4, "acceleration": 1.0}
    assert_worlds_are_single_ones(
        stream, worlds, seed, {name: (scale, (6,)) for name, scale in scales.items()}
    )


@FEW
@given(WORLDS, SEEDS)
def test_integral_action(worlds: Shape, seed: int) -> None:
    one = np.linspace(1.0, 2.0, 6)

    def stream(shape: Shape, _: list[int], error: Vector) -> list[tuple[Any, ...]]:
        action = IntegralAction(
            IntegralConfig(), stiffness=2e3 * one, torque_limit=one, period_s=T, shape=shape
        )
        return [(action.update(row).copy(),) for row in error]

    assert_worlds_are_single_ones(stream, worlds, seed, {"error": (1e-3, (6,))})


@FEW
@given(WORLDS, SEEDS)
def test_friction_estimate(worlds: Shape, seed: int) -> None:
    one = np.linspace(1.0, 2.0, 6)

    def stream(shape: Shape, _: list[int], error: Vector, speed: Vector) -> list[tuple[Any, ...]]:
        found = FrictionEstimate(
            FrictionEstimateConfig(),
            stiffness=2e3 * one,
            coulomb_friction=5.0 * one,
            period_s=T,
            shape=shape,
        )
        return [(found.update(*row).copy(),) for row in zip(error, speed, strict=True)]

    scales = {"error": (1e-3, (6,)), "speed": (1e-2, (6,))}
    assert_worlds_are_single_ones(stream, worlds, seed, scales)


# --- sensors and guard --------------------------------------------------------------------------

SKEWED = Rotation.from_euler("xyz", [0.3, -0.8, 1.9]).as_matrix()


def rotations(angles: Vector) -> Vector:
    """Return rotations (..., 3, 3) of rotation vectors (..., 3)."""
    flat = Rotation.from_rotvec(angles.reshape(-1, 3)).as_matrix()
    return flat.reshape(*angles.shape[:-1], 3, 3)


@pytest.mark.parametrize("noise", [0.0, 0.05])
@FEW
@given(WORLDS, SEEDS)
def test_sensor_with_its_noise_its_range_and_its_counts(
    noise: float, worlds: Shape, seed: int
) -> None:
    config = ForceTorqueConfig(force_noise_n=noise, torque_noise_nm=noise, torque_resolution_nm=0.0)

    def stream(shape: Shape, seeds: list[int], wrench: Vector) -> list[tuple[Any, ...]]:
        sensor = Sensor(config, noises(seeds), shape)
        return [sensor.read(each) for each in wrench]

    assert_worlds_are_single_ones(stream, worlds, seed, {"wrench": (40.0, (6,))})


@FEW
@given(WORLDS, SEEDS)
def test_wrench_chain(worlds: Shape, seed: int) -> None:
    def stream(
        shape: Shape, seeds: list[int], wrench: Vector, angles: Vector
    ) -> list[tuple[Any, ...]]:
        chain = WrenchChain(
            Sensor(ForceTorqueConfig(), noises(seeds), shape),
            ToolGravityCompensation(1.3, [0.01, -0.02, 0.05]),
            LowPass(IirConfig(), period_s=T, shape=shape),
            SKEWED,
        )
        turns = rotations(angles)
        samples = [chain.update(*each) for each in zip(wrench, turns, strict=True)]
        return [
            (s.sensor.components, s.raw.components, s.filtered.components, s.clipped, s.fresh)
            for s in samples
        ]

    inputs = {"wrench": (20.0, (6,)), "angles": (1.0, (3,))}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


@FEW
@given(WORLDS, SEEDS)
def test_guard_tells_what_is_outside(worlds: Shape, seed: int) -> None:
    limits = np.linspace(1.0, 2.0, 4)
    arguments = ("abcd", np.stack([-2.0 * limits, 2.0 * limits], axis=1), limits, limits)

    def stream(shape: Shape, _: list[int], **joints: Vector) -> list[tuple[Any, ...]]:
        guard = Guard(GuardConfig(torque_cycles=2), *arguments, shape)
        rows = zip(*joints.values(), strict=True)
        return [tuple(guard.outside(*row)) for row in rows]

    inputs = dict.fromkeys(("q", "speed", "torque", "reference"), (1.5, (4,)))
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


@FEW
@given(WORLDS, SEEDS)
def test_sensor_guard_tells_which_sensor_is_outside(worlds: Shape, seed: int) -> None:
    def stream(shape: Shape, _: list[int], wrench: Vector) -> list[tuple[Any, ...]]:
        guard = SensorGuard(GuardConfig(sensor_cycles=2), ("left", "right"), shape)
        clipped, fresh = np.abs(wrench) > 2.5, wrench[..., 0] > 0.0
        return [tuple(guard.outside(*row)) for row in zip(clipped, fresh, strict=True)]

    assert_worlds_are_single_ones(stream, worlds, seed, {"wrench": (1.5, (2, 6))})


# --- compliance ---------------------------------------------------------------------------------

AXIS = AxisConfig(b=7.0, k=57.0, from_alpha_rad=0.2)


@pytest.mark.parametrize("tare", [False, True])
@pytest.mark.parametrize("off", ["", "x", "rotation"])
@FEW
@given(WORLDS, SEEDS)
def test_admittance_as_its_axes_switch_on_and_off_and_meet_their_bounds(
    off: str, tare: bool, worlds: Shape, seed: int
) -> None:
    config = AdmittanceConfig(x=AXIS, rotation=AXIS, tare=tare, limit_x_m=1e-3)
    config = msgspec.structs.replace(config, **{off: None} if off else {})

    def stream(shape: Shape, _: list[int], load: Vector, alpha: Vector) -> list[tuple[Any, ...]]:
        admittance = Admittance(config, period_s=T, shape=shape)
        rows = zip(load, alpha, strict=True)
        return [(admittance.update(f, a), admittance.saturated) for f, a in rows]

    assert_worlds_are_single_ones(stream, worlds, seed, {"load": (6.0, (2,)), "alpha": (0.4, ())})


def known_sheet(seed: int = 5) -> KnownSheet:
    """Return made-up tables that are linear in nothing."""
    rng, n = np.random.default_rng(seed), 6
    return KnownSheet(
        alpha_rad=np.array([0.01, 0.1, 0.25, 0.5, 0.8, 1.2]),
        force_x_n=-1.0 - rng.random(n),
        stiffness=100.0 + 50.0 * rng.random((n, 3, 2)),
        inertia=rng.random((n, 3, 3)),
        deviation_jacobian=rng.standard_normal((n, 3, 2)),
        compression_m=-np.cumsum(rng.random((n, 5)), axis=1) * 1e-2,
        compression_n=np.cumsum(rng.random((n, 5)), axis=1) - 3.0,
        force_z_n=-0.15,
        lever_arm_m=0.12,
    )


@FEW
@given(WORLDS, SEEDS)
def test_look_ups_of_the_known_sheet_inside_and_outside_its_tables(
    worlds: Shape, seed: int
) -> None:
    known = known_sheet()

    def stream(_: Shape, __: list[int], alpha: Vector, load: Vector) -> list[tuple[Any, ...]]:
        return [
            (
                known.force(a),
                known.tangent(a),
                *known.tool(a),
                known.displacement(f, a),
                known.compression_force(0.02 * f, a),
            )
            for a, f in zip(alpha, load, strict=True)
        ]

    assert_worlds_are_single_ones(stream, worlds, seed, {"alpha": (0.8, ()), "load": (3.0, ())})


@pytest.mark.parametrize("lag_s", [0.0, 0.05])
@FEW
@given(WORLDS, SEEDS)
def test_response_lead(lag_s: float, worlds: Shape, seed: int) -> None:
    def stream(shape: Shape, _: list[int], error: Vector) -> list[tuple[Any, ...]]:
        lead = ResponseLead(RESPONSE, lag_s, period_s=T, shape=shape)
        return [(lead.update(e),) for e in error]

    assert_worlds_are_single_ones(stream, worlds, seed, {"error": (1.0, ())})


def response_model(shape: Shape, channels: int, delay_cycles: int, age_steps: int) -> ResponseModel:
    return ResponseModel(
        response=RESPONSE,
        low_pass=FirConfig(taps=2),
        delay_cycles=delay_cycles,
        steps=8,
        age_steps=age_steps,
        channels=channels,
        period_s=T,
        shape=shape,
    )


@pytest.mark.parametrize("age_steps", [1, 8, 13])
@FEW
@given(WORLDS, SEEDS)
def test_response_model(age_steps: int, worlds: Shape, seed: int) -> None:
    def stream(shape: Shape, _: list[int], setpoint: Vector) -> list[tuple[Any, ...]]:
        model = response_model(shape, 3, 1, age_steps)
        model.reset(setpoint[0])
        found = []
        for u in setpoint:
            found.append(model.read())
            model.send(u)
        return found

    assert_worlds_are_single_ones(stream, worlds, seed, {"setpoint": (1.0, (3,))})


SHEET_AXIS = AxisConfig(b=0.1, k=0.5, form="static", from_alpha_rad=0.1)
MODELLED = ModelAdmittanceConfig(
    units="sheet",
    x=SHEET_AXIS,
    rotation=SHEET_AXIS,
    schedule=ScheduleConfig(curve=True),
    reference=ReferenceConfig(known_weight=True),
    fusion=FusionConfig(),
    predictor=PredictorConfig(lead_x_s=0.05, lead_rotation_s=0.02, lead_until_rad=0.8),
)
PLAIN = {"units": "paper", "schedule": None, "x": AXIS, "rotation": AXIS}


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"schedule": ScheduleConfig(), "fusion": None},
        {"predictor": PredictorConfig(inertia=False), "reference": ReferenceConfig()},
        {**PLAIN, "predictor": None},
        {**PLAIN, "reference": None, "fusion": None},
    ],
    ids=["all", "tangent", "no inertia", "reference and fusion", "predictor"],
)
@FEW
@given(WORLDS, SEEDS)
def test_admittance_with_a_model(changed: dict[str, Any], worlds: Shape, seed: int) -> None:
    config, known = msgspec.structs.replace(MODELLED, **changed), known_sheet()

    def stream(shape: Shape, _: list[int], wrench: Vector, pose: Vector) -> list[tuple[Any, ...]]:
        admittance = ModelAdmittance(
            config,
            known=known,
            response=RESPONSE,
            own=response_model(shape, 2, 2, 5),
            nominal=response_model(shape, 3, 0, 5),
            period_s=T,
            shape=shape,
        )
        rows = zip(wrench, pose, strict=True)
        return [
            (admittance.comply(w, PlanarPose(p)), admittance.saturated, *points(admittance, p))
            for w, p in rows
        ]

    inputs = {"wrench": (3.0, (3,)), "pose": (0.5, (3,))}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


def points(admittance: ModelAdmittance, pose: Vector) -> list[Vector]:
    """Return the controller's matrices at a pose."""
    point = admittance.point(pose[..., 2])
    matrices = [getattr(point, name) for name in point.__struct_fields__]
    return [*matrices, admittance.slope(point)]


@FEW
@given(WORLDS, SEEDS, st.floats(1.1, 8.0))
def test_object_admittance_within_its_dead_bands_seeking_and_relaxing(
    worlds: Shape, seed: int, margin: float
) -> None:
    config = ObjectComplianceConfig(gain_margin=margin, limit_m=1e-4)
    bends = np.array([0.0, 0.4, 1.0])
    mobility = np.array([[2e-3, 1e-3, 0.2], [1e-3, 4e-4, 0.05], [3e-4, 1e-4, 0.01]])

    def stream(
        shape: Shape, _: list[int], wrench: Vector, bend: Vector, seeking: Vector
    ) -> list[tuple[Any, ...]]:
        admittance = ObjectAdmittance(config, bends, mobility, period_s=T, shape=shape)
        found = []
        for w, at, seeks in zip(wrench, bend, seeking, strict=True):
            found.append((admittance.update(w, at, seeks > 0.0),))
        admittance.relax(1e-3)
        return [*found, (admittance.deviation,)]

    inputs = {"wrench": (0.2, (3,)), "bend": (0.6, ()), "seeking": (1.0, ())}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


@FEW
@given(WORLDS, SEEDS)
def test_wrenches_moved_turned_and_summed(worlds: Shape, seed: int) -> None:
    def stream(
        _: Shape, __: list[int], wrench: Vector, lever: Vector, angles: Vector
    ) -> list[tuple[Any, ...]]:
        found = []
        for w, r, a in zip(wrench, lever, angles, strict=True):
            grips = Wrench(w, "grip", "grip")
            found.append(
                (
                    grips.moved(r[..., np.newaxis, :], "middle").components,
                    grips.turned(rotations(a[..., np.newaxis, :]), "bending").components,
                    grips.in_bending_frame(a[..., :2]).components,
                    net_wrench(grips.in_bending_frame(a[..., 1:2]), r[..., 0], a[..., 2]),
                )
            )
        return found

    inputs = {"wrench": (9.0, (2, 6)), "lever": (0.2, (3,)), "angles": (1.0, (3,))}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


# --- both arms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["world", "tool", "tool-frozen"])
@FEW
@given(WORLDS, SEEDS)
def test_path_modification(mode: AlterMode, worlds: Shape, seed: int) -> None:
    def stream(_: Shape, __: list[int], pose: Vector, deviation: Vector) -> list[tuple[Any, ...]]:
        modification = PathModification(mode)
        found = []
        for p, d in zip(pose, deviation, strict=True):
            planar, aside = modification.compose(PlanarPose(p), d)
            found.append((planar.coordinates, aside))
        return found

    inputs = {"pose": (1.0, (2, 3)), "deviation": (0.01, (2, 6))}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


@pytest.mark.parametrize("frame", ["world", "grip", "tool"])
@FEW
@given(WORLDS, SEEDS)
def test_mass_spring_dampers(frame: Frame, worlds: Shape, seed: int) -> None:
    parts = {
        name: DirectionConfig(m=0.1 * i, b=5.0 + i, k=30.0) for i, name in enumerate(DIRECTIONS)
    }
    config = MassSpringDamperConfig(frame=frame, **parts)
    dead: Any = np.zeros

    def stream(shape: Shape, _: list[int], wrench: Vector, pose: Vector) -> list[tuple[Any, ...]]:
        both = SpatialAdmittance(config, period_s=T, sensing=(0, 1), complying=(0, 1), shape=shape)
        found = []
        for w, p in zip(wrench, pose, strict=True):
            observation = Observation(
                time_s=0.0,
                phase="bend",
                raw=Wrench(w, "bending", "grip"),
                filtered=Wrench(w, "bending", "grip"),
                clipped=dead((*shape, 2, 6), dtype=np.bool_),
                fresh=dead((*shape, 2), dtype=np.bool_),
                joints_rad=np.zeros((*shape, 12)),
                measured=PlanarPose(p + 0.01),
                nominal=PlanarPose(p),
            )
            found.append((both(observation), both.saturated))
        return found

    inputs = {"wrench": (5.0, (2, 6)), "pose": (0.5, (2, 3))}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


ARMS = [((0,), (0,)), ((1,), (0, 1)), ((0, 1), (0, 1)), ((0, 1), (1,)), ((0,), ())]


@pytest.mark.parametrize(("sensing", "complying"), ARMS)
@FEW
@given(WORLDS, SEEDS)
def test_from_the_wrists_to_the_commanded_poses(
    sensing: tuple[int, ...], complying: tuple[int, ...], worlds: Shape, seed: int
) -> None:
    count = len(sensing)
    config = AdmittanceConfig(x=AXIS, rotation=AXIS, tare=True, limit_x_m=1e-3)

    def stream(
        shape: Shape, seeds: list[int], wrench: Vector, angles: Vector, pose: Vector
    ) -> list[tuple[Any, ...]]:
        arms = (*shape, count)
        chain = WrenchChain(
            Sensor(ForceTorqueConfig(), noises(seeds, count), arms),
            ToolGravityCompensation([1.3, 0.7][:count], [[0.05, 0.0, 0.01]] * count),
            LowPass(FirConfig(taps=3), period_s=T, shape=arms),
            SKEWED,
        )
        admittance = Admittance(config, period_s=T, shape=arms)
        path = ControlledPath(
            PairCompliance(admittance, sensing=sensing, complying=complying),
            delay_cycles=(2, 2),
            mode="tool",
            shape=shape,
        )
        sensors, turns = WristSensors(chain, sensing), rotations(angles)
        found = []
        for cycle, w in enumerate(wrench):
            observation = Observation.of(
                sensors.read(w, turns[cycle]),
                time_s=cycle * T,
                phase="bend",
                joints_rad=np.zeros((*shape, 12)),
                measured=PlanarPose(pose[cycle] + 0.01),
                nominal=PlanarPose(pose[cycle]),
            )
            command = path.command(observation)
            found.append(
                (
                    observation.raw.components,
                    observation.filtered.components,
                    observation.clipped,
                    command.deviation,
                    command.pose.coordinates,
                    command.saturated,
                )
            )
        return found

    inputs = {"wrench": (20.0, (2, 6)), "angles": (1.0, (2, 3)), "pose": (0.5, (2, 3))}
    assert_worlds_are_single_ones(stream, worlds, seed, inputs)


def test_noise_of_a_world_does_not_depend_on_the_others() -> None:
    """The sources are taken in C order of the leading shape."""
    sensor = Sensor(ForceTorqueConfig(), noises(list(range(6))), (2, 3))
    reading, _ = sensor.read(np.zeros((2, 3, 6)))
    for i, world in enumerate(np.ndindex(2, 3)):
        alone, _ = Sensor(ForceTorqueConfig(), noises([i])[0]).read(np.zeros(6))
        np.testing.assert_array_equal(reading[world], alone)
    assert math.prod(np.unique(reading.reshape(6, 6), axis=0).shape) == 36
