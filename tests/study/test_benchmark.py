"""The benchmark's bare steps go where the run went: its ratio is over the same trajectory."""

import mujoco

from dualbend.scenario.load import load_scenario
from dualbend.study.benchmark import benchmark
from support.strip import STRIP6

SHORT = (
    "motion.speed_rad_per_s=1.0",
    "path.end_rad=0.2",
    "motion.settle_s=0.1",
    "motion.hold_s=0.1",
    "sheet.model.hinges=10",
)


def test_bare_steps_repeat_every_cycle_of_a_run() -> None:
    """Exact but for rounding: with friction that follows the speed, and grips that bases displace.

    Without the one or the other in every fifth cycle the bare steps go elsewhere.
    """
    wrong = ("stiction_excess=0.5", "base_spread_m=1e-3", "zero_spread_rad=1e-3")
    keys = [f"imperfections.robot.{key}" for key in wrong]
    found = benchmark(load_scenario(STRIP6, [*SHORT, *keys]), 1)
    assert found["replayed"] == 1.0
    ratios = ("over_mj_step", "over_mj_step_at_rest", "over_perfect_cell", "cycle_us")
    assert all(float(found[name]) > 0.0 for name in ratios)
    assert f"mujoco {mujoco.__version__}" in str(found["versions"]) and int(str(found["cores"])) > 0
