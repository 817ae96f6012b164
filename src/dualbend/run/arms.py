"""A scenario's arms: which, and where they stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.run.scenario import Scenario
from dualbend.scene.arm_model import Placement, arm_model
from dualbend.scene.arm_pair import SIDES, ArmPair, PlacedArm, Side
from dualbend.scene.cell import PlacementConfig

Vector = NDArray[np.float64]

_KEYS = ("base_distance_m", "base_lateral_m", "base_height_m", "base_yaw_rad", "home_rad")


def arm_pair(scenario: Scenario) -> ArmPair:
    """Return both arms on their stands: as given by hand, else as documented for the arm."""
    left, right = (_placed(scenario, side) for side in SIDES)
    return ArmPair(left=left, right=right)


def _placed(scenario: Scenario, side: Side) -> PlacedArm:
    model, given = arm_model(scenario.arm.of(side)), _by_hand(scenario, side)
    assert model.placement is not None
    return PlacedArm(model=model, placement=Placement(**{**vars(model.placement), **given}))


def _by_hand(scenario: Scenario, side: Side) -> dict[str, float | tuple[float, ...]]:
    """Return what the scenario says of one side's place, its own keys before those of both."""
    cell = scenario.cell
    own = (cell.left if side == "left" else cell.right) or PlacementConfig()
    found = {}
    for key in _KEYS:
        value = getattr(own, key)
        value = getattr(cell, key) if value is None else value
        if value is not None:
            found[key] = value
    return found


def joint_stiffness(scenario: Scenario) -> Vector:
    """Return the stiffness of all joints' servos (n,) [N m/rad]: as given, else each arm's own."""
    given = scenario.servo.stiffness_n_m_per_rad
    models = [arm_model(scenario.arm.of(side)) for side in SIDES]
    return np.concatenate([m.stiffness_n_m_per_rad if given is None else given for m in models])


def one_kind(arms: ArmPair, what: str) -> ArmPair:
    """Return the arms if they are alike.

    Raises
    ------
    InputError
        They are not, and what is computed of one arm would not be true of the other.
    """
    if not arms.alike:
        raise InputError(
            f"{what} is computed of one arm and needs two of a kind that stand alike, not "
            f"{arms.left.model.name} on the left and {arms.right.model.name} on the right"
        )
    return arms


def shown_placements(scenario: Scenario) -> str:
    """Return the keys of the arms' places with their values, for a message."""
    arms = arm_pair(scenario)
    sides = [("cell", arms.left)]
    if not arms.alike:
        sides = [("cell.left", arms.left), ("cell.right", arms.right)]
    return ", ".join(
        f"{key}.{name} = {getattr(placed.placement, name):g}"
        for key, placed in sides
        for name in ("base_distance_m", "base_lateral_m", "base_height_m")
    )
