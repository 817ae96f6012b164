"""Runs of one batch are what each is alone, to the bit; one that ends early disturbs no other."""

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from dualbend.batch.benchmark import benchmark_batch
from dualbend.batch.group import alone, grouped
from dualbend.batch.loop import BatchLoop
from dualbend.batch.many import run_many
from dualbend.control.controller import Controller
from dualbend.errors import InputError
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario, variants
from dualbend.study.runs import in_batches
from dualbend.study.sweep.run import run_row
from dualbend.task.bending.rehearsal import Rehearsal
from dualbend.task.bending.run import BendingRun
from dualbend.types import Vector

SHORT = (
    "sheet.model.hinges=4",
    "motion.speed_rad_per_s=0.8",
    "motion.settle_s=0.3",
    "motion.hold_s=0.1",
    "path.end_rad=0.3",
)
NONE = (*SHORT, "imperfections=none")


def made(scenario: str, *settings: str, seed: int = 1) -> BendingRun:
    run = make_run(load_scenario(scenario, settings, seed=seed))
    assert isinstance(run, BendingRun)
    return run


def assert_same(found: RunRecord, wanted: RunRecord) -> None:
    """Compare every column but that of the clock on the wall, bit for bit."""
    assert (found.outcome, found.reason) == (wanted.outcome, wanted.reason)
    assert found.simulated_s == wanted.simulated_s
    assert found.trace.columns == wanted.trace.columns
    for name, _ in wanted.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(found.trace[name], wanted.trace[name], err_msg=name)
    np.testing.assert_array_equal(found.trace.qpos, wanted.trace.qpos)


def assert_as_alone(cases: Sequence[tuple[str, ...]], *, groups: int = 1) -> list[RunRecord]:
    """Run cases of a scenario and settings in batches, and each alone."""
    runs: list[Run] = [made(*case, seed=seed) for seed, case in enumerate(cases, 1)]
    assert len(grouped(runs, len(runs))) == groups
    records = dict(run_many(runs))
    assert not any(isinstance(record, Exception) for record in records.values()), records
    for seed, case in enumerate(cases, 1):
        assert_same(records[seed - 1], made(*case, seed=seed).run())
    return [records[i] for i in range(len(cases))]


def test_worlds_differ_in_seed_gains_delay_sheet_and_path() -> None:
    assert_as_alone(
        [
            ("fig8", *SHORT),
            ("fig8", *SHORT, "compliance.rotation.b=0.4", "robot.alter.delay_cycles=3"),
            ("fig8", *SHORT, "sheet.thickness_m=0.0005", "sheet.length_m=0.31"),
            ("fig8", *SHORT, "path.end_rad=0.2", "sensor.torque_noise_nm=0.001"),
            ("fig8", *SHORT, "imperfections.robot.stiction_excess=0.4"),
        ]
    )


@pytest.mark.parametrize(
    "settings",
    [
        ("sensor.latency_ms=9",),
        ("sensor.sampling_ms=10",),
        ("robot.command_period_s=0.014",),
        ("robot.servo.integral={}",),
        ("filter.kind=iir",),
        ("robot.alter.mode=tool",),
        ("robot.left.delay_cycles=2", "robot.right.delay_cycles=0"),
    ],
)
def test_the_loop_of_every_world_is_the_loop_of_a_single_run(settings: tuple[str, ...]) -> None:
    assert_as_alone([("fig8", *NONE, *settings)] * 2)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["fig6", "fig9", "exact", "tuned", "tuned-exact", "learned"])
def test_shipped_scenarios_are_the_same_in_a_batch(scenario: str) -> None:
    speed = "motion.speed_rad_per_s=0.5"
    assert_as_alone([(scenario, "sheet.model.hinges=10", speed)] * 3)


def test_controllers_that_know_one_world_are_asked_world_by_world() -> None:
    spatial = (
        "compliance={kind='mass-spring-damper', pitch={b=40.0, k=30.0}}",
        "compliance={kind='mass-spring-damper', pitch={b=20.0, k=30.0}}",
    )
    assert_as_alone([("fig8", *NONE, one) for one in spatial])


def test_a_world_at_its_bounds_says_so_itself() -> None:
    bounded = ("compliance.limit_rotation_rad=1e-4",)
    first, second = assert_as_alone([("fig8", *NONE, *bounded), ("fig8", *NONE)])
    assert first.trace["saturated"].any()
    assert not second.trace["saturated"].any()


def test_arms_stand_elsewhere_in_every_world() -> None:
    places = ("cell.base_height_m=0.95", "cell.base_height_m=0.97")
    typical = "imperfections.robot.zero_spread_rad=1e-4"
    assert_as_alone([("fig6", *NONE, typical), *(("fig6", *NONE, typical, one) for one in places)])


