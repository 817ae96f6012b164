"""The robots alone at joint angles, and set-points near known ones: one pair of arms and many."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dualbend.arm.pair import ArmPair, paper_pair
from dualbend.scene.believed import GRIPS, SITES
from dualbend.scene.cell import robots_only, without_looks
from dualbend.scene.correction import PoseCorrection
from dualbend.scene.posed import PosedArms, PosedWorlds
from dualbend.types import Vector

Frames = tuple[Vector, Vector]
PUMA = paper_pair().left
HOME = paper_pair().home


def robots(nearer_m: float = 0.0) -> mujoco.MjModel:
    placement = PUMA.placement
    moved = replace(placement, base_distance_m=placement.base_distance_m - nearer_m)
    arm = replace(PUMA, placement=moved)
    return without_looks(robots_only(ArmPair(left=arm, right=arm))).compile()


def assert_same(found: Frames, wanted: list[Frames]) -> None:
    for of_all, of_each in zip(found, zip(*wanted, strict=True), strict=True):
        np.testing.assert_array_equal(of_all, of_each)


@pytest.mark.parametrize("threads", [1, 2])
def test_worlds_are_placed_as_each_is_alone(threads: int) -> None:
    """To the bit: frames, MuJoCo's own Jacobians and Coriolis torques, whoever has moved."""
    models = [robots(0.01 * i) for i in range(3)]
    worlds, alone = PosedWorlds(models, SITES, threads), [PosedArms(m, SITES) for m in models]
    rng = np.random.default_rng(0)
    q, speed = np.tile(HOME, (3, 1)), rng.uniform(-1.0, 1.0, (3, len(HOME)))
    for moving in ([0, 1, 2], [1], [0, 2], []):
        q[moving] += rng.uniform(-0.3, 0.3, (len(moving), len(HOME)))
        assert_same(worlds.frames(q), [one.frames(own) for one, own in zip(alone, q, strict=True)])
        np.testing.assert_array_equal(worlds.jacobian(), [one.jacobian() for one in alone])
        torques = [one.coriolis(*of) for one, *of in zip(alone, q, speed, strict=True)]
        np.testing.assert_array_equal(worlds.coriolis(q, speed), torques)
        # Where it moves the arms itself, the frames come with the torques.
        q[moving] += 0.1
        torques = [one.coriolis(*of) for one, *of in zip(alone, q, speed, strict=True)]
        np.testing.assert_array_equal(worlds.coriolis(q, speed), torques)
        assert_same(worlds.frames(q), [one.frames(own) for one, own in zip(alone, q, strict=True)])


def test_a_set_point_misses_its_pose_by_no_more_than_it_tells() -> None:
    """Targets of known angles, from 1e-9 to 0.1 rad away; to rounding."""
    model, rng = robots(), np.random.default_rng(1)
    near, truly = PoseCorrection(model, PosedArms(model, GRIPS)), PosedArms(model, GRIPS)
    for far in np.logspace(-9, -1, 200):
        places, axes = truly.frames(HOME + rng.uniform(-far, far, len(HOME)))
        found = near.solve(places, axes.reshape(2, 3, 3), HOME)
        told = found.position_residual_m, found.rotation_residual_rad
        assert max(told) <= 1e-10
        there, turned = truly.frames(found.q)
        assert np.abs(there - places).max() <= told[0] + 1e-15
        assert np.abs(turned - axes).max() <= told[1] + 2e-15


def test_a_set_point_alone_is_the_one_among_many() -> None:
    """To the bit: near and far, at the joints' limits, out of reach, singular, without a pose."""
    model, rng = robots(), np.random.default_rng(2)
    far = np.logspace(-12, 0.3, 40)[:, np.newaxis]
    starts = np.concatenate(
        [np.tile(q, (40, 1)) for q in (HOME, model.jnt_range[:, 0], 0.0 * HOME)]
    )
    of_turns = rng.uniform(-1.0, 1.0, starts.shape) * np.tile(far, (3, 1))
    alone, many = PosedArms(model, GRIPS), PosedWorlds([model] * len(starts), GRIPS)
    places, axes = (part.copy() for part in many.frames(starts + of_turns))
    places[3], places[5, 1] = 50.0, np.nan
    axes = axes.reshape(-1, 2, 3, 3)
    together = PoseCorrection(model, many).solve(places, axes, starts)
    one = PoseCorrection(model, alone)
    for i, target in enumerate(zip(places, axes, starts, strict=True)):
        found = one.solve(*target)
        for name in ("q", "position_residual_m", "rotation_residual_rad", "iterations"):
            np.testing.assert_array_equal(getattr(found, name), getattr(together, name)[i])
    assert 0 < np.count_nonzero(together.reached) < len(starts)
    assert together.iterations.max() > 3
