"""Inverse kinematics: what it solves is what the kinematics of the arms say."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.arm.model import scene_joints
from dualbend.arm.pair import ArmPair, paper_pair
from dualbend.beam import elastica
from dualbend.errors import InputError
from dualbend.scene.cell import CellConfig, robots_only
from dualbend.scene.ik import (
    TOLERANCE_M,
    TOLERANCE_RAD,
    InverseKinematics,
    Targets,
    grip_targets,
)
from dualbend.types import SIDES

Array = NDArray[np.float64]
CELL = CellConfig()
PUMA = paper_pair().left
NEARER = replace(PUMA, placement=replace(PUMA.placement, base_distance_m=0.975))
ARMS = ArmPair(left=NEARER, right=NEARER)
HOME_RAD = ARMS.home
LENGTH_M = 0.4


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return robots_only(ARMS).compile()


@pytest.fixture(scope="module")
def solver(model: mujoco.MjModel) -> InverseKinematics:
    return InverseKinematics(model)


def planar_pose(model: mujoco.MjModel, q: Array) -> Array:
    """Return x, y, z, α of both grips in their bending frames, by MuJoCo's own kinematics."""
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    rows = []
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        turn = np.diag([sign, sign, 1.0])
        site = data.site(f"{side}_{GRIP_SITE}")
        axes = turn @ site.xmat.reshape(3, 3)
        rows.append([*(turn @ site.xpos), math.atan2(-axes[2, 0], axes[0, 0])])
        # y_G stays on the bending axis: the pose is planar.
        np.testing.assert_allclose(axes[:, 1], [0.0, 1.0, 0.0], atol=1e-7)
    return np.array(rows)


def nominal(alpha: float) -> Array:
    x = -elastica.half_distance(alpha, LENGTH_M)
    pose = [x, CELL.sheet_height_m + elastica.rise(alpha, LENGTH_M), alpha]
    return np.array([pose, pose])


def targets_of(model: mujoco.MjModel, q: Array) -> Targets:
    """Return the poses of both grips at q as targets, through matrices of the kinematics."""
    import mink

    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    left, right = (
        mink.SE3.from_rotation_and_translation(
            mink.SO3.from_matrix(data.site(f"{side}_{GRIP_SITE}").xmat.reshape(3, 3)),
            data.site(f"{side}_{GRIP_SITE}").xpos.copy(),
        )
        for side in SIDES
    )
    return left, right


def test_the_model_is_the_twelve_joints_in_order(model: mujoco.MjModel) -> None:
    assert model.nq == model.nv == 12
    names = [model.joint(i).name for i in range(12)]
    assert names == [f"{side}_{joint}" for side in SIDES for joint in scene_joints(6)]


def test_the_targets_are_the_bending_frames_poses(
    model: mujoco.MjModel, solver: InverseKinematics
) -> None:
    pose = np.array([[-0.19, 0.69, 0.30], [-0.17, 0.70, 0.25]])  # the two differ: no mix-up
    solution = solver.solve_from_home(grip_targets(pose), HOME_RAD)
    found = planar_pose(model, solution.q)
    # Limited by the iteration's tolerance.
    np.testing.assert_allclose(found[:, [0, 2, 3]], pose, atol=3e-8)
    np.testing.assert_allclose(found[:, 1], 0.0, atol=3e-8)


def test_joint_angles_come_back_from_their_own_poses(
    model: mujoco.MjModel, solver: InverseKinematics
) -> None:
    rng = np.random.default_rng(1)
    home = solver.solve_from_home(grip_targets(nominal(0.3)), HOME_RAD).q
    for _ in range(30):
        wanted = home + rng.uniform(-0.25, 0.25, 12)
        solution = solver.solve(targets_of(model, wanted), home)
        assert solution.reached
        assert solution.position_residual_m <= TOLERANCE_M
        assert solution.rotation_residual_rad <= TOLERANCE_RAD
        # 12 equations of full rank in 12 unknowns: the branch next to the start is the only one.
        # Newton's last step leaves far less than the tolerance of 1e-7; times the inverse Jacobian.
        np.testing.assert_allclose(solution.q, wanted, atol=1e-6)


