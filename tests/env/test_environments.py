"""The environments: what their checkers say, seeds, bounds, ends, the run beneath."""

import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from pettingzoo.test import parallel_api_test

from dualbend import InputError, parallel_env
from dualbend.env.assemble import AssembleEnv
from dualbend.env.base import SENSING
from dualbend.env.bend import BendEnv
from dualbend.env.worlds import BendWorlds
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HOLES
from dualbend.types import Vector
from support.small_runs import never

SHORT = (*SENSING, "motion.speed_rad_per_s=1.0", "path.end_rad=0.3", "motion.hold_s=0.1")
BEND, ASSEMBLE = "dualbend.env:dualbend/Bend-v1", "dualbend.env:dualbend/Assemble-v1"


def episode(env: Any, seed: int | None, action: Vector) -> tuple[list[float], dict[str, Any]]:
    env.reset(seed=seed)
    rewards, ended = list[float](), False
    while not ended:
        seen, reward, ended, truncated, info = env.step(action)
        assert env.observation_space.contains(seen)
        assert not truncated
        rewards.append(reward)
    return rewards, info


@pytest.mark.parametrize(("name", "settings"), [(BEND, SHORT), (ASSEMBLE, ())])
def test_gymnasium_finds_nothing_to_say(name: str, settings: tuple[str, ...]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, settings=settings).unwrapped)


def test_pettingzoo_finds_nothing_to_say_of_the_arms() -> None:
    env = parallel_env(settings=SHORT)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(env, num_cycles=100)
    env.close()


def test_without_deviation_it_is_the_run_without_compliance() -> None:
    """Fig. 6's scenario complies with nothing: its own run has the same moments."""
    env = BendEnv(settings=SHORT)
    rewards, info = episode(env, 5, np.zeros(6))
    result = make_run(load_scenario("fig6", SHORT, seed=5)).run()
    assert info["outcome"] == result.outcome == "completed"
    assert info["metrics"]["peak_moment"] == result.metrics["peak_moment"].value
    moments = np.array([result[f"{side}_true_moment_y"] for side in ("left", "right")])
    rows = np.minimum(np.arange(1, len(rewards) + 1), len(rewards) - 1)
    expected = -0.5 * np.sum((moments[:, rows] / env.moment_scale_nm) ** 2, axis=0)
    np.testing.assert_allclose(rewards, expected, rtol=1e-12)


def test_episodes_follow_from_the_first_seed() -> None:
    one, other = BendEnv(settings=SHORT), BendEnv(settings=SHORT)
    for seed in (7, None, None):
        np.testing.assert_array_equal(one.reset(seed=seed)[0], other.reset(seed=seed)[0])
        assert one.cell.scenario.seed == other.cell.scenario.seed
    assert one.cell.scenario.seed != 7


def test_an_action_out_of_the_space_is_brought_into_it() -> None:
    env = BendEnv(settings=SHORT)
    env.reset(seed=1)
    env.step(np.full(6, 9.0))
    deviation = [env.cell.trace[f"left_deviation_{name}"][0] for name in ("x", "alpha")]
    assert deviation == [env.action_space.high[0], env.action_space.high[2]]


def test_a_run_that_is_not_completed_costs() -> None:
    env = BendEnv(settings=(*SHORT, "imperfections.events.arm_stop.at_s=0.392"))
    rewards, info = episode(env, 1, np.zeros(6))
    assert info["outcome"] == "protective_stop"
    assert "the left arm stops" in info["reason"]
    assert rewards[-1] < -env.failure_cost < min(rewards[:-1])
    arms = parallel_env(settings=(*SHORT, "imperfections.events.arm_stop.at_s=0.392"))
    arms.reset(seed=1)
    while arms.agents:
        _, paid, *_ = arms.step({side: np.zeros(3) for side in arms.agents})
    assert max(paid.values()) < -env.failure_cost


def test_each_arm_sees_itself_and_is_paid_for_itself() -> None:
    arms, bend = parallel_env(settings=SHORT), BendEnv(settings=SHORT)
    seen, _ = arms.reset(seed=2)
    both, _ = bend.reset(seed=2)
    action = np.array([1e-4, 0.0, 0.02, 0.0, 0.0, 0.0])
    for _ in range(30):
        np.testing.assert_array_equal(seen["left"], both[[*range(6), 12, 13]])
        np.testing.assert_array_equal(seen["right"], both[[*range(6, 12), 12, 13]])
        seen, rewards, *_ = arms.step({"left": action[:3], "right": action[3:]})
        both, reward, *_ = bend.step(action)
        assert sum(rewards.values()) / 2 == pytest.approx(reward, rel=1e-12)
    assert rewards["left"] != rewards["right"]


def test_an_arm_without_a_sensor_reads_zero() -> None:
    env = BendEnv("fig6", SHORT[1:])
    seen, _ = env.reset(seed=1)
    assert seen[:3].all()
    assert not seen[6:9].any()


def test_another_task_is_refused() -> None:
    with pytest.raises(InputError, match="'pwb': dualbend/Bend-v1 needs a bending"):
        BendEnv("pwb")
    with pytest.raises(InputError, match="'fig6': dualbend/Assemble-v1 needs an assembly"):
        AssembleEnv("fig6")


