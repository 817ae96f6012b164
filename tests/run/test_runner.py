"""The loop: repeatable, symmetric, balanced, stopped for a reason, and honest about time."""

import pickle
import warnings
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

from dualbend.arm.model import scene_joints
from dualbend.arm.pair import paper_pair
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.guard import Guard, GuardConfig, ProtectiveStop, SensorGuard
from dualbend.errors import InputError
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.planar import refuse_snapped
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS, Trace
from dualbend.scenario.load import load_scenario
from dualbend.scenario.motion import PHASES
from dualbend.scene.ik import TOLERANCE_M, TOLERANCE_RAD
from dualbend.scene.sheet.strips import strip_body
from dualbend.scene.warnings import SimulationFailed, refuse_warnings
from dualbend.task.bending.run import BendingRun
from support.strip import STRIP6

Array = NDArray[np.float64]
SHORT = (
    "motion.speed_rad_per_s=1.0",
    "path.end_rad=0.2",
    "motion.settle_s=0.1",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
)
QUIET = (
    "sensor.force_noise_n=0",
    "sensor.torque_noise_nm=0",
    "sensor.force_resolution_n=0",
    "sensor.torque_resolution_nm=0",
)
BOTH = ('compliance.sensing=["left","right"]', 'compliance.complying=["left","right"]')
ROTARY = ("compliance.rotation={b=0.5,k=10000,from_alpha_rad=0.05}",)


def prepare(*settings: str, seed: int | None = None) -> BendingRun:
    return BendingRun(load_scenario(STRIP6, [*SHORT, *settings], seed=seed))


@cache
def run(*settings: str, seed: int | None = None) -> RunRecord:
    return prepare(*settings, seed=seed).run()


def table(trace: Trace) -> Array:
    """Return every column but the clock on the wall."""
    names = [name for name, _ in trace.columns if name not in WALL_CLOCK_COLUMNS]
    return np.array([trace[name] for name in names])


# --- repeatable ---------------------------------------------------------------------------------


def test_a_run_is_the_same_bit_for_bit() -> None:
    first, second = run(*ROTARY), prepare(*ROTARY).run()
    assert first.outcome == "completed"
    np.testing.assert_array_equal(table(first.trace), table(second.trace))
    np.testing.assert_array_equal(first.trace.qpos, second.trace.qpos)


def test_a_second_run_of_the_same_object_is_the_same_run() -> None:
    """Nothing of the first run may be left in filters, delays, admittances or noise streams."""
    again = prepare(*ROTARY)
    first = again.run()
    np.testing.assert_array_equal(table(first.trace), table(again.run().trace))


def test_another_seed_is_another_trace() -> None:
    first, other = run(*ROTARY, seed=1), run(*ROTARY, seed=2)
    assert (first.trace["left_sensor_force_x"] != other.trace["left_sensor_force_x"]).any()
    assert (first.trace["left_q_joint2"] != other.trace["left_q_joint2"]).any()


def test_without_noise_the_seed_does_nothing() -> None:
    first, other = (run(*ROTARY, *QUIET, seed=seed) for seed in (1, 2))
    np.testing.assert_array_equal(table(first.trace), table(other.trace))


def test_a_second_sensor_does_not_change_the_first_ones_noise() -> None:
    one = run("compliance.complying=[]")
    two = run("compliance.complying=[]", BOTH[0])
    np.testing.assert_array_equal(
        one.trace["left_sensor_force_x"], two.trace["left_sensor_force_x"]
    )
    noise = two.trace["left_sensor_force_y"] - two.trace["right_sensor_force_y"]
    assert np.abs(noise).max() > 0.0


# --- the clock ----------------------------------------------------------------------------------


def test_rows_stand_at_the_starts_of_cycles() -> None:
    result = run()
    trace = result.trace
    np.testing.assert_allclose(trace["time"], COMMAND_PERIOD_S * np.arange(trace.rows), atol=1e-15)
    # ceil(0.1 / 0.028), ceil(0.2 / 0.028), ceil(0.1 / 0.028) + 1.
    assert [int((trace["phase"] == i).sum()) for i in range(len(PHASES))] == [4, 8, 5, 0, 0]
    assert trace["nominal_alpha"][3] == 0.0
    assert trace["nominal_alpha"][4] == 0.0  # the first cycle of bending starts at the start
    assert trace["nominal_alpha"][5] == pytest.approx(0.028)
    assert trace["nominal_alpha"][-1] == 0.2
    assert result.simulated_s == pytest.approx(17 * COMMAND_PERIOD_S)


