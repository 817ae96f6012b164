"""Each error of a wrist sensor against what it must do by hand calculation."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.filters import IirConfig, LowPass
from dualbend.control.force_torque import (
    ForceTorqueConfig,
    Sensor,
    ToolGravityCompensation,
    WrenchChain,
)
from dualbend.errors import InputError
from dualbend.imperfection.draws import cut_normal, stream
from dualbend.imperfection.sensor import ErringSensor, SensorErrors
from dualbend.run.cell import make_sensors
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from dualbend.types import Side, Vector
from support.strip import STRIP6

IDEAL = ForceTorqueConfig(
    force_noise_n=0.0, torque_noise_nm=0.0, force_resolution_n=0.0, torque_resolution_nm=0.0
)
LOAD = np.array([3.0, -2.0, 7.0, 0.3, -0.4, 0.2])
SHORT = (
    "motion.speed_rad_per_s=1.0",
    "path.end_rad=0.2",
    "motion.settle_s=0.1",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
)


def sensor(
    config: ForceTorqueConfig = IDEAL,
    *arms: tuple[int, Side],
    shape: tuple[int, ...] = (),
    period_s: float = COMMAND_PERIOD_S,
    **errors: Any,
) -> ErringSensor:
    arms = arms or ((1, "left"),)
    noise = [np.random.default_rng(i) for i in range(len(arms))]
    return ErringSensor(config, noise, SensorErrors(**errors), arms, shape, period_s=period_s)


def readings(of: Sensor, count: int, wrench: Vector = LOAD) -> Vector:
    return np.array([of.read(wrench)[0] for _ in range(count)])


def simulated(*settings: str) -> RunRecord:
    keys = [f"imperfections.sensor.{setting}" for setting in settings]
    return BendingRun(load_scenario(STRIP6, [*SHORT, *keys])).run()


# --- drift --------------------------------------------------------------------------------------


def test_a_drift_grows_linearly_since_the_zero() -> None:
    """Analytic: 7.2 N/h and 0.36 N m/h are 2 mN and 0.1 mN m a second, from 100 s before."""
    drifting = sensor(
        period_s=0.5, force_drift_n_per_h=7.2, torque_drift_nm_per_h=0.36, zeroed_before_s=100.0
    )
    seconds = 100.0 + 0.5 * np.arange(70)
    expected = np.outer(seconds, np.repeat([2e-3, 1e-4], 3))
    assert np.allclose(readings(drifting, 70) - LOAD, expected, rtol=0, atol=1e-12)


def test_a_drifts_spread_is_of_each_axis_and_arm_and_stays() -> None:
    """Statistical: 400 arms, 5 % of a standard deviation is 3.5 standard errors of its estimate."""
    found = []
    for seed in range(200):
        for side in ("left", "right"):
            one = sensor(
                IDEAL,
                (seed, side),
                period_s=3600.0,
                force_drift_spread_n_per_h=2.0,
                torque_drift_spread_nm_per_h=0.1,
            )
            told = readings(one, 3) - LOAD
            assert np.allclose(told[2], 2.0 * told[1], atol=1e-9)
            found.append(told[1])
    assert np.std(np.array(found)[:, :3]) == pytest.approx(2.0, rel=0.08)
    assert np.std(np.array(found)[:, 3:]) == pytest.approx(0.1, rel=0.08)
    assert abs(np.corrcoef(np.array(found).T) - np.eye(6)).max() < 0.25  # axes are independent


def test_a_random_walk_grows_with_the_root_of_time() -> None:
    """Statistical: 150 seeds × 3 axes: 10 % is three standard errors; 1 h before and 3 h after."""
    walked = []
    for seed in range(150):
        one = sensor(
            IDEAL,
            (seed, "left"),
            period_s=360.0,
            force_walk_n=1.5,
            torque_walk_nm=0.2,
            zeroed_before_s=3600.0,
        )
        walked.append(readings(one, 31)[[0, 30]] - LOAD)
    start, end = np.swapaxes(walked, 0, 1)
    for errors, hours in ((start, 1.0), (end, 4.0)):
        assert np.std(errors[:, :3]) == pytest.approx(1.5 * math.sqrt(hours), rel=0.1)
        assert np.std(errors[:, 3:]) == pytest.approx(0.2 * math.sqrt(hours), rel=0.1)
    # It is a walk and no new draw each cycle: what was there stays.
    assert np.std((end - start)[:, :3]) == pytest.approx(1.5 * math.sqrt(3.0), rel=0.1)


# --- scale and cross-talk -----------------------------------------------------------------------


def matrix(of: ErringSensor) -> Vector:
    """Return the reading per unit of load, measured axis by axis."""
    return np.stack([of.read(unit)[0] for unit in np.eye(6)], axis=1)


def test_a_scale_multiplies_every_reading() -> None:
    assert np.allclose(sensor(scale_ratio=1.02).read(LOAD)[0], 1.02 * LOAD, rtol=1e-14)


def test_a_sensor_is_linear_in_its_load() -> None:
    """Exact: superposition of the loads of single axes."""
    wrong = sensor(scale_spread=0.02, cross_talk_spread=0.02)
    assert np.allclose(wrong.read(LOAD)[0], matrix(wrong) @ LOAD, rtol=1e-12)
    again = sensor(scale_spread=0.02, cross_talk_spread=0.02)
    assert np.array_equal(matrix(again), matrix(wrong))


def test_cross_talk_is_a_part_of_full_scale_per_full_scale() -> None:
    """Statistical: 300 sensors; 6 % is more than three standard errors of each spread.

    With 65 N and 5 N m of full scale a force of 65 N reads 1 % of 5 N m as a torque.
    """
    config = msgspec.structs.replace(IDEAL, force_range_n=65.0, torque_range_nm=5.0)
    full = np.repeat([65.0, 5.0], 3)
    drawn = []
    for seed in range(300):
        one = sensor(config, (seed, "right"), scale_spread=0.004, cross_talk_spread=0.01)
        drawn.append(matrix(one) * full / full[:, np.newaxis])
    relative = np.array(drawn) - np.eye(6)
    on, off = np.eye(6, dtype=bool), ~np.eye(6, dtype=bool)
    assert np.std(relative[:, on]) == pytest.approx(0.004, rel=0.06)
    assert np.std(relative[:, off]) == pytest.approx(0.01, rel=0.06)
    for block in (np.s_[:, :3, 3:], np.s_[:, 3:, :3]):  # forces by torques, torques by forces
        assert np.std(relative[block]) == pytest.approx(0.01, rel=0.06)
    assert np.abs(relative[:, off]).max() <= 0.03 + 1e-12  # cut at three


def test_an_error_before_the_range_is_clipped_with_the_load() -> None:
    reading, clipped = sensor(scale_ratio=2.0).read(np.array([40.0, 0, 0, 0, 0, 0]))
    assert reading[0] == 65.0 and clipped[0]


# --- the tool -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rotation", "up"),
    [
        (np.eye(3), [0.0, 0.0, 1.0]),
        # Sensor x points up, z to where x was.
        (np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), [1.0, 0.0, 0.0]),
    ],
)
def test_a_tool_that_is_believed_too_heavy_leaves_a_force_upwards(
    rotation: Vector, up: list[float]
) -> None:
    """Analytic: Δm g upwards, and its moment about the sensor, of a tool held still."""
    mass, centre = 1.2, np.array([0.05, 0.0, 0.02])
    errors = SensorErrors(tool_mass_ratio=1.1, tool_centre_error_m=(0.004, 0.0, 0.0))
    believed = errors.believed_tool(1, "left", mass, centre)
    assert believed[0] == pytest.approx(1.32) and believed[1] == pytest.approx([0.054, 0.0, 0.02])
    true = ToolGravityCompensation(mass, centre).wrench(rotation)
    chain = WrenchChain(
        Sensor(msgspec.structs.replace(IDEAL, lever_arm_m=0.0), np.random.default_rng(0)),
        ToolGravityCompensation(*believed),
        LowPass(IirConfig(), period_s=COMMAND_PERIOD_S),
        np.eye(3),
    )
    left = chain.update(true, rotation).raw
    assert left.force_n == pytest.approx(0.12 * 9.81 * np.array(up), abs=1e-12)
    weights = np.cross(centre, -1.2 * 9.81 * np.array(up)) - np.cross(
        believed[1], -1.32 * 9.81 * np.array(up)
    )
    assert left.torque_nm == pytest.approx(weights, abs=1e-12)


def test_a_tools_spreads_are_of_each_arm() -> None:
    """Statistical: 300 arms; the spread within 12 %, three standard errors."""
    errors = SensorErrors(tool_mass_spread=0.05, tool_centre_spread_m=0.002)
    tools = [errors.believed_tool(seed, "left", 2.0, np.zeros(3)) for seed in range(300)]
    assert np.std([mass for mass, _ in tools]) == pytest.approx(0.1, rel=0.12)
    assert np.std([centre for _, centre in tools]) == pytest.approx(0.002, rel=0.08)
    assert errors.believed_tool(1, "right", 2.0, np.zeros(3))[0] != tools[1][0]


# --- what does not arrive -----------------------------------------------------------------------


def ramp(of: ErringSensor, count: int) -> tuple[Vector, Vector]:
    """Return which of the readings 0, 1, 2, ... N is told in each cycle, and which arrived."""
    told, arrived = [], []
    for n in range(count):
        told.append(of.read(np.full(6, 0.001 * n))[0][0] * 1e3)
        arrived.append(bool(of.arrived))
    return np.rint(told), np.array(arrived)


def test_a_drop_out_tells_the_last_reading_for_its_length() -> None:
    """Exact: each gap is three cycles, or several of them; the value before it stands in it."""
    told, arrived = ramp(sensor(dropout_probability=0.1, dropout_cycles=3), 500)
    expected = np.maximum.accumulate(np.where(arrived, np.arange(500), 0))
    assert np.array_equal(told, expected) and arrived[0]
    edges = np.flatnonzero(np.diff(arrived.astype(int)))
    gaps = np.diff(edges)[0::2]
    assert set(gaps % 3) == {0} and gaps.size > 20
    # Statistical: p L/(p L + 1 − p) = 0.25 of the cycles, three standard errors.
    assert np.mean(~arrived) == pytest.approx(0.25, abs=0.08)


def test_a_stuck_sensor_sends_one_reading_from_and_for_a_time() -> None:
    """Exact: from 1.4 s for 0.14 s is cycles 50 to 54; the other arm's goes on."""
    errors = {"stuck": ("left",), "stuck_from_s": 1.4, "stuck_for_s": 0.14}
    told, arrived = ramp(sensor(**errors), 70)
    expected = np.arange(70)
    expected[50:55] = 49
    assert np.array_equal(told, expected)
    assert arrived.all()  # a record came: only its content tells
    told, _ = ramp(sensor(IDEAL, (1, "right"), **errors), 70)
    assert np.array_equal(told, np.arange(70))
    # From the start it is the first reading that stands.
    assert set(ramp(sensor(stuck=("left",)), 9)[0]) == {0.0}


