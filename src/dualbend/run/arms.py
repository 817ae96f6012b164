"""A scenario's arms: which, and where they stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from dualbend.arm.model import ArmModel, Placement, arm_model
from dualbend.arm.pair import ArmPair, PlacedArm
from dualbend.arm.placement import find_placement
from dualbend.errors import InputError, refusing
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sections import RobotConfig, refuse_other_count
from dualbend.scene.cell import PlacementConfig
from dualbend.types import SIDES, Side, Vector

_FEWEST = 12
"""Poses for which a place is found: a path of few knots has as many of them in between."""

_KEYS = ("base_distance_m", "base_lateral_m", "base_height_m", "base_yaw_rad", "home_rad")
_TILTS = ("base_roll_rad", "base_pitch_rad")


def arm_pair(scenario: Scenario, targets: Mapping[Side, Vector] | None = None) -> ArmPair:
    """Return both arms where they stand: as given by hand, as documented for the arm, or as found.

    Found for the grip poses ``targets`` (k, 4, 4) of each arm in its bending frame, by default
    those of the scenario's path.

    Raises
    ------
    InputError
        An arm has no place from which it does its work; the package with its files is missing.
    """
    left, right = (_placed(scenario, side, targets) for side in SIDES)
    return ArmPair(left=left, right=right)


def side_arm(scenario: Scenario, side: Side) -> ArmModel:
    """Return one side's arm, from its name or its file.

    Raises InputError where the file lacks something, or a list of the scenario has not one value
    per joint.
    """
    robot = scenario.robot
    with refusing(f"scenario {scenario.name!r}, {side} arm"):
        model = arm_model(robot.of(side), robot.facts(side))
    errors = scenario.imperfections.robot
    refuse_other_count(side, model.name, model.count, robot, scenario.cell, errors)
    return model


def _placed(scenario: Scenario, side: Side, targets: Mapping[Side, Vector] | None) -> PlacedArm:
    model, given = side_arm(scenario, side), _by_hand(scenario, side)
    if "home_rad" in given:
        own = getattr(scenario.cell, side)
        mine = own is not None and own.home_rad is not None
        _refuse_home(model, given["home_rad"], f"cell.{side}.home_rad" if mine else "cell.home_rad")
    if model.placement is not None:
        given = {**vars(model.placement), **given}
    if all(key in given for key in _KEYS):
        return PlacedArm(model=model, placement=Placement(**given))
    with refusing(f"scenario {scenario.name!r}, {side} arm"):
        wanted = path_targets(scenario) if targets is None else targets[side]
        return PlacedArm(model=model, placement=find_placement(model, wanted, given))


def _refuse_home(model: ArmModel, home_rad: tuple[float, ...], key: str) -> None:
    """Raise InputError where a joint of the home pose is outside its range."""
    home, (low, high) = np.array(home_rad), np.transpose(model.range_rad)
    outside = np.flatnonzero((home < low) | (home > high))
    if len(outside) == 0:
        return
    i = int(outside[0])
    turned = np.radians(home)
    hint = ""
    if np.any(np.abs(home) > 2.0 * np.pi) or np.all((low <= turned) & (turned <= high)):
        hint = f"; if these are degrees: {key} = {np.round(turned, 4).tolist()}"
    raise InputError(
        f"{key}[{i}] = {home[i]:g}: {model.joint_names[i]} of {model.name!r} goes from "
        f"{low[i]:.4g} to {high[i]:.4g} {'m' if model.slides[i] else 'rad'}{hint}"
    )


def path_targets(scenario: Scenario) -> Vector:
    """Return the grip poses (k, 4, 4) of the path's knots and of the middles between them.

    In the bending frame of either arm, origin on the floor in the mid-plane.
    """
    path = scenario.path.make(scenario.sheet.length_m)
    knots = np.linspace(path.knots[0], path.knots[-1], _FEWEST)
    if len(path.knots) > _FEWEST // 2:
        knots = path.knots[np.unique(np.linspace(0, len(path.knots) - 1, _FEWEST // 2).astype(int))]
        knots = np.sort(np.concatenate((knots, 0.5 * (knots[1:] + knots[:-1]))))
    half_distance, rise = path.at(knots)
    heights = scenario.cell.sheet_height_m + rise
    poses = np.tile(np.eye(4), (len(knots), 1, 1))
    c, s = np.cos(knots), np.sin(knots)
    poses[:, 0, 0], poses[:, 0, 2], poses[:, 2, 0], poses[:, 2, 2] = c, s, -s, c
    poses[:, 0, 3], poses[:, 2, 3] = -half_distance, heights
    return poses


def with_placements(scenario: Scenario, targets: Mapping[Side, Vector] | None = None) -> Scenario:
    """Return the scenario with both arms' places written into ``cell``: nothing is left to find."""
    arms = arm_pair(scenario, targets)
    left, right = (PlacementConfig(**_told(placed.placement)) for placed in arms)
    told: dict[str, Any] = dict.fromkeys((*_KEYS, *_TILTS, "left", "right"))
    if arms.alike:
        told |= {key: getattr(left, key) for key in (*_KEYS, *_TILTS)}
    else:
        told |= {"left": left, "right": right}
    cell = msgspec.structs.replace(scenario.cell, **told)
    return msgspec.structs.replace(scenario, cell=cell, robot=_with_sha256(scenario, arms))


def _told(placement: Placement) -> dict[str, Any]:
    """Return the keys of a place; a base that stands upright needs no tilt."""
    keys = vars(placement)
    return {key: value for key, value in keys.items() if value or key not in _TILTS}


def _with_sha256(scenario: Scenario, arms: ArmPair) -> RobotConfig:
    """Return the section with the SHA-256 of the arms' files, so that a changed one is noticed."""
    robot = scenario.robot
    for side, placed in zip(SIDES, arms, strict=True):
        file, own = placed.model.file, robot.own(side)
        if file is None or not file.sha256:
            continue
        facts = (own if own.model else robot).arm
        told = msgspec.structs.replace(facts, sha256=file.sha256)
        if own.model:
            robot = msgspec.structs.replace(robot, **{side: msgspec.structs.replace(own, arm=told)})
        else:
            robot = msgspec.structs.replace(robot, arm=told)
    return robot


def _by_hand(scenario: Scenario, side: Side) -> dict[str, Any]:
    """Return what the scenario says of one side's place, its own keys before those of both."""
    own = getattr(scenario.cell, side) or PlacementConfig()
    keys = (*_KEYS, *_TILTS)
    said = {key: (getattr(own, key), getattr(scenario.cell, key)) for key in keys}
    firsts = {k: both if mine is None else mine for k, (mine, both) in said.items()}
    return {key: value for key, value in firsts.items() if value is not None}


def joint_stiffness(scenario: Scenario) -> Vector:
    """Return the stiffness of all joints' servos (n,) [N m/rad]: as given, else each arm's own."""
    robot = scenario.robot
    given = [
        robot.stiffness_n_m_per_rad(side) or side_arm(scenario, side).stiffness_n_m_per_rad
        for side in SIDES
    ]
    return np.concatenate(given)


def one_kind(scenario: Scenario, what: str) -> ArmPair:
    """Return the arms; InputError where what is computed of one is not true of the other."""
    arms = arm_pair(scenario)
    if not scenario.robot.answer_alike:
        raise InputError(
            f"{what} is computed of one arm; robot.left and robot.right have another response or "
            "another delay_cycles each: give both the slower ones"
        )
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