def test_the_simulated_time_is_the_physics_own() -> None:
    for settings in ((), ("guard.following_error_rad=1e-5",)):
        prepared = prepare(*settings)
        result = prepared.run()
        assert result.simulated_s == pytest.approx(prepared.cell.simulation.data.time, abs=1e-9)


def test_a_sample_of_a_whole_cycle_is_the_one_of_the_row_before() -> None:
    """17 steps against 1: 28 ms apart, the same samples one row later, bit for bit."""
    quiet = (*QUIET, "compliance.complying=[]")
    prompt = run(*quiet, "sensor.latency_ms=1.75").trace
    late = run(*quiet, "sensor.latency_ms=29.75").trace
    for column in ("left_sensor_force_x", "left_sensor_moment_y"):
        np.testing.assert_array_equal(late[column][1:], prompt[column][:-1])


@pytest.mark.parametrize("delay", [0, 2])
def test_a_deviation_is_executed_after_the_transport_delay(delay: int) -> None:
    trace = run(*ROTARY, f"robot.alter.delay_cycles={delay}").trace
    executed = trace["left_command_alpha"] - trace["nominal_alpha"]
    sent = trace["left_deviation_alpha"]
    assert np.abs(sent).max() > 1e-6
    np.testing.assert_allclose(executed[delay:], sent[: sent.size - delay], atol=1e-15)
    np.testing.assert_array_equal(executed[:delay], 0.0)


