"""The robots alone at joint angles, and set-points near known ones: one pair of arms and many."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dualbend.arm.pair import ArmPair, paper_pair
from dualbend.beam import elastica
from dualbend.control.alter import turn
from dualbend.control.controller import IN_PLANE
from dualbend.scene.believed import GRIPS, SITES
from dualbend.scene.cell import CellConfig, robots_only, without_looks
from dualbend.scene.correction import PoseCorrection
from dualbend.scene.ik import IKSolution, InverseKinematics, grip_targets
from dualbend.scene.posed import PosedArms, PosedWorlds
from dualbend.scene.setpoints import nominal_setpoints
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


def test_no_grip_is_farther_from_a_joint_than_the_reach(model: mujoco.MjModel) -> None:
    """From the joints' axes' anchors at any angles; the arm stretched out is nearly as long."""
    posed, data, rng = PosedArms(model, GRIPS), mujoco.MjData(model), np.random.default_rng(4)
    farthest = 0.0
    for _ in range(300):
        data.qpos[:] = rng.uniform(-np.pi, np.pi, model.nq)
        mujoco.mj_kinematics(model, data)
        for name, own in zip(GRIPS, (slice(0, 6), slice(6, 12)), strict=True):
            off = data.site(name).xpos - data.xanchor[own]
            farthest = max(farthest, np.linalg.norm(off, axis=1).max())
    assert 0.85 * posed.reach < farthest <= posed.reach
    worlds = PosedWorlds([model, robots(0.1)], GRIPS)
    np.testing.assert_allclose(worlds.reach, posed.reach, rtol=1e-12)


def test_a_slide_reaches_as_far_as_it_travels() -> None:
    """Two arms of a slide from -0.5 to 2 m and five hinges, 0.1 m apart."""
    chain = '<body pos="0.1 0 0"><joint {}/><geom size="0.01"/>'
    slide = chain.format('type="slide" axis="1 0 0" range="-0.5 2"')
    links = slide + 5 * chain.format('range="-3 3"')
    arms = [links + f'<site name="{name}"/>' + 6 * "</body>" for name in GRIPS]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><worldbody>{"".join(arms)}</worldbody></mujoco>'
    )
    # Analytic: stretched out, the grip is the slide's travel and five links from its anchor.
    assert PosedArms(model, GRIPS).reach == pytest.approx(2.0 + 5 * 0.1)


PERIOD_S, CYCLES = 0.028, 100


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return robots()


@pytest.fixture(scope="module")
def motion(model: mujoco.MjModel) -> tuple[Vector, Vector]:
    """Return poses (cycles, 3) of bending at 0.1 rad/s, and their angles by mink."""
    alpha, length_m, ik = 0.1 + 0.1 * PERIOD_S * np.arange(CYCLES), 0.4, InverseKinematics(model)
    height = CellConfig().sheet_height_m + elastica.rise(alpha, length_m)
    poses = np.column_stack((-elastica.half_distance(alpha, length_m), height, alpha))
    first = ik.solve_from_home(grip_targets(np.stack((poses[0], poses[0]))), HOME).q
    return poses, nominal_setpoints(ik, poses, first, PERIOD_S)


def follow(near: PoseCorrection, poses: Vector, aside: Vector, start: Vector) -> list[IKSolution]:
    """Return the solutions of poses (cycles, ..., 2, 3), each from the one before."""
    found: list[IKSolution] = []
    for pose in poses:
        found.append(near.solve(pose, aside, found[-1].q if found else start))
    return found


@pytest.mark.parametrize("out_of_plane", [0.0, 1e-3])
def test_a_set_point_misses_its_pose_by_no_more_than_it_tells(
    model: mujoco.MjModel, motion: tuple[Vector, Vector], out_of_plane: float
) -> None:
    """Deviations that jump by 1e-9 to 0.03 m and rad in a cycle; to rounding."""
    rng, truly = np.random.default_rng(1), PosedArms(model, GRIPS)
    poses, angles = motion
    near = PoseCorrection(model, PosedArms(model, GRIPS))
    sizes = np.logspace(-9, -1.5, CYCLES)[:, np.newaxis, np.newaxis]
    commanded = poses[:, np.newaxis] + sizes * rng.uniform(-1.0, 1.0, (CYCLES, 2, 3))
    aside = rng.uniform(-out_of_plane, out_of_plane, (2, 3))
    signs = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])
    for pose, found in zip(commanded, follow(near, commanded, aside, angles[0]), strict=True):
        told = found.position_residual_m, found.rotation_residual_rad
        assert max(told) <= 1e-10
        places, axes = truly.frames(found.q)
        wanted = signs * np.stack((pose[:, 0], aside[:, 0], pose[:, 1]), axis=-1)
        assert np.abs(places - wanted).max() <= told[0] + 1e-15
        wanted = turn(np.stack((aside[:, 1], pose[:, 2], aside[:, 2]), axis=-1))
        wanted *= signs[:, :, np.newaxis]
        assert np.abs(axes.reshape(2, 3, 3) - wanted).max() <= told[1] + 2e-15


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_a_turn_is_not_taken_for_none(
    model: mujoco.MjModel, motion: tuple[Vector, Vector], axis: int
) -> None:
    """The sine of π is 0: arms that are to turn their grips by it must not stay and be there."""
    pose, turned = np.repeat(motion[0][:1], 2, axis=0), np.zeros((2, 3))
    pose[:, 2] += np.pi * (axis == 1)
    turned[:, 1:] += np.pi * np.array([axis == 0, axis == 2])
    found = PoseCorrection(model, PosedArms(model, GRIPS)).solve(pose, turned, motion[1][0])
    assert not found.reached
    assert found.rotation_residual_rad == np.inf


class Counted(PosedArms):
    """Counts how often its arms are placed."""

    placed = 0

    def frames(self, q: Vector) -> tuple[Vector, Vector]:
        self.placed += 1
        return super().frames(q)


def test_arms_that_comply_steadily_are_placed_once_a_cycle(
    model: mujoco.MjModel, motion: tuple[Vector, Vector]
) -> None:
    """A deviation of 5 mm and 15 mrad that swings at 0.25 Hz while the nominal pose moves."""
    poses, angles = motion
    times_s = PERIOD_S * np.arange(CYCLES)
    swings = np.sin(0.5 * np.pi * times_s[:, np.newaxis]) * [0.005, 0.005, 0.015]
    commanded = np.repeat((poses + swings)[:, np.newaxis], 2, axis=1)
    posed = Counted(model, GRIPS)
    found = follow(PoseCorrection(model, posed), commanded, IN_PLANE, angles[0])
    assert all(solution.reached for solution in found)
    assert posed.placed <= 1.1 * CYCLES


def test_nothing_is_remembered_where_the_arms_were_sent_elsewhere(
    model: mujoco.MjModel, motion: tuple[Vector, Vector]
) -> None:
    """To the bit: mink, a stop or a new run may have found other last angles."""
    (poses, angles), rng = motion, np.random.default_rng(3)
    near, fresh = (PoseCorrection(model, PosedArms(model, GRIPS)) for _ in range(2))
    commanded = poses[:, np.newaxis] + rng.uniform(-1e-2, 1e-2, (CYCLES, 2, 3))
    follow(near, commanded[:50], IN_PLANE, angles[0])
    for one, other in zip(
        follow(near, commanded, IN_PLANE, angles[0]),
        follow(fresh, commanded, IN_PLANE, angles[0]),
        strict=True,
    ):
        np.testing.assert_array_equal(one.q, other.q)


def test_after_a_jump_arms_that_stay_are_sought_where_they_are(
    model: mujoco.MjModel, motion: tuple[Vector, Vector]
) -> None:
    """Sought where the jump's miss leads to, a UR's wrist flips in 1 % of jumps by 0.05 m."""
    near, pose = PoseCorrection(model, PosedArms(model, GRIPS)), motion[0][[0, 0]]
    there = near.solve(pose, IN_PLANE, motion[1][0])
    jumped = near.solve(pose + 0.1, IN_PLANE, there.q)
    assert jumped.reached
    assert near.solve(pose + 0.1, IN_PLANE, jumped.q).iterations == 1 < jumped.iterations


def test_a_set_point_alone_is_the_one_among_many(
    model: mujoco.MjModel, motion: tuple[Vector, Vector]
) -> None:
    """To the bit: near and far, at the joints' limits, out of reach, singular, without a pose."""
    rng, cycles = np.random.default_rng(2), 4
    starts = np.repeat([motion[1][0], model.jnt_range[:, 0], 0.0 * HOME], 40, axis=0)
    far = np.tile(np.logspace(-12, 0.3, 40), 3)[:, np.newaxis, np.newaxis]
    shape = cycles, len(starts), 2, 3
    commanded = motion[0][:cycles, np.newaxis, np.newaxis] + far * rng.uniform(-1.0, 1.0, shape)
    commanded[1, 3], commanded[2, 5, 1] = 50.0, np.nan
    many = PosedWorlds([model] * len(starts), GRIPS)
    together = follow(PoseCorrection(model, many), commanded, np.zeros(shape[1:]), starts)
    for i, start in enumerate(starts):
        alone = PoseCorrection(model, PosedArms(model, GRIPS))
        for one, all_ in zip(
            follow(alone, commanded[:, i], IN_PLANE, start), together, strict=True
        ):
            for name in ("q", "position_residual_m", "rotation_residual_rad", "iterations"):
                np.testing.assert_array_equal(getattr(one, name), getattr(all_, name)[i])
    reached = np.array([solution.reached for solution in together])
    assert 0 < np.count_nonzero(reached) < reached.size
    assert max(solution.iterations.max() for solution in together) > 3