def test_what_is_clipped_is_told_with_the_reading_that_it_is_of() -> None:
    one = sensor(stuck=("left",), stuck_from_s=COMMAND_PERIOD_S)
    over = np.array([99.0, 0, 0, 0, 0, 0])
    assert one.read(over)[1][0] and one.read(np.zeros(6))[1][0]


def chain_of(one: Sensor) -> WrenchChain:
    low_pass = LowPass(IirConfig(), period_s=COMMAND_PERIOD_S)
    return WrenchChain(one, ToolGravityCompensation(1.0, np.zeros(3)), low_pass, np.eye(3))


def test_a_reading_is_fresh_that_arrived_and_is_another_one() -> None:
    """Exact: only a sensor with noise is known to be stuck by its equal readings."""
    stuck = {"stuck": ("left",), "stuck_from_s": 4 * COMMAND_PERIOD_S}
    for config, expected in ((ForceTorqueConfig(), [True] * 4 + [False] * 6), (IDEAL, [True] * 10)):
        chain = chain_of(sensor(config, **stuck))
        assert [bool(chain.update(LOAD, np.eye(3)).fresh) for _ in range(10)] == expected
    for config in (ForceTorqueConfig(), IDEAL):  # a record that does not come is always known
        chain = chain_of(sensor(config, dropout_probability=1.0, dropout_cycles=9))
        found = [bool(chain.update(LOAD, np.eye(3)).fresh) for _ in range(9)]
        assert found == [True] + [False] * 8