@pytest.mark.parametrize(
    "setting", ["motion.settle_s=0", "motion.hold_s=0", "motion.speed_rad_per_s=1.5", "seed=3"]
)
def test_the_shortest_motions_run_without_a_numerical_warning(setting: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert prepare(setting).run().outcome == "completed"


def test_a_motion_shorter_than_a_cycle_bends_for_one() -> None:
    result = prepare("path.end_rad=1e-12", "motion.speed_rad_per_s=1").run()
    assert result.outcome == "completed"
    assert int((result.trace["phase"] == PHASES.index("bend")).sum()) == 1
    assert result.trace["nominal_alpha"][-1] == 1e-12


# --- symmetric and balanced ---------------------------------------------------------------------


@pytest.mark.parametrize("compliance", [(), ROTARY], ids=["stiff", "compliant"])
def test_a_symmetric_experiment_stays_symmetric(compliance: tuple[str, ...]) -> None:
    trace = run(*QUIET, *BOTH, *compliance).trace
    names = [name for name, _ in trace.columns if name.startswith("left_")]
    assert len(names) > 40
    for name in names:
        left, right = trace[name], trace[name.replace("left_", "right_", 1)]
        # Analytic: the cell is its own image; rounding, which the stiff sheet magnifies.
        np.testing.assert_allclose(left, right, rtol=0.0, atol=1e-8, err_msg=name)


HOLDING = (*QUIET, "motion.hold_s=1.0", "motion.speed_rad_per_s=0.5", "path.end_rad=0.4")


def test_the_arms_carry_the_weight_of_the_sheet() -> None:
    result = run(*HOLDING)
    sheet = result.scenario.sheet.sheet()
    weight = sheet.mass_kg * 9.81
    trace = result.trace
    carried = -(trace["left_true_force_z"] + trace["right_true_force_z"])
    # Statics after a hold of 1 s; the rest of the motion is 1e-3 of the weight.
    assert carried[-1] == pytest.approx(weight, rel=5e-3)
    # Nothing pushes sideways: the horizontal forces are a pair, equal in the arms' own frames.
    assert trace["left_true_force_x"][-1] == pytest.approx(trace["right_true_force_x"][-1])
    assert trace["left_true_force_x"][-1] < 0.0  # a bent sheet pushes the grippers outward


def test_what_is_measured_is_what_is_true_at_rest() -> None:
    trace = run(*HOLDING).trace
    for measured, true, unit in (("force_x", "force_x", 2e-2), ("moment_y", "moment_y", 5e-4)):
        for kind in ("measured", "filtered"):
            # The rest of the motion between a sample and its row; forces are 2 N, moments 0.01 N m.
            difference = trace[f"left_{kind}_{measured}"][-1] - trace[f"left_true_{true}"][-1]
            assert abs(difference) < unit


def energy(result: RunRecord, row: int) -> float:
    """Return the strain energy and height energy of the sheet [J]."""
    model = result.model
    data = mujoco.MjData(model)
    data.qpos[:] = result.trace.qpos[row]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    hinges = result.scenario.sheet.strips.hinges
    root = model.body(strip_body(hinges // 2)).id
    height = data.subtree_com[root, 2] * model.body_subtreemass[root] * 9.81
    strain = 0.5 * float(result.bend_stiffness @ result.trace.bends[row] ** 2)
    return strain + float(height)


def test_the_work_of_the_arms_is_the_energy_of_the_sheet() -> None:
    """−∫ (F·dx + M dα) over both edges = Δ(strain + height), F and M on the arms."""
    settings = (*QUIET, "motion.speed_rad_per_s=0.3", "path.end_rad=0.5", "path.start_rad=0.2")
    result = run(*settings, "path.interval_rad=0.05", "motion.settle_s=0.8", "motion.hold_s=0.8")
    trace = result.trace
    start = int((trace["phase"] == 0).sum()) - 1
    work = 0.0
    for side in ("left", "right"):
        for load, place in (("force_x", "x"), ("force_z", "z"), ("moment_y", "alpha")):
            on_sheet = -trace[f"{side}_true_{load}"][start:]
            work += float(np.trapezoid(on_sheet, trace[f"{side}_edge_{place}"][start:]))
    gained = energy(result, trace.rows - 1) - energy(result, start)
    assert gained > 0.01  # J
    # Discretisation-limited: rows of 28 ms; hinge damping takes some too.
    assert work == pytest.approx(gained, rel=0.03)
    assert work > gained - 1e-3


def test_the_grips_arrive_at_the_nominal_pose() -> None:
    trace = run(*HOLDING).trace
    assert trace["left_grip_alpha"][-1] == pytest.approx(0.4, abs=5e-4)
    error = trace["left_grip_x"][-1] + trace["nominal_half_distance"][-1]
    # What the arm gives way under 2 N and 0.4 N m at joint 5: 0.2 mrad, 0.1 mm.
    assert abs(error) < 2e-4
    assert trace["sag"][-1] == pytest.approx(
        trace["nominal_z"][-1] - load_scenario(STRIP6).cell.sheet_height_m, rel=0.02
    )


def test_the_edge_is_not_the_grip() -> None:
    """Two columns, not one: the pads give way outward under a push outward."""
    trace = run(*HOLDING).trace
    deflection = trace["left_edge_x"][-1] - trace["left_grip_x"][-1]
    assert trace["left_true_force_x"][-1] < 0.0
    assert -1e-5 < deflection < -1e-7


def test_the_ik_is_converged_in_every_cycle() -> None:
    trace = run().trace
    assert trace["ik_position"].max() <= TOLERANCE_M
    assert trace["ik_rotation"].max() <= TOLERANCE_RAD
    assert trace["ik_iterations"].max() <= 4


def test_compliance_gives_way_along_the_force() -> None:
    soft = (*HOLDING, "compliance.x={b=20,k=100,form=static}".replace("static", '"static"'))
    stiff, compliant = run(*HOLDING).trace, run(*soft).trace
    assert compliant["left_deviation_x"][-1] < 0.0  # outward, as the force
    # The static law, in the paper's units: δ [mm] = F [N] / k [N/mm].
    expected = compliant["left_filtered_force_x"][-1] / 100e3
    assert compliant["left_deviation_x"][-1] == pytest.approx(expected, rel=0.05)
    assert abs(compliant["left_true_force_x"][-1]) < abs(stiff["left_true_force_x"][-1])


# --- stops --------------------------------------------------------------------------------------


def test_a_following_error_stops_the_robots() -> None:
    result = run("guard.following_error_rad=1e-5")
    assert result.outcome == "protective_stop"
    assert not result.expected
    assert "following error of" in result.reason
    assert any(label in result.reason for label in JOINT_LABELS)
    assert "1e-05" in result.reason
    trace, last = result.trace, int(np.argmax(result.stopped)) - 1
    assert 0 < last < 16
    # The row of the stop is there: seen, but not acted upon, as are those after it.
    assert np.isfinite(trace["left_grip_x"]).all()
    assert np.isnan(trace["left_command_x"][last:]).all()
    assert np.isfinite(trace["left_command_x"][:last]).all()
    assert f"at {trace['time'][last]:.3f} s" in result.reason


def test_a_stop_that_is_expected_is_expected() -> None:
    assert run("guard.following_error_rad=1e-5", 'expect.outcome=["protective_stop"]').expected


def test_a_path_that_is_too_fast_is_refused_before_the_run() -> None:
    with pytest.raises(InputError, match=r"motion\.speed_rad_per_s = 1.*_joint.*at most") as caught:
        prepare("guard.speed_fraction=0.05")
    assert "0.08" in str(caught.value)  # 5 % of 1.51 rad/s


def test_an_unreachable_cell_is_refused_before_the_run() -> None:
    for setting in ("cell.base_distance_m=2.5", "cell.sheet_height_m=2.9", "cell.base_lateral_m=1"):
        with pytest.raises(
            InputError, match=r"'strip-fig6'.*out of reach.*at the limit of"
        ) as caught:
            prepare(setting)
        assert setting.split("=")[0] in str(caught.value)


def test_a_deviation_out_of_reach_stops_the_robots() -> None:
    soft = ("compliance.x={b=0.001,k=0.001}", "compliance.limit_x_m=1", *QUIET)
    result = run(*soft, "robot.alter.delay_cycles=0")
    assert result.outcome == "protective_stop"
    assert "out of reach" in result.reason


def test_a_state_that_is_no_number_fails_the_run_and_keeps_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    prepared = prepare()

    def break_it(cycles: int) -> None:
        if cycles == 5:
            prepared.cell.simulation.data.qvel[0] = np.nan

    result = prepared.run(break_it)
    assert result.outcome == "failed"
    assert "BADQVEL" in result.reason
    assert "at 0.140 s" in result.reason  # found at the start of the sixth cycle
    assert not list(tmp_path.iterdir())  # MuJoCo leaves no log file behind
    trace = result.trace
    assert trace.rows == 5
    np.testing.assert_array_equal(table(trace), table(run().trace)[:, :5])


def test_every_cycle_is_reported() -> None:
    seen: list[int] = []
    prepare().run(seen.append)
    assert seen == list(range(1, 18))


JOINT_LABELS = tuple(f"{side}_{name}" for side in ("left", "right") for name in scene_joints(6))
SPEED_LIMIT = paper_pair().speed_limit
RANGE = np.tile([-2.0, 2.0], (12, 1))
LIMIT = np.full(12, 50.0)
STILL = np.zeros(12)


def guard(**settings: float) -> Guard:
    return Guard(GuardConfig(**settings), JOINT_LABELS, RANGE, LIMIT, SPEED_LIMIT)


def at(index: int, value: float) -> Array:
    values = np.zeros(12)
    values[index] = value
    return values


def test_the_guard_lets_a_good_cycle_pass() -> None:
    guard().check(at(3, 1.99), at(2, 2.39), at(0, 49.9), at(3, 1.98))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("index", [0, 5, 7, 11])
def test_the_guard_names_the_joint_and_both_numbers(index: int, sign: float) -> None:
    label = JOINT_LABELS[index]
    with pytest.raises(ProtectiveStop, match=rf"following error of {label} is 0\.03 rad.*0\.02"):
        guard().check(at(index, 0.03 * sign), STILL, STILL, STILL)
    limit = SPEED_LIMIT[index]
    with pytest.raises(ProtectiveStop, match=rf"speed of {label} is .* rad/s, above {limit:.4g}"):
        guard().check(STILL, at(index, 1.01 * limit * sign), STILL, STILL)
    with pytest.raises(ProtectiveStop, match=rf"{label} is at its range's end, -?114\.6 degrees"):
        guard().check(at(index, 2.0 * sign), STILL, STILL, at(index, 2.0 * sign))


def test_the_guard_scales_the_speeds_by_the_fraction() -> None:
    guard(speed_fraction=0.5).check(STILL, at(1, 0.75), STILL, STILL)
    with pytest.raises(ProtectiveStop, match=r"above 0\.755"):
        guard(speed_fraction=0.5).check(STILL, at(1, 0.76), STILL, STILL)


def test_the_torque_limit_stops_after_cycles_in_a_row() -> None:
    checked = guard(torque_cycles=3)
    for torque in (-50.0, -50.0, 10.0, 50.0, 50.0):
        checked.check(STILL, STILL, at(8, torque), STILL)
    with pytest.raises(ProtectiveStop, match=r"right_joint3 is at its torque limit of 50.0 N m"):
        checked.check(STILL, STILL, at(8, 50.0), STILL)


def test_a_sensor_at_the_end_of_its_range_stops_after_cycles_in_a_row() -> None:
    clipped, free = np.zeros((2, 6), dtype=bool), np.zeros((2, 6), dtype=bool)
    clipped[1, [0, 4]] = True
    checked = SensorGuard(GuardConfig(sensor_cycles=3), ["left", "right"])
    fresh = np.ones(2, dtype=bool)
    for mask in (clipped, clipped, free, clipped, clipped):
        checked.check(mask, fresh)
    with pytest.raises(ProtectiveStop, match=r"right sensor .* \(force x, moment y\) for 3 cycles"):
        checked.check(clipped, fresh)
    # Cycles in a row of one sensor, whichever of its axes: two sensors in turn are neither's.
    turns = SensorGuard(GuardConfig(sensor_cycles=2), ["left", "right"])
    for mask in (clipped, clipped[::-1], clipped):
        turns.check(mask, fresh)
    other = np.roll(clipped, 1, axis=1)
    with pytest.raises(ProtectiveStop, match=r"\(force y, moment z\) for 2 cycles"):
        turns.check(other, fresh)


@pytest.mark.parametrize(("cycles", "stops"), [("17", True), ("18", False)])
def test_a_run_ends_where_its_sensor_is_saturated_for_as_long_as_is_allowed(
    cycles: str, stops: bool
) -> None:
    """Exact: the tool weighs more than a range of 2 N, so all 17 cycles of the run are clipped."""
    result = run("sensor.force_range_n=2", f"guard.sensor_cycles={cycles}")
    assert result.outcome == ("protective_stop" if stops else "completed")
    if stops:
        assert result.reason.startswith("the left sensor is at the end of its range (force")
        assert "for 17 cycles, at 0.448 s" in result.reason
        # The record says the same: the reading that ended the run is in it.
        assert "in 17 of 17 cycles, at most 17 in a row" in result.summary.warnings[0]


def test_the_worst_joint_is_the_one_that_is_named() -> None:
    with pytest.raises(ProtectiveStop, match="left_joint5"):
        guard().check(at(4, -0.2) + at(1, 0.1), STILL, STILL, STILL)


def test_the_labels_are_the_joints_of_left_and_right() -> None:
    assert prepare().cell.simulation.joints == JOINT_LABELS


def test_a_record_of_a_run_in_memory_goes_through_a_pickle() -> None:
    """A pool of processes returns it; its model is compiled there, without the run's state."""
    result = run()
    found = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(found["left_true_moment_y"], result["left_true_moment_y"])
    assert found.model.nq == prepare().cell.compiled.nq


def test_any_warning_counter_fails_the_run() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    data = mujoco.MjData(model)
    refuse_warnings(data.warning.number)
    data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number = 2
    with pytest.raises(SimulationFailed, match=r"BADQACC.*2"):
        refuse_warnings(data.warning.number)


def test_a_sheet_above_its_ends_has_snapped() -> None:
    refuse_snapped(-0.005, 0.05)  # almost flat: the sign of the sag says nothing
    refuse_snapped(0.03, 0.5)
    with pytest.raises(SimulationFailed, match=r"snapped.*5\.0 mm above"):
        refuse_snapped(-0.005, 0.5)


# --- the trace ----------------------------------------------------------------------------------


def test_the_trace_is_written_with_units(tmp_path: Path) -> None:
    result = run()
    with run_folder(tmp_path) as kept:
        write_numbers(result, kept)
    read = pq.read_table(tmp_path / "trace.parquet")
    assert read.num_rows == result.trace.rows
    for name, unit in result.trace.columns:
        assert read.schema.field(name).metadata[b"unit"].decode() == unit
        np.testing.assert_array_equal(read[name].to_numpy(), result.trace[name])


def test_the_trace_has_columns_for_the_arms_with_a_sensor() -> None:
    names = {name for name, _ in run().trace.columns}
    assert "left_measured_moment_y" in names
    assert "right_measured_moment_y" not in names
    assert len(names) == len(run().trace.columns)  # no name twice
