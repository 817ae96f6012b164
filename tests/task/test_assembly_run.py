"""The assembly as a whole: laid or stopped for a reason, repeatable, its verdict checked from qpos.

Runs of some seconds each; every one is made once and looked at by several tests.
"""

import dataclasses
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.beam import elastica
from dualbend.errors import InputError
from dualbend.run.cell import RobotCell
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.stream import TraceStream, read_trace
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS, Trace, TraceRecorder
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HOLES
from dualbend.scene.sheet.strips import bend_joint, strip_body, twist_joint
from dualbend.scene.warnings import SimulationFailed
from dualbend.task.assembly import run as assembly_run
from dualbend.task.assembly.config import AssemblyConfig
from dualbend.task.assembly.metrics import final_holes, phase_table, seated
from dualbend.task.assembly.program.motions import PHASES
from dualbend.task.assembly.run import AssemblyRun
from dualbend.task.assembly.stiffness import object_stiffness
from dualbend.task.bending.config import BendingConfig

Array = NDArray[np.float64]
OFF = ("task.errors.pickup_x_m=0.012",)
"""Beyond the jaws: this run ends within some 100 cycles."""
FRAGILE = ("task.limits.pin_force_n=0.2",)
PERFECT = "imperfections=none"


@cache
def run(name: str, *settings: str) -> RunRecord:
    return AssemblyRun(load_scenario(name, list(settings))).run()


def table(trace: Trace) -> Array:
    """Return every column but the clock on the wall."""
    names = [name for name, _ in trace.columns if name not in WALL_CLOCK_COLUMNS]
    return np.array([trace[name] for name in names])


# --- laid ---------------------------------------------------------------------------------------


def test_the_shipped_sheet_is_laid_through_all_phases_at_the_first_attempt() -> None:
    result = run("pwb")
    assert (result.outcome, result.reason) == ("completed", "")
    assert [row["phase"] for row in phase_table(result)] == list(PHASES)
    assert not result.trace["attempt"].any()