def test_calibrated_sensors_are_a_batch_of_their_own() -> None:
    learned = ("sensor.calibration={weight_kg=0.5, attitudes=3, grips=2, readings=2}",)
    assert_as_alone([("fig8", *SHORT, *more) for more in ((), learned, (), learned)], groups=2)


def test_the_friction_that_was_told_is_each_worlds_own() -> None:
    scenario = load_scenario("fig8", NONE)
    told = np.random.default_rng(1).uniform(0.6, 1.4, (2, 12))
    runs = [BendingRun(scenario, friction=one) for one in told]
    records = dict(run_many(runs))
    for i, one in enumerate(told):
        record = records[i]
        assert isinstance(record, RunRecord)
        assert_same(record, BendingRun(scenario, friction=one).run())


def test_motions_without_a_sheet_are_a_batch_and_tell_each_cells_friction() -> None:
    quick = ("path.end_rad=0.2", "motion.settle_s=0.5", "motion.hold_s=0.5")
    cells = [load_scenario("learned", (*quick, "sheet.model.hinges=4"), seed=i) for i in (1, 2)]
    runs = [Rehearsal(each) for each in cells]
    sheet = made("learned", *quick, "sheet.model.hinges=4")
    assert grouped([*runs, sheet], 3) == [[0, 1], [2]]
    for i, record in run_many(runs):
        assert isinstance(record, RunRecord)
        alone = Rehearsal(cells[i])
        wanted = alone.run()
        assert_same(record, wanted)
        np.testing.assert_array_equal(runs[i].told(record), alone.told(wanted))
        assert (runs[i].told(record) != 1.0).any()


def test_cells_that_err_in_one_thing_each_are_as_alone() -> None:
    """What `dualbend imperfections` runs: what errs decides what can be one batch."""
    shorter = (*SHORT, "motion.settle_s=0.1", "path.end_rad=0.1")
    cases = variants(load_scenario("fig8", shorter), "worst")
    runs = [make_run(case) for case in cases.values()]
    for i, record in run_many(runs):
        assert isinstance(record, RunRecord)
        assert_same(record, make_run(list(cases.values())[i]).run())
    assert max(map(len, grouped(runs, len(runs)))) > 2


def test_records_of_a_batch_compile_no_looks() -> None:
    """A model with its looks is 2.6 MB and 12 ms of every run; only a picture asks for it."""
    runs = [made("fig8", *NONE, seed=seed) for seed in (1, 2)]
    records = dict(run_many(runs))
    assert not any({"spec", "model"} & vars(run.cell).keys() for run in runs)
    found = records[0]
    assert isinstance(found, RunRecord)
    assert found.model.nq == runs[0].cell.simulation.model.nq


def test_own_controllers_fail_alone() -> None:
    """Of a shape that is no deviation, and where the arms cannot go."""
    answers = ["observation.filtered.components * 0", "np.zeros(3)", "np.full((2, 6), 0.9)"]
    module = "".join(
        f"class C{i}:\n    def __init__(self, scenario): pass\n"
        f"    def __call__(self, observation): return {answer}\n"
        for i, answer in enumerate(answers)
    )
    with TemporaryDirectory() as folder:
        name = "controllers_of_a_batch"
        (Path(folder) / f"{name}.py").write_text(f"import numpy as np\n{module}")
        both = 'sensing=["left","right"], complying=["left","right"]'
        kinds = [f'compliance={{kind="{name}:C{i}", {both}}}' for i in range(3)]
        with pytest.MonkeyPatch.context() as patch:
            patch.syspath_prepend(folder)
            records = assert_as_alone([("fig8", *NONE, kind) for kind in kinds])
    assert [one.outcome for one in records] == ["completed", "failed", "protective_stop"]


def test_own_controllers_under_a_learned_correction_fail_alone() -> None:
    def fails(_: object) -> Vector:
        raise RuntimeError("no answer")

    def made_with(compliance: Callable[[Scenario], Controller]) -> BendingRun:
        scenario, correction = load_scenario("fig8", NONE), np.zeros((2, 1))
        run = make_run(scenario, compliance=compliance, correction=correction)
        assert isinstance(run, BendingRun)
        return run

    loop = BatchLoop([made_with(lambda _: fails), made_with(lambda _: lambda _: np.zeros((2, 6)))])
    assert sorted(dict(loop.run())) == [1]
    assert loop.left.tolist() == [True, False]


def test_a_model_to_look_at_is_compiled_for_who_asks() -> None:
    runs = [made("fig8", *NONE, seed=seed) for seed in (1, 2)]
    records = [record for _, record in run_many(runs)]
    assert not any("model" in vars(run.cell) for run in runs)
    assert isinstance(records[0], RunRecord)
    assert records[0].model.ngeom > runs[0].cell.simulation.model.ngeom


