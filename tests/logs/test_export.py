"""Poses and wrenches of an exported run are those of its trace, in the frames that they name."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dualbend import load_scenario, make_run
from dualbend.logs.export import grip_poses, nominal_poses
from dualbend.run.record import RunRecord
from dualbend.scene.observation import BENDING_TO_WORLD, Observation
from dualbend.types import SIDES
from support.short_bend import SHORT


@pytest.fixture(scope="module")
def axes() -> list[np.ndarray]:
    return []


@pytest.fixture(scope="module")
def run(axes: list[np.ndarray]) -> RunRecord:
    """A run of grips that are turned out of the plane, and their true axes in every cycle."""
    ready = make_run(load_scenario("fig8", SHORT))
    observe = ready.cell.simulation.observe

    def noted() -> Observation:
        seen = observe()
        axes.append(ready.cell.simulation.observer.grip_axes(ready.cell.simulation.data))
        return seen

    ready.cell.simulation.observe = noted  # type: ignore[method-assign]
    return ready.run()


def test_a_grips_pose_is_that_of_the_physics(run: RunRecord, axes: list[np.ndarray]) -> None:
    assert np.ptp(run["left_grip_yaw"]) > 1e-6
    true = np.array(axes)
    for i, side in enumerate(SIDES):
        pose = grip_poses(run, side)
        place = np.column_stack([run[f"{side}_grip_{axis}"] for axis in "xyz"])
        np.testing.assert_array_equal(pose[:, :3], place * BENDING_TO_WORLD[i])
        told = Rotation.from_quat(pose[:, 3:]).as_matrix()
        # The physics' grip of the right arm has its axes turned by π about z with its arm.
        np.testing.assert_allclose(told, true[: len(told), i], atol=1e-12)


def test_the_nominal_pose_of_the_right_arm_is_the_lefts_turned_about_the_vertical(
    run: RunRecord,
) -> None:
    left, right = (nominal_poses(run, side) for side in SIDES)
    half_turn = Rotation.from_rotvec([0.0, 0.0, np.pi])
    np.testing.assert_allclose(half_turn.apply(left[:, :3]), right[:, :3], atol=1e-15)
    turned = (half_turn * Rotation.from_quat(left[:, 3:])).as_matrix()
    np.testing.assert_allclose(turned, Rotation.from_quat(right[:, 3:]).as_matrix(), atol=1e-15)
