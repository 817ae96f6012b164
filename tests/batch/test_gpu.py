"""MuJoCo Warp against MuJoCo, on Warp's CPU device: single precision, a command cycle at a time."""

import mujoco
import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.types import Vector

pytest.importorskip("warp", reason="needs the extra gpu")
mjw = pytest.importorskip("mujoco_warp", reason="needs the extra gpu")

import warp as wp  # noqa: E402

from dualbend.batch.gpu.cycle import look_for_contacts  # noqa: E402
from dualbend.batch.gpu.models import put_models  # noqa: E402
from dualbend.batch.gpu.physics import WarpPhysics  # noqa: E402
from dualbend.batch.many import run_many  # noqa: E402

# A cycle of four steps: most of a start is capturing the graph of one, step by step.
QUICK = ("robot.command_period_s=0.007", "sheet.model.hinges=6", "path.end_rad=0.1")
CYCLES = 3


def begun(*settings: str) -> Run:
    run = make_run(load_scenario("fig8", [*QUICK, *settings]))
    run.begin()
    return run


def moving(run: Run, cycle: int) -> Vector:
    """Return set-points (steps, joints) that move all joints, fast enough to slip."""
    steps = run.cell.simulation.steps
    times = cycle + np.arange(1, steps + 1) / steps
    return run.cell.home + 2e-4 * times[:, np.newaxis]


def pair(*settings: str) -> tuple[list[Run], WarpPhysics]:
    """Return two worlds that differ in arms and sheet, on MuJoCo and both on Warp."""
    runs = [begun(*settings), begun("seed=2", "sheet.thickness_m=0.0006", *settings)]
    return runs, WarpPhysics([run.cell for run in runs], "cpu")


@pytest.mark.parametrize("preset", ["none", "typical"])
def test_worlds_do_what_their_cells_do(preset: str) -> None:
    """Coriolis torques that are own or given, friction that follows speeds, displaced grips."""
    runs, physics = pair(f"imperfections={preset}")
    physics.start()
    for cycle in range(CYCLES):
        data, feeds = physics.observe(), []
        for world, run in enumerate(runs):
            simulation = run.cell.simulation
            seen = simulation.observe()
            # Single precision is 6e-8 of angles up to 3 rad and of places up to 1 m.
            assert data.qpos[world, simulation._q] == pytest.approx(seen.q, abs=2e-6)
            assert data.qvel[world, simulation.dofs] == pytest.approx(seen.speed, abs=2e-4)
            assert data.site_xpos[world] == pytest.approx(simulation.data.site_xpos, abs=2e-6)
            assert data.site_xmat[world] == pytest.approx(simulation.data.site_xmat, abs=1e-5)
            if simulation.fed_forward is not None:
                feeds.append(simulation.fed_forward(seen.q, seen.speed))
            simulation.advance(moving(run, cycle))
        setpoints = np.array([moving(run, cycle) for run in runs])
        physics.advance(setpoints, np.array(feeds) if feeds else None)
    wrench, rotation = physics.sample(physics.steps)
    for world, run in enumerate(runs):
        simulation = run.cell.simulation
        true, axes = simulation.observer.sample(simulation.data)
        # The noise of places on pads of 1e6 N/m.
        assert wrench[world, :, :3] == pytest.approx(true[:, :3], abs=0.3)
        assert wrench[world, :, 3:] == pytest.approx(true[:, 3:], abs=5e-3)
        assert rotation[world] == pytest.approx(axes, abs=1e-5)
    assert np.abs(np.subtract(*wrench)).max() > 1.0  # two worlds, not one twice
    assert not physics.failed.any()


def test_the_holds_of_a_light_sheet_are_not_too_heavy_for_single_precision() -> None:
    """Of a gram a strip, as in ``exact``: those of ``fig8``'s made the Hessian indefinite."""
    light = ("length_m=0.4", "width_m=0.057", "thickness_m=0.0005")
    run = begun("sheet.model.hinges=20", *(f"sheet.{each}" for each in light))
    physics = WarpPhysics([run.cell], "cpu")
    physics.start()
    for cycle in range(CYCLES):
        physics.observe()
        physics.advance(moving(run, cycle)[np.newaxis], np.zeros((1, len(run.cell.home))))
    assert not physics.failed.any()


def test_a_world_that_fails_is_named_and_leaves_the_other_its_bits() -> None:
    runs, physics = pair("imperfections=none")
    states = []
    for lost in (0.0, np.nan):
        physics.start()
        for cycle in range(CYCLES):
            setpoints = np.array([moving(run, cycle) for run in runs])
            setpoints[1] += lost
            physics.advance(setpoints)
        states.append(physics.data.qpos[0].copy())
        assert physics.failed.tolist() == [False, bool(np.isnan(lost))]
    assert np.array_equal(*states)
    assert np.isfinite(physics.data.qpos).all()


def test_what_touches_is_never_taken_for_apart() -> None:
    """Arms at random angles, some through each other, the floor and the sheet, some clear."""
    simulation, count = begun("imperfections=none").cell.simulation, 1000
    model, data = simulation.model, simulation.data
    positions = np.tile(data.qpos, (count, 1))
    low, high = simulation.joint_range.T
    random = np.random.default_rng(0).uniform(low, high, (count, len(low)))
    share = np.linspace(0.1, 1.0, count)[:, np.newaxis]
    positions[:, simulation._q] += share * (random - positions[:, simulation._q])
    touch = []
    for qpos in positions:
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        touch.append(data.ncon > 0)
    with wp.ScopedDevice("cpu"):
        on_warp, state = put_models([model] * count)
        state.qpos.assign(positions)
        mjw.kinematics(on_warp, state)
        touching = wp.zeros(count, dtype=int)
        look_for_contacts(on_warp, state, touching)
    seen = touching.numpy() != 0
    assert 20 < sum(touch) < count - 20
    assert not np.any(touch & ~seen)
    # What is close counts too, but few of those.
    assert np.sum(seen & ~np.array(touch)) < 0.1 * count


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["grasp.friction=0.5"], "grasp.friction"),
        (["sheet.model={kind='shell'}"], "MuJoCo Warp cannot simulate this cell"),
    ],
)
def test_what_warp_cannot_do_is_refused(settings: list[str], said: str) -> None:
    run = make_run(load_scenario("fig8", settings))
    with pytest.raises(InputError, match=said):
        WarpPhysics([run.cell], "cpu")


def test_a_device_that_is_not_there_is_refused() -> None:
    with pytest.raises(InputError, match=r"cuda:99.*only cpu"):
        WarpPhysics([begun().cell], "cuda:99")


def test_closed_loops_of_many_worlds_follow_those_of_the_cpu() -> None:
    """Measured, single precision: the moments at the end of a short bend, of two worlds."""
    short = (*QUICK, "motion.speed_rad_per_s=0.8", "motion.settle_s=0.1", "motion.hold_s=0.0")
    cases = [("imperfections=none", "seed=1"), ("imperfections=none", "seed=2")]

    def peaks(**how: str) -> list[float]:
        runs = [make_run(load_scenario("fig8", [*short, *case])) for case in cases]
        records = dict(run_many(runs, **how))
        assert {record.outcome for record in records.values()} == {"completed"}
        return [float(np.abs(records[i].trace["left_true_moment_y"]).max()) for i in range(2)]

    assert peaks(device="cpu") == pytest.approx(peaks(), rel=5e-3)
