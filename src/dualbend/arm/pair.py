"""The two arms of a cell, each a model and the place where it stands; they may differ."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.arm.model import PUMA, ArmModel, Placement, arm_model
from dualbend.types import SIDES, Side, Vector


@dataclass(frozen=True, kw_only=True)
class PlacedArm:
    """A kind of arm and where one of them stands, in its own bending frame."""

    model: ArmModel
    placement: Placement


@dataclass(frozen=True, kw_only=True)
class ArmPair:
    """Both arms. Vectors over all joints have the left arm's first, base to flange, then the right.

    The right arm's bending frame is the left's turned by π about the vertical through the middle of
    the cell, so arms of one kind on equal stands are each other's image by that turn.
    """

    left: PlacedArm
    right: PlacedArm

    def __iter__(self) -> Iterator[PlacedArm]:
        return iter((self.left, self.right))

    @property
    def count(self) -> int:
        """Number of joints of both arms."""
        return self.left.model.count + self.right.model.count

    @property
    def alike(self) -> bool:
        """One kind of arm on equal stands: what is true of one is true of the other."""
        return self.left == self.right

    def joints(self, side: Side) -> slice:
        """Return where one arm's joints are among all."""
        first = self.left.model.count
        return slice(0, first) if side == "left" else slice(first, self.count)

    @property
    def home(self) -> Vector:
        """Joint angles (n,) near the start of the work [rad]."""
        return np.concatenate([arm.placement.home_rad for arm in self])

    @property
    def speed_limit(self) -> Vector:
        """Speed limits (n,) of all joints [rad/s]."""
        return np.concatenate([arm.model.speed_limit_rad_per_s for arm in self])

    @property
    def stiffness(self) -> Vector:
        """Default stiffness (n,) of the joints' servos [N m/rad]."""
        return np.concatenate([arm.model.stiffness_n_m_per_rad for arm in self])

    @property
    def slides(self) -> dict[str, bool]:
        """Which of all joints are slides, by their names in the scene, such as ``left_joint1``."""
        return {
            f"{side}_{joint}": slides
            for side, arm in zip(SIDES, self, strict=True)
            for joint, slides in arm.model.scene_slides.items()
        }

    def of(self, side: Side) -> PlacedArm:
        """Return the arm of one side."""
        return self.left if side == "left" else self.right

    def base_pose(self, side: Side) -> tuple[Vector, Vector]:
        """Return the base frame's origin (3,) [m] and its quaternion (4,) in the world."""
        stand = self.of(side).placement
        sign, turn = (1.0, 0.0) if side == "left" else (-1.0, np.pi)
        aside = [-sign * stand.base_distance_m, sign * stand.base_lateral_m]
        return np.array([*aside, stand.base_height_m]), stand.quat(turn)


def paper_pair() -> ArmPair:
    """Return the paper's arms, two PUMA 560, on their documented stands."""
    model = arm_model(PUMA)
    assert model.placement is not None
    placed = PlacedArm(model=model, placement=model.placement)
    return ArmPair(left=placed, right=placed)


def arm_joints(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the arms' joints in a compiled scene, left then right."""
    names = [model.joint(i).name for i in range(model.njnt)]
    arms = [[name for name in names if re.fullmatch(rf"{side}_joint\d+", name)] for side in SIDES]
    return (*arms[0], *arms[1])