@pytest.mark.parametrize(
    ("noise", "expected"),
    [
        ({}, False),
        ({"force_noise_n": 0.04}, False),
        ({"torque_noise_nm": 0.002}, False),
        ({"force_noise_n": 0.04, "torque_noise_nm": 0.002}, True),
    ],
)
def test_noise_of_a_count_on_either_kind_of_axis_is_enough(
    noise: dict[str, float], expected: bool
) -> None:
    assert ForceTorqueConfig(**noise).may_repeat is expected
    assert IDEAL.may_repeat


# --- spikes -------------------------------------------------------------------------------------


def test_a_spike_is_of_one_axis_one_cycle_and_either_sign() -> None:
    """Exact sizes; statistical: 600 of 3000 cycles within four standard errors."""
    spikes = sensor(spike_probability=0.2, spike_force_n=10.0, spike_torque_nm=0.5)
    errors = readings(spikes, 3000) - LOAD
    hit = np.abs(errors) > 1e-9
    assert hit.sum(axis=1).max() == 1
    assert hit.any(axis=1).sum() == pytest.approx(600, abs=88)
    assert np.allclose(np.abs(errors[:, :3][hit[:, :3]]), 10.0)
    assert np.allclose(np.abs(errors[:, 3:][hit[:, 3:]]), 0.5)
    assert hit.sum(axis=0).min() > 60  # of every axis: 100 each, four standard errors
    assert 0.42 < np.mean(errors[hit] > 0.0) < 0.58