def test_the_reported_residual_is_the_true_one(
    model: mujoco.MjModel, solver: InverseKinematics
) -> None:
    """Stopped early, the residual is the pose error that the kinematics of its answer have."""
    start = solver.solve_from_home(grip_targets(nominal(0.1)), HOME_RAD).q
    solution = solver.solve(grip_targets(nominal(0.5)), start, max_iterations=0)
    assert not solution.reached
    assert solution.iterations == 0
    np.testing.assert_array_equal(solution.q, start)
    assert solution.rotation_residual_rad == pytest.approx(0.4, abs=1e-7)  # analytic


def test_newton_needs_few_iterations_along_a_path(solver: InverseKinematics) -> None:
    """With the prediction 2q − q₋, a 28 ms step at 0.1 rad/s takes two iterations at most."""
    q = previous = solver.solve_from_home(grip_targets(nominal(0.2)), HOME_RAD).q
    counts = []
    for k in range(1, 41):
        solution = solver.solve(grip_targets(nominal(0.2 + 0.0028 * k)), 2 * q - previous)
        assert solution.reached
        previous, q = q, solution.q
        counts.append(solution.iterations)
    assert max(counts[1:]) <= 2  # golden: Newton from an error of 1e-5


def test_the_path_is_continuous_and_symmetric(solver: InverseKinematics) -> None:
    q = solver.solve_from_home(grip_targets(nominal(0.0)), HOME_RAD).q
    alphas = np.linspace(0.0, 1.2, 61)
    steps = []
    for alpha in alphas[1:]:
        solution = solver.solve(grip_targets(nominal(float(alpha))), q)
        assert solution.reached
        steps.append(np.abs(solution.q - q).max())
        q = solution.q
        # Both arms see the same task in their own frames.
        np.testing.assert_allclose(q[:6], q[6:], atol=1e-7)
    # No jump to another branch: a step of 0.02 rad of bending turns no joint by more than 0.06 rad,
    # and no step is far above its neighbours (golden).
    assert max(steps) < 0.06
    assert np.abs(np.diff(steps)).max() < 0.005


def test_joint_limits_hold_on_the_way(model: mujoco.MjModel, solver: InverseKinematics) -> None:
    far = nominal(0.0)
    far[:, 0] -= 0.6  # behind the arms
    solution = solver.solve(grip_targets(far), HOME_RAD, max_iterations=50)
    assert not solution.reached
    low, high = model.jnt_range.T
    assert np.all(solution.q >= low - 1e-9)
    assert np.all(solution.q <= high + 1e-9)


@pytest.mark.parametrize(("shift", "axis"), [(-0.6, 0), (1.5, 1)])
def test_out_of_reach_is_refused_with_the_miss_and_the_limits(
    solver: InverseKinematics, shift: float, axis: int
) -> None:
    pose = nominal(0.1)
    pose[:, axis] += shift
    with pytest.raises(InputError, match=r"out of reach.* mm and .* degrees") as caught:
        solver.solve_from_home(grip_targets(pose), HOME_RAD)
    assert "at the limit of" in str(caught.value)
    assert any(
        f"{side}_{joint}" in str(caught.value) for side in SIDES for joint in scene_joints(6)
    )


def test_only_one_arm_out_of_reach_is_still_refused(solver: InverseKinematics) -> None:
    pose = nominal(0.1)
    pose[1, 0] -= 0.6
    with pytest.raises(InputError, match="out of reach") as caught:
        solver.solve_from_home(grip_targets(pose), HOME_RAD)
    assert "right_joint" in str(caught.value)
    assert "left_joint" not in str(caught.value)