def test_the_benchmark_parts_a_cycle_into_physics_and_control() -> None:
    found = benchmark_batch(load_scenario("fig8", NONE), 2, threads=1)
    parts = float(found["physics_us"]), float(found["control_us"])
    assert min(parts) > 0.0
    assert sum(parts) == pytest.approx(float(found["cycle_us"]))
    assert (found["worlds"], found["left"]) == (2, 0)
    with pytest.raises(InputError, match="one by one: a sheet that may slide"):
        benchmark_batch(load_scenario("fig8", (*NONE, "grasp.friction=0.8")), 2)


def test_a_run_stands_once_and_a_batch_has_a_size() -> None:
    run = made("fig8", *NONE)
    with pytest.raises(InputError, match="twice"):
        next(run_many([run, run]))
    with pytest.raises(InputError, match="make_run returns, got Scenario"):
        next(run_many([run.scenario]))  # type: ignore[list-item]
    for wrong in ({"batch": 0}, {"batch": 1.5}, {"threads": 0}, {"threads": True}):
        ((name, value),) = wrong.items()
        with pytest.raises(InputError, match=f"{name} = {value}: must be a whole number"):
            next(run_many([run], **wrong))


def test_a_world_that_stops_ends_as_it_does_alone_and_the_others_go_on() -> None:
    stops = ("guard.following_error_rad=1e-4",)
    cases = [("fig8", *NONE), ("fig8", *NONE, "sensor.torque_bias_nm=[0,6,0]"), ("fig8", *NONE)]
    records = assert_as_alone(cases)
    assert [record.outcome for record in records] == ["completed", "protective_stop", "completed"]
    both = assert_as_alone([("fig8", *NONE, *stops)] * 2)
    assert {record.outcome for record in both} == {"protective_stop"}


def test_worlds_have_no_state_of_their_own_and_make_it_again_to_be_run_alone() -> None:
    """1.1 MB of each; the friction of a joint that sticks is what the cell was compiled with."""
    sticks = (*SHORT, "imperfections.robot.stiction_excess=0.4", "guard.following_error_rad=1e-4")
    runs = [made("fig8", *sticks, seed=seed) for seed in (1, 2, 3)]
    assert runs[0].cell.robots is runs[1].cell.robots
    records = run_many(runs)
    found = dict([next(records)])
    assert not any({"ik", "simulation"} & vars(run.cell).keys() for run in runs[1:])
    found |= dict(records)
    for i, record in found.items():
        assert isinstance(record, RunRecord)
        assert record.outcome == "protective_stop"
        assert_same(record, made("fig8", *sticks, seed=i + 1).run())


def test_a_world_with_nan_ends_alone() -> None:
    runs = [made("fig8", *NONE, seed=seed) for seed in (1, 2, 3)]
    loop = BatchLoop(runs, threads=1)
    loop._physics.data.qvel[1, 3] = np.nan
    records = dict(loop.run())
    assert sorted(records) == [0, 2]
    assert loop.left.tolist() == [False, True, False]
    for world, record in records.items():
        assert_same(record, made("fig8", *NONE, seed=world + 1).run())


def test_structures_that_differ_are_other_batches_and_some_runs_go_alone() -> None:
    settings = [(), ("sheet.model.hinges=6",), ("robot.servo.damping_ratio=0.8",), ()]
    runs: list[Run] = [made("fig8", *NONE, *more) for more in settings]
    assert grouped(runs, 8) == [[0, 3], [1], [2]]
    assert grouped(runs, 1) == [[0], [3], [1], [2]]
    assert not alone(runs[0])
    assert "slide" in alone(made("fig8", *NONE, "grasp.friction=0.8"))
    assert "mink" in alone(made("fig8", *NONE, "robot.model=panda"))


def test_rows_of_a_study_do_not_depend_on_its_batches() -> None:
    scenarios = [load_scenario("fig8", NONE, seed=seed) for seed in (1, 2, 3)]
    bad = load_scenario("fig8", (*NONE, "path.end_rad=1.5", "sheet.length_m=1.2"))
    tasks = dict(enumerate([(i, one) for i, one in enumerate((*scenarios, bad))]))

    def local(tasks, run_one):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
        for key, arguments in tasks.items():
            yield key, run_one(*arguments)

    batches = dict(in_batches(cluster=local)(tasks, run_row))
    assert batches == dict(in_batches(batch=1, cluster=local)(tasks, run_row))
    assert [batches[i].outcome for i in range(4)] == ["completed"] * 3 + ["refused"]
    with pytest.raises(InputError, match="batch = 0"):
        in_batches(batch=0)