# --- all of them --------------------------------------------------------------------------------

ALL: dict[str, Any] = {
    "force_drift_spread_n_per_h": 50.0,
    "torque_walk_nm": 1.0,
    "zeroed_before_s": 600.0,
    "scale_spread": 0.01,
    "cross_talk_spread": 0.01,
    "dropout_probability": 0.2,
    "spike_probability": 0.2,
    "spike_force_n": 5.0,
    "spike_torque_nm": 0.1,
}


def test_many_sensors_are_single_ones() -> None:
    """Exact: of any leading shape, each with its own seed and side, to the last bit."""
    arms: list[tuple[int, Side]] = [
        (seed, side) for seed in (3, 4, 5) for side in ("left", "right")
    ]
    config = ForceTorqueConfig()
    many = sensor(config, *arms, shape=(3, 2), **ALL)
    loads = np.random.default_rng(0).normal(size=(20, 3, 2, 6)) * 5.0
    told, clipped, arrived = zip(*((*many.read(load), many.arrived) for load in loads), strict=True)
    for i, arm in enumerate(arms):
        noise = np.random.default_rng(i)
        one = ErringSensor(config, noise, SensorErrors(**ALL), [arm], period_s=COMMAND_PERIOD_S)
        at = np.unravel_index(i, (3, 2))
        for n, load in enumerate(loads):
            reading, clip = one.read(load[at])
            assert np.array_equal(reading, told[n][at])
            assert np.array_equal(clip, clipped[n][at]) and one.arrived == arrived[n][at]


@pytest.mark.parametrize("off", sorted(ALL))
def test_no_error_moves_the_draws_of_another(off: str) -> None:
    """Exact: with the others as they are, what one adds is its own. Forces and torques apart."""
    few = {key: 0.0 if key == off else value for key, value in ALL.items()}
    few.pop("zeroed_before_s")
    rest = few | {"dropout_probability": 0.0, "spike_probability": 0.0}
    alone = readings(sensor(**rest), 50)
    spiked = readings(sensor(**few | {"dropout_probability": 0.0}), 50)
    differs = np.abs(spiked - alone) > 1e-9
    assert differs.sum(axis=1).max() <= 1  # but for spikes on one axis it is the same


