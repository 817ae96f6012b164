"""Sections of a scenario: robot, physics step, expected outcome."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec

from dualbend.arm.catalog import JOINT_COUNT, ArmName
from dualbend.control.alter import AlterConfig
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.response import CommandResponseConfig
from dualbend.control.servo import JointServoConfig, StiffnessConfig
from dualbend.errors import InputError
from dualbend.imperfection.robot import RobotErrors
from dualbend.scene.cell import CellConfig, PlacementConfig
from dualbend.types import SIDES, Config, Side, said

Outcome = Literal["completed", "aborted", "protective_stop", "failed"]


class SideConfig(Config):
    """What one arm has of its own; what is not given is as for both arms."""

    model: (
        Annotated[ArmName, said("kind of this arm, if another", extra={"replaces": ()})] | None
    ) = None
    servo: StiffnessConfig = StiffnessConfig()


class RobotConfig(Config):
    """Both arms: the PUMA 560, or one of those that the package example-robot-data describes."""

    model: Annotated[ArmName, said("kind of both arms", extra={"replaces": ()})] = "puma560"
    command_period_s: Annotated[
        float, said("one set-point in this time, to both arms [s]", ge=1e-3, le=0.05)
    ] = COMMAND_PERIOD_S
    left: SideConfig = SideConfig()
    right: SideConfig = SideConfig()
    response: CommandResponseConfig = CommandResponseConfig()
    servo: JointServoConfig = JointServoConfig()
    alter: AlterConfig = AlterConfig()

    def own(self, side: Side) -> SideConfig:
        """Return what one side has of its own."""
        return self.left if side == "left" else self.right

    def of(self, side: Side) -> ArmName:
        """Return the name of one side's arm."""
        return self.own(side).model or self.model

    def stiffness_n_m_per_rad(self, side: Side) -> tuple[float, ...] | None:
        """Return the stiffness of one side's joint servos [N m/rad]; None: the arm's own."""
        return self.own(side).servo.stiffness_n_m_per_rad or self.servo.stiffness_n_m_per_rad


def check_joint_counts(robot: RobotConfig, cell: CellConfig, errors: RobotErrors) -> None:
    """Raise InputError where a list has not one value per joint of the arm that it is of."""
    for side in SIDES:
        name, own = robot.of(side), robot.own(side).servo
        stand = (cell.left if side == "left" else cell.right) or cell
        for key, values in (
            (f"robot.{side}.servo.stiffness_n_m_per_rad", own.stiffness_n_m_per_rad),
            ("robot.servo.stiffness_n_m_per_rad", robot.stiffness_n_m_per_rad(side)),
            ("cell.home_rad", cell.home_rad),
            (f"cell.{side}.home_rad", stand.home_rad),
            ("imperfections.robot.zero_rad", errors.zero_rad),
        ):
            if values is not None and len(values) != JOINT_COUNT[name]:
                raise InputError(
                    f"{key} has {len(values)} values, the {side} arm {name!r} has "
                    f"{JOINT_COUNT[name]} joints"
                )


_PLACEMENT = tuple(field.encode_name for field in msgspec.structs.fields(PlacementConfig))


def without_other_arms(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario's tables ``base`` without what belongs to arms that ``over`` changes.

    Where a base stands, its home and its servos' stiffness belong to one kind of arm. Where one
    side keeps its arm, the place that stood for both stays for that side.
    """
    before, after = _table(base, "robot"), _table(over, "robot")
    changed = [s for s in SIDES if _model(s, before) != _model(s, after, before)]
    merged = dict(base)
    if not changed:
        return merged
    cell = dict(_table(base, "cell"))
    common = {key: cell.pop(key) for key in _PLACEMENT if key in cell}
    for side in SIDES:
        own = {**common, **_table(cell, side)}
        cell.pop(side, None)
        if side not in changed and own:
            cell[side] = own
    if cell or "cell" in base:
        merged["cell"] = cell
    robot: dict[str, Any] = {**before, "servo": _without_stiffness(before)}
    for side in changed:
        robot[side] = {**_table(before, side), "servo": _without_stiffness(_table(before, side))}
    merged["robot"] = robot
    return merged


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = data.get(key)
    return value if isinstance(value, dict) else {}


def _model(side: str, *robots: Mapping[str, Any]) -> object:
    """Return the name of a side's arm, the first table before the next; "none": as for both."""
    own = [_table(robot, side)["model"] for robot in robots if "model" in _table(robot, side)]
    both = [robot["model"] for robot in robots if "model" in robot]
    if own and own[0] not in ("none", None):
        return own[0]
    return both[0] if both else "puma560"


def _without_stiffness(table: Mapping[str, Any]) -> dict[str, Any]:
    servo = _table(table, "servo")
    return {key: value for key, value in servo.items() if key != "stiffness_n_m_per_rad"}


class PhysicsConfig(Config):
    """The physics step."""

    step_s: (
        Annotated[
            float,
            said(
                "of the integrator, divides the command period; none: the longest up to 1.75 ms",
                ge=1e-5,
                le=0.05,
            ),
        ]
        | None
    ) = None


class ExpectConfig(Config):
    """Outcomes that are no failure of the command: exit code 0."""

    outcome: Annotated[
        tuple[Outcome, ...], said("how the run may end", min_length=1, max_length=4)
    ] = ("completed",)