@pytest.mark.slow
def test_seated_is_what_the_last_state_says() -> None:
    """The default holes are at the centres of four strips, whose plates are found by mj_forward."""
    result = run("pwb", PERFECT)
    model, data = result.model, mujoco.MjData(result.model)
    data.qpos[:] = result.trace.qpos[-1]
    mujoco.mj_forward(model, data)
    assembly, sheet = result.scenario.task, result.scenario.sheet
    assert isinstance(assembly, AssemblyConfig)
    h = sheet.length_m / sheet.strips.hinges
    for i, along in enumerate((-0.04, 0.04, -0.14, 0.14)):
        strip = sheet.strips.hinges // 2 + round(along / h)
        assert (strip - sheet.strips.hinges // 2) * h == pytest.approx(along)
        x, y, z = data.geom(f"{strip_body(strip)}_plate").xpos
        # Discretisation-limited: half the clearance of 0.2 mm and 20 µm for ring and contact.
        assert np.hypot(x - along, y) <= 0.12e-3
        # Discretisation-limited: contact softness under 0.3 N.
        assert z - 0.5 * sheet.thickness_m - assembly.layout.bed.top_m == pytest.approx(0, abs=5e-6)
        # The same numbers, but for the motion of the last cycle.
        np.testing.assert_allclose(
            final_holes(result)[0, i],
            [x - along, y, z - 0.5 * sheet.thickness_m - assembly.layout.bed.top_m],
            atol=1e-7,
        )
    np.testing.assert_array_equal(seated(result), True)


@pytest.mark.parametrize(
    ("shift", "held"),
    [
        ((0.0, 0.0, 0.0), True),
        ((0.15e-3, 0.0, 0.0), False),
        ((0.0, -0.15e-3, 0.0), False),
        ((0.09e-3, 0.09e-3, 0.0), False),
        ((0.0, 0.0, 0.6e-3), False),
    ],
)
def test_a_hole_that_is_not_around_its_pin_or_not_down_is_not_seated(
    shift: tuple[float, float, float], held: bool
) -> None:
    result = run("pwb")
    holes = result.laid[0].copy()
    holes[2] = shift  # where it came to rest within its play is the friction's
    moved = dataclasses.replace(result, laid=(holes,))
    np.testing.assert_array_equal(seated(moved), [[True, True, held, True]])


@pytest.mark.parametrize(
    ("shift", "said"),
    [
        ((3e-3, 4e-3, 0.0), "5.00 mm off its pin's axis and 0.00 mm above its rest"),
        ((0.0, 0.0, 4e-3), "0.00 mm off its pin's axis and 4.00 mm above its rest"),
    ],
)
def test_a_run_whose_program_let_go_of_a_sheet_that_is_not_seated_has_failed(
    shift: tuple[float, float, float], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exact: hole and distance; of a stack, each sheet rests on those before it."""
    one = AssemblyRun(load_scenario("pwb-stack"))
    one.begin()
    thickness, holes = one.cell.sheet.thickness_m, np.zeros((4, 3))
    monkeypatch.setattr(one.pins, "offsets", holes.copy)
    one._lay()
    holes[:, 2] = thickness
    one._lay()
    holes[2] += shift
    holes[:, 2] += thickness
    with pytest.raises(
        SimulationFailed, match=f"withdraw: not seated: the {HOLES[2]} hole is {said}"
    ):
        one._lay()
    assert len(one.laid) == 3


def test_a_sheet_that_was_not_let_go_is_not_seated() -> None:
    result = dataclasses.replace(run("pwb"), laid=())
    assert seated(result).shape == (1, 4)
    assert not seated(result).any()


def test_the_laid_sheet_is_free_and_carries_no_load() -> None:
    """At the end both arms feel nothing: the sheet was let go, not just put down."""
    trace = run("pwb").trace
    late = trace["phase"] == PHASES.index("withdraw")
    for side in ("left", "right"):
        for axis in "xyz":
            # The pads' springs without the sheet: 1e-2 N of what the motion shakes.
            assert np.abs(trace[f"{side}_true_force_{axis}"][late]).max() < 0.02


def test_what_the_arms_feel_of_the_air_borne_sheet_is_its_weight() -> None:
    trace, sheet = run("pwb", PERFECT).trace, run("pwb").scenario.sheet.sheet()
    weight = sheet.mass_kg * 9.81
    for phase in ("lift", "carry", "bend"):
        last = np.flatnonzero(trace["phase"] == PHASES.index(phase))[-15:]
        true = sum(trace[f"{side}_true_force_z"][last].mean() for side in ("left", "right"))
        # Statics, with what the motion leaves of the swing.
        assert true == pytest.approx(-weight, rel=0.03)
        # Statistical: two sensors of 0.05 N and 0.05 N counts, a mean of 15: 0.02 N; 4 σ.
        assert trace["net_force_z"][last].mean() == pytest.approx(-weight, abs=0.08)


def test_no_command_jumps() -> None:
    """Set-points of the joints from cycle to cycle, through all phases and the compliance."""
    trace = run("pwb").trace
    names = [name for name, _ in trace.columns if "_setpoint_" in name]
    assert len(names) == 12
    steps = np.array([np.abs(np.diff(trace[name])).max() for name in names])
    # Bound: 0.25 m/s for 28 ms is 7 mm at some 0.4 m from a joint, the wrist takes twice that.
    assert steps.max() < 0.035


# --- stopped ------------------------------------------------------------------------------------


def test_a_sheet_beyond_the_jaws_is_noticed_in_the_grasp() -> None:
    result = run("pwb", *OFF)
    assert result.outcome == "aborted"
    assert result.reason.startswith("grasp: nothing is between the left jaws")
    assert not result.expected
    assert not seated(result).any()
    assert result.trace["phase"].max() == PHASES.index("grasp")


def test_a_pin_force_above_its_limit_fails_with_phase_and_value() -> None:
    """A millimetre off, the tips guide the holes; what takes newtons is above 0.2 N."""
    result = run("pwb-misaligned", *FRAGILE)
    assert result.outcome == "failed"
    phase, _, rest = result.reason.partition(": ")
    assert phase == "lower"
    assert rest.startswith("the force on the middle_")
    value = float(rest.split(" is ")[1].split(" N")[0])
    worst = max(result.trace[f"pin_force_{hole}"][-1] for hole in HOLES)
    # The value is the last row's, in one decimal; no row before was above the limit.
    assert value == pytest.approx(worst, abs=0.05)
    assert value > 0.2
    before = [result.trace[f"pin_force_{hole}"][:-1].max() for hole in HOLES]
    assert max(before) <= 0.2


def test_the_run_is_given_up_when_its_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assembly_run, "LONGEST_S", 0.56)
    monkeypatch.setattr(assembly_run, "ATTEMPT_S", 0.0)
    result = AssemblyRun(load_scenario("pwb")).run()
    assert result.outcome == "aborted"
    assert result.reason.startswith("approach: not done within 0.56 s")
    assert result.trace.rows == 20


def test_the_same_seed_is_the_same_trace_also_of_the_same_object() -> None:
    """Through pick-up, contact with pins and compliance; the first run leaves nothing behind."""
    first = run("pwb-misaligned", *FRAGILE)
    again = AssemblyRun(load_scenario("pwb-misaligned", list(FRAGILE)))
    np.testing.assert_array_equal(table(first.trace), table(again.run().trace))


@pytest.mark.slow
def test_a_second_run_of_the_same_object_begins_anew() -> None:
    prepared = AssemblyRun(load_scenario("pwb", ["task.errors.pickup_yaw_rad=0.01", *OFF]))
    first = table(prepared.run().trace)
    np.testing.assert_array_equal(first, table(prepared.run().trace))


# --- the stiffness that the compliance works against --------------------------------------------


@cache
def prepared() -> AssemblyRun:
    return AssemblyRun(load_scenario("pwb", [PERFECT]))


def held(bend: float) -> tuple[RobotCell, Array, float, float]:
    """Return cell, joint angles, end slope and place of the middle at a share of the bend."""
    run_ = prepared()
    posture = dataclasses.replace(run_._down, alpha=bend * run_._down.alpha)
    place = np.array([posture.x, posture.y, posture.z, posture.yaw])
    q = run_.cell.reach(run_._pose(posture), run_._down_q, place)
    return run_.cell, q, posture.alpha, posture.z


def pushed(bend: float, prestress: bool) -> Array:
    """Return the stiffness (3, 3) by pushing and turning the middle, in the physics itself.

    Without weight, contact and dry friction, the sheet rigid between its pinned holes. Both signs
    of each load, at rest after 1.5 s. Without prestress the bent shape is made the natural one.
    """
    cell, q, alpha, height = held(bend)
    scenario, simulation = cell.scenario, cell.simulation
    spec = cell.spec.copy()
    model = spec.compile()
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0.0
    model.dof_frictionloss[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    hinges, length = scenario.sheet.strips.hinges, scenario.sheet.length_m
    arcs = np.linspace(0.0, length, hinges + 1)
    _, _, slopes = elastica.shape(alpha, length, arcs)
    names = {model.joint(i).name for i in range(model.njnt)}
    for i, step in enumerate(np.diff(slopes)):
        joint = model.joint(bend_joint(i))
        if not prestress:
            model.qpos_spring[joint.qposadr[0]] = step
        if abs((i + 0.5) * length / hinges - 0.5 * length) < 0.04:
            for name in {bend_joint(i), twist_joint(i)} & names:
                model.jnt_stiffness[model.joint(name).id] = 5e3
    middle = model.body(strip_body(hinges // 2)).id

    def rest(load: Array) -> Array:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = simulation.positions(q, 0.0, slopes, np.array([0.0, 0.0, height]))
        data.ctrl[: len(q)] = q
        data.eq_active[:] = 1
        data.xfrc_applied[middle] = load
        for _ in range(round(1.5 / model.opt.timestep)):
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        axes = data.xmat[middle].reshape(3, 3)
        return np.array([*data.xpos[middle][:2], np.arctan2(axes[1, 0], axes[0, 0])])

    compliance = np.zeros((3, 3))
    for column, (axis, size) in enumerate(((0, 1.0), (1, 1.0), (5, 0.05))):
        load = size * np.eye(6)[axis]
        compliance[:, column] = (rest(load) - rest(-load)) / (2.0 * size)
    return np.linalg.inv(compliance)


@pytest.mark.parametrize("bend", [0.0, 0.3, 1.0])
def test_the_objects_stiffness_is_symmetric_and_positive(bend: float) -> None:
    cell, q, alpha, _ = held(bend)
    stiffness = object_stiffness(cell, q, alpha, (-0.04, 0.04))
    # Analytic: rounding of 1e5.
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-6)
    assert np.linalg.eigvalsh(stiffness).min() > 0.0


def test_the_stiffness_grows_towards_the_flat_sheet() -> None:
    """Along every axis: what the bent sheet gives way by its curvature is gone when it is flat."""
    rows = prepared().stiffness[::-1]
    assert (np.diff(rows, axis=0) > 0.0).all()
    # Bound: two arms and their pads in parallel, with the sheet rigid.
    assert rows[-1][0] < 2 * prepared().scenario.grasp.translational_stiffness_n_per_m


def test_the_stiffness_is_what_pushing_the_middle_finds() -> None:
    """The same springs as J k⁻¹ Jᵀ: without prestress only the weld's 1 % is between them."""
    cell, q, alpha, _ = held(1.0)
    stiffness, found = object_stiffness(cell, q, alpha, (-0.04, 0.04)), pushed(1.0, prestress=False)
    # Discretisation-limited: the weld's softness, motion left after 1.5 s.
    np.testing.assert_allclose(np.diag(found), np.diag(stiffness), rtol=0.015)
    assert found[0, 1] == pytest.approx(stiffness[0, 1], rel=0.05)


def test_the_end_force_that_is_left_out_is_within_the_gain_margin() -> None:
    """At the full bend the real one is 0.53, 1.34 and 0.58 of it (x, y, yaw): golden within 10 %.

    What counts for the loop is that it is not 4 times as stiff as it was designed for.
    """
    cell, q, alpha, _ = held(1.0)
    stiffness, found = object_stiffness(cell, q, alpha, (-0.04, 0.04)), pushed(1.0, prestress=True)
    ratio = np.diag(found) / np.diag(stiffness)
    np.testing.assert_allclose(ratio, [0.53, 1.34, 0.58], rtol=0.1)
    assembly = prepared().config
    assert assembly.compliance is not None
    assert ratio.max() < 0.5 * assembly.compliance.gain_margin


# --- an interrupted run's trace -----------------------------------------------------------------


def interrupted(folder: Path, cycles: int) -> tuple[RunRecord, Path]:
    """Stop a run after some cycles as Ctrl-C does; return it and a copy of its stream."""
    prepared_ = AssemblyRun(load_scenario("pwb"))
    copy = folder / "copy.arrow"
    with run_folder(folder) as kept, kept.log(prepared_) as keep:

        def on_cycle(done: int) -> None:
            keep()
            if done == cycles:
                copy.write_bytes((folder / "unfinished" / "trace.arrow").read_bytes())
                raise KeyboardInterrupt

        result = prepared_.run(on_cycle)
    return result, copy


def test_the_stream_of_an_interrupted_run_is_its_first_rows(tmp_path: Path) -> None:
    result, copy = interrupted(tmp_path, 80)
    assert result.outcome == "failed"
    assert result.reason.startswith("interrupted by the user")
    assert result.trace.rows == 80
    kept = read_trace(copy)
    # A batch a second, 36 cycles: two are there.
    assert kept.num_rows == 72
    assert kept.column_names == [name for name, _ in result.trace.columns]
    for name in ("time", "left_gap", "left_q_joint2", "net_force_z"):
        np.testing.assert_array_equal(kept[name].to_numpy(), result.trace[name][:72])
    assert kept.schema.field("net_force_z").metadata == {b"unit": b"N"}
    # What was left to write when the run ended is there, too.
    assert read_trace(tmp_path / "unfinished" / "trace.arrow").num_rows == 80
    # Cut off within the second batch, the first is still there; within the header, nothing is.
    whole = copy.read_bytes()
    cut = tmp_path / "cut.arrow"
    cut.write_bytes(whole[:-1000])
    assert read_trace(cut).num_rows == 36
    cut.write_bytes(whole[:100])
    with pytest.raises(InputError, match="no trace of a run"):
        read_trace(cut)


def test_a_stream_takes_no_row_twice(tmp_path: Path) -> None:
    trace = TraceRecorder(100, [], 1, 1, {})
    stream = TraceStream(lambda: tmp_path / "trace.arrow", dict)
    for row in range(100):
        trace.rows = row + 1
        trace._table[row] = row
        stream.update(trace)
    kept = read_trace(tmp_path / "trace.arrow")
    np.testing.assert_array_equal(kept["time"].to_numpy(), np.arange(72))
    stream.close(trace)
    kept = read_trace(tmp_path / "trace.arrow")
    np.testing.assert_array_equal(kept["time"].to_numpy(), np.arange(100))


# --- "none" takes back --------------------------------------------------------------------------


def test_none_unsets_an_optional_section_of_the_extended_scenario(tmp_path: Path) -> None:
    child = tmp_path / "child.toml"
    child.write_text('extends = "pwb"\nname = "child"\n[task]\ncompliance = "none"\n')
    assembly = load_scenario(str(child)).task
    assert isinstance(assembly, AssemblyConfig)
    assert assembly.compliance is None
    grandchild = tmp_path / "grandchild.toml"
    grandchild.write_text(
        'extends = "child.toml"\nname = "g"\n[task.compliance]\ngain_margin = 5.0\n'
    )
    again = load_scenario(str(grandchild)).task
    assert isinstance(again, AssemblyConfig)
    assert again.compliance is not None
    assert again.compliance.gain_margin == 5.0
    bending = '[task]\nkind = "bending"\n[robot.servo]\nfriction_estimate = "none"\n'
    child.write_text(f'extends = "pwb"\nname = "child"\n{bending}')
    assert load_scenario(str(child)).task == BendingConfig()


def test_none_on_the_command_line_unsets_too() -> None:
    assembly = load_scenario("pwb", ["task.compliance=none"]).task
    assert isinstance(assembly, AssemblyConfig)
    assert assembly.compliance is None
    assert (
        load_scenario("pwb-rigid").task
        == load_scenario("pwb-misaligned", ["task.compliance=none"]).task
    )


def test_none_for_what_is_not_optional_is_refused() -> None:
    with pytest.raises(InputError, match=r"task\.lift_m = 'none'"):
        load_scenario("pwb", ["task.lift_m=none"])


def test_none_unsets_nothing_where_nothing_was(tmp_path: Path) -> None:
    """A file that extends nothing may say it as well: the key is not there then either."""
    text = load_scenario("pwb").to_toml()
    assert "[task.compliance]" in text
    head, _, rest = text.partition("[task.compliance]")
    rest = rest[rest.index("\n[") :]
    alone = tmp_path / "alone.toml"
    head = head.replace("[task]\n", '[task]\ncompliance = "none"\n')
    alone.write_text(head + rest)
    assembly = load_scenario(str(alone)).task
    assert isinstance(assembly, AssemblyConfig)
    assert assembly.compliance is None


@pytest.mark.parametrize("true", [0.6, 1.0, 1.4])
def test_before_the_first_sheet_the_arms_learn_their_friction(true: float) -> None:
    """And no weight that they do not know: links that are 5 % heavier pull at some joints."""
    errors = {"robot": {"coulomb_ratio": true, "link_mass_ratio": 1.05}}
    run = AssemblyRun(load_scenario("pwb", {"imperfections": {"preset": "none", **errors}}))
    run.begin()
    phase = run.program.table[0].name
    while phase == "approach":
        run.step()
        phase = PHASES[int(run.trace["phase"][-1])]
    # By design: what is left after a motion forth and back is a tenth at most.
    np.testing.assert_allclose(run.cell.friction.ratio, true, atol=0.06)
    learned = run.cell.friction.ratio.copy()
    for _ in range(100):
        run.step()
    np.testing.assert_array_equal(run.cell.friction.ratio, learned)