@pytest.mark.slow
def test_without_deviation_the_sheet_is_laid_as_in_the_run() -> None:
    env = AssembleEnv()
    rewards, info = episode(env, 1, np.zeros(6))
    result = make_run(load_scenario("pwb")).run()
    assert (info["outcome"], info["laid"]) == ("completed", 1)
    assert info["metrics"]["peak_pin_force"] == result.metrics["peak_pin_force"].value
    forces = np.max([result[f"pin_force_{hole}"] for hole in HOLES], axis=0)
    cost = np.sum((forces[1:] / 40.0) ** 2) + (forces[-1] / 40.0) ** 2
    assert sum(rewards) == pytest.approx(env.laid_reward - cost, rel=1e-9)


@pytest.mark.parametrize("library", ["gymnasium", "pettingzoo"])
def test_without_the_extra_the_message_names_it(
    library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    for name in ("dualbend/Bend-v1", "dualbend/Assemble-v1"):
        monkeypatch.delitem(gymnasium.registry, name)
    for name in [name for name in sys.modules if name.startswith("dualbend.env")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(InputError, match=r"pip install 'dualbend\[env\]'"):
        __import__("dualbend.env.arms")


def assert_same(found: Any, wanted: Any) -> None:
    """Compare what a step returns, bit for bit but for the clocks on the wall."""
    if isinstance(wanted, dict):
        assert found.keys() == wanted.keys()
        for key in found.keys() - {"wall_time", "realtime_factor", "t"}:
            assert_same(found[key], wanted[key])
    elif isinstance(wanted, tuple):
        for one, other in zip(found, wanted, strict=True):
            assert_same(one, other)
    else:
        np.testing.assert_array_equal(found, wanted)


def test_worlds_are_environments_of_their_own_that_end_and_begin_anew_by_themselves() -> None:
    """Golden to the bit, Gymnasium's own vector of environments, to its statistics.

    Worlds 0 and 1 are reset on the way. Then 0 goes to its end, 1 stops early and begins alone,
    and 2 and 3 are twins that stop and begin together.
    """
    settings = (*SHORT, "sheet.model.hinges=4", "motion.settle_s=0.3")
    mode = "vector_entry_point"
    both = [
        RecordEpisodeStatistics(env)
        for env in (
            gymnasium.make_vec(BEND, 4, vectorization_mode=mode, settings=settings),
            SyncVectorEnv([lambda: BendEnv(settings=settings)] * 4),
        )
    ]
    assert_same(*(env.reset(seed=[7, 8, 9, 9]) for env in both))
    rng = np.random.default_rng(3)
    ends: list[list[int]] = [[], [], [], []]
    ended = np.zeros(4, dtype=bool)
    for step in range(60):
        action = rng.uniform(-1.0, 1.0, (4, 6)) * np.array([1e-4, 1e-4, 0.01] * 2)
        action[1, [2, 5]] = 0.1 * (-1.0) ** step
        action[3] = action[2] = action[1] if step > 5 else action[2]
        action[ended] = np.nan  # of no meaning while a world begins
        found, wanted = (env.step(action) for env in both)
        assert_same(found, wanted)
        ended = found[2]
        assert both[0].observation_space.contains(found[0])
        for world in np.flatnonzero(ended):
            ends[world].append(step)
        if step == 12:
            mask = {"reset_mask": np.array([True, True, False, False])}
            seeds: list[int | None] = [3, None, None, None]
            assert_same(*(env.unwrapped.reset(seed=seeds, options=dict(mask)) for env in both))
    assert [len(each) for each in ends] == [1, 2, 2, 2]
    assert ends[2] == ends[3]
    assert not {*ends[1]} & {*ends[0], *ends[2]}


def test_worlds_that_begin_together_are_stepped_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BendEnv, "step", never)
    worlds = BendWorlds(2, settings=SHORT)
    worlds.reset(seed=1)
    assert np.isfinite(worlds.step(np.zeros((2, 6)))[1]).all()


def test_worlds_whose_runs_can_be_no_batch_are_stepped_one_by_one() -> None:
    settings = (*SHORT, "imperfections.events.arm_stop.at_s=0.05")
    worlds = BendWorlds(2, settings=settings)
    worlds.reset(seed=1)
    ended = np.zeros(2, dtype=bool)
    while not ended.all():
        *_, ended, _, infos = worlds.step(np.zeros((2, 6)))
    assert infos["outcome"].tolist() == ["protective_stop"] * 2


def test_worlds_that_are_asked_wrongly_say_what_is_right() -> None:
    for wrong in ({"num_envs": 0}, {"num_envs": 2, "threads": -1}):
        with pytest.raises(InputError, match="at least 1"):
            BendWorlds(settings=SHORT, **wrong)
    worlds = BendWorlds(2, settings=SHORT)
    with pytest.raises(InputError, match="reset first"):
        worlds.step(np.zeros((2, 6)))
    with pytest.raises(InputError, match="1 of them for 2"):
        worlds.reset(seed=[1])
    for mask in ([True], [False, False], [1, 0]):
        with pytest.raises(InputError, match="reset_mask: need 2 truth values"):
            worlds.reset(options={"reset_mask": np.array(mask)})
    worlds.reset(seed=1)
    with pytest.raises(InputError, match="finite"):
        worlds.step(np.full((2, 6), np.nan))
    with pytest.raises(gymnasium.error.Error, match="Seed"):
        worlds.reset(seed=[1, -1])
    times = [worlds.step(np.zeros((2, 6)))[0][:, -1] for _ in range(2)]
    assert (times[1] > times[0]).all()  # they go on
