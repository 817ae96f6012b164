"""The two arms of a cell, each a model and the place where it stands; they may differ."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.arm.model import PUMA, ArmModel, Placement, arm_model
from dualbend.types import SIDES, Side, Vector

_ARM_JOINT = re.compile(rf"({'|'.join(SIDES)})_joint\d+")


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

    def base_pose(self, side: Side) -> tuple[Vector, float]:
        """Return the base frame's origin (3,) [m] in the world and its yaw [rad]."""
        placement = (self.left if side == "left" else self.right).placement
        sign, turn = (1.0, 0.0) if side == "left" else (-1.0, np.pi)
        place = np.array(
            [
                -sign * placement.base_distance_m,
                sign * placement.base_lateral_m,
                placement.base_height_m,
            ]
        )
        return place, turn + placement.base_yaw_rad


def paper_pair(base_distance_m: float | None = None) -> ArmPair:
    """Return the paper's arms, two PUMA 560, on their documented stands."""
    model = arm_model(PUMA)
    placement = model.placement
    assert placement is not None
    if base_distance_m is not None:
        placement = Placement(**{**vars(placement), "base_distance_m": base_distance_m})
    placed = PlacedArm(model=model, placement=placement)
    return ArmPair(left=placed, right=placed)


def arm_joints(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the arms' joints in a compiled scene, left then right."""
    names = [model.joint(i).name for i in range(model.njnt)]
    return tuple(name for side in SIDES for name in names if _side_of(name) == side)


def _side_of(name: str) -> str | None:
    match = _ARM_JOINT.fullmatch(name)
    return None if match is None else match.group(1)