def test_without_errors_a_sensor_is_the_one_without_this_module() -> None:
    """Exact: to the last bit, noise and rounding included."""
    config = ForceTorqueConfig()
    plain = Sensor(config, np.random.default_rng(0))
    assert np.array_equal(readings(sensor(config), 50), readings(plain, 50))
    scenario = load_scenario(STRIP6, SHORT)
    model = BendingRun(scenario).cell.simulation.model
    plain_chain = make_sensors(scenario, model).chain
    assert type(plain_chain.sensor) is Sensor
    # What is believed of the tool gets to the compensation, and what is fresh to the controller.
    errors = ("tool_mass_ratio=1.1", "dropout_probability=1", "dropout_cycles=9")
    keys = [f"imperfections.sensor.{error}" for error in errors]
    both = 'compliance.sensing=["left","right"]'
    wrong = make_sensors(load_scenario(STRIP6, [*SHORT, *keys, both]), model)
    up = np.stack([np.eye(3)] * 2)
    weight = wrong.chain.tool.wrench(up)[:1]
    assert np.allclose(weight, 1.1 * plain_chain.tool.wrench(up[:1]), rtol=1e-12)
    found = [wrong.read(np.zeros((2, 6)), up).fresh.tolist() for _ in range(2)]
    assert found == [[True, True], [False, False]]


def test_another_sheet_of_a_series_has_the_same_sensor_and_its_own_walk() -> None:
    def read(repeat: int, **errors: float) -> Vector:
        noise = [np.random.default_rng(0)]
        arms: list[tuple[int, Side]] = [(3, "left")]
        found = ErringSensor(
            IDEAL, noise, SensorErrors(**errors), arms, (), period_s=COMMAND_PERIOD_S, repeat=repeat
        )
        return readings(found, 50)

    fixed = {"scale_spread": 0.05, "cross_talk_spread": 0.05, "torque_drift_spread_nm_per_h": 9.0}
    assert np.array_equal(read(1, **fixed), read(2, **fixed))
    assert not np.array_equal(read(1, torque_walk_nm=1.0), read(2, torque_walk_nm=1.0))
    assert np.array_equal(read(2, torque_walk_nm=1.0), read(2, torque_walk_nm=1.0))


def test_a_cut_normal_is_cut_at_three() -> None:
    """Statistical: 0.27 % of 20000 are beyond, four standard errors; the standard deviation."""
    drawn = cut_normal(stream(1, "a"), 2.0, (20000,))
    assert np.mean(np.abs(drawn) == 6.0) == pytest.approx(0.0027, abs=0.0015)
    assert np.abs(drawn).max() == 6.0
    assert np.std(drawn) == pytest.approx(2.0 * 0.9933, rel=0.02)


# --- in a run -----------------------------------------------------------------------------------


def test_a_stuck_sensor_stops_the_arms() -> None:
    """Exact: stuck from cycle 4 on, the fifth repetition is seen in cycle 8, at 0.224 s."""
    run = simulated('stuck=["left"]', f"stuck_from_s={4 * COMMAND_PERIOD_S}")
    assert run.outcome == "protective_stop"
    assert run.reason == "the left sensor has told nothing new for 5 cycles, at 0.224 s"


def test_a_run_with_all_errors_is_the_same_again() -> None:
    settings = [f"{key}={value}" for key, value in ALL.items()]
    first, second = simulated(*settings), simulated(*settings)
    assert first.trace.rows > 5
    columns = [name for name, _ in first.trace.columns if name != "wall_s"]
    for name in columns:
        assert np.array_equal(first.trace[name], second.trace[name], equal_nan=True)
    assert not np.array_equal(
        first.trace["left_sensor_force_x"], simulated().trace["left_sensor_force_x"]
    )


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("dropout_probability=1.5", "imperfections.sensor.dropout_probability"),
        ("stuck_for_s=-1", "imperfections.sensor.stuck_for_s"),
        ("tool_centre_error_m=[0,0,2]", "imperfections.sensor.tool_centre_error_m"),
        ("scale_ratio=0", "imperfections.sensor.scale_ratio"),
    ],
)
def test_what_cannot_be_is_refused_with_its_key(setting: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scenario(STRIP6, [f"imperfections.sensor.{setting}"])
