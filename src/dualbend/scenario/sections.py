"""Sections of a scenario: robot, physics step, expected outcome, served ports."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from dualbend.arm.catalog import JOINT_COUNT, known_arm
from dualbend.arm.facts import ArmFacts
from dualbend.arm.file import is_file
from dualbend.control.alter import AlterConfig
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.response import CommandResponseConfig
from dualbend.control.servo import JointServoConfig, StiffnessConfig
from dualbend.errors import InputError
from dualbend.imperfection.robot import RobotErrors
from dualbend.scene.cell import CellConfig, PlacementConfig
from dualbend.types import SIDES, Config, Side, said

Outcome = Literal["completed", "aborted", "protective_stop", "failed"]


_ARMS = (*JOINT_COUNT, "my_arm.urdf")


class SideConfig(Config):
    """What one arm has of its own; what is not given is as for both arms."""

    model: (
        Annotated[
            str,
            said(
                "kind of this arm, if another",
                max_length=4000,
                examples=[*_ARMS],
                extra={"replaces": ()},
            ),
        ]
        | None
    ) = None
    arm: ArmFacts = ArmFacts()
    servo: StiffnessConfig = StiffnessConfig()
    response: CommandResponseConfig | None = None
    delay_cycles: (
        Annotated[int, said("transport delay, if another [command periods]", ge=0, le=100)] | None
    ) = None


class RobotConfig(Config):
    """Both arms: a name of `dualbend arms`, or the file of an arm, URDF or MJCF."""

    model: Annotated[
        str,
        said(
            f"kind of both arms: {', '.join(JOINT_COUNT)}, or a file that ends in .urdf or .xml",
            max_length=4000,
            examples=[*_ARMS],
            extra={"replaces": ()},
        ),
    ] = "puma560"
    arm: ArmFacts = ArmFacts()
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

    def of(self, side: Side) -> str:
        """Return the name or file of one side's arm."""
        return self.own(side).model or self.model

    def facts(self, side: Side) -> ArmFacts:
        """Return what the file of one side's arm does not say."""
        own = self.own(side)
        return own.arm if own.model else own.arm.over(self.arm)

    def response_of(self, side: Side) -> CommandResponseConfig:
        """Return how one side's arm answers a command."""
        return self.own(side).response or self.response

    def delay_of(self, side: Side) -> int:
        """Return one side's transport delay [command periods]."""
        own = self.own(side).delay_cycles
        return self.alter.delay_cycles if own is None else own

    @property
    def longest_delay(self) -> int:
        """Transport delay of what both arms are sent together [command periods]."""
        return max(self.delay_of(side) for side in SIDES)

    @property
    def answer_alike(self) -> bool:
        """Both arms have the same response and the same delay."""
        answers = [(self.response_of(side), self.delay_of(side)) for side in SIDES]
        return answers[0] == answers[1]

    def with_delay(self, cycles: int) -> RobotConfig:
        """Return the robot with another transport delay of both arms [command periods]."""
        alter = msgspec.structs.replace(self.alter, delay_cycles=cycles)
        left, right = (msgspec.structs.replace(self.own(s), delay_cycles=None) for s in SIDES)
        return msgspec.structs.replace(self, alter=alter, left=left, right=right)

    def stiffness_n_m_per_rad(self, side: Side) -> tuple[float, ...] | None:
        """Return the stiffness of one side's joint servos [N m/rad]; None: the arm's own."""
        return self.own(side).servo.stiffness_n_m_per_rad or self.servo.stiffness_n_m_per_rad


def check_arms(robot: RobotConfig) -> None:
    """Raise InputError where an arm has no name that is known, and is no file."""
    for key, model in (
        ("robot.model", robot.model),
        ("robot.left.model", robot.left.model),
        ("robot.right.model", robot.right.model),
    ):
        if model is not None and not is_file(model):
            known_arm(model, key)


def refuse_other_count(
    side: Side,
    name: str,
    count: int,
    robot: RobotConfig,
    cell: CellConfig,
    errors: RobotErrors,
) -> None:
    """Raise InputError where a list has not one value for each joint of an arm."""
    own = robot.own(side).servo
    stand = (cell.left if side == "left" else cell.right) or cell
    for key, values in (
        (f"robot.{side}.servo.stiffness_n_m_per_rad", own.stiffness_n_m_per_rad),
        ("robot.servo.stiffness_n_m_per_rad", robot.stiffness_n_m_per_rad(side)),
        ("cell.home_rad", cell.home_rad),
        (f"cell.{side}.home_rad", stand.home_rad),
        ("imperfections.robot.zero_rad", errors.zero_rad),
    ):
        if values is not None and len(values) != count:
            raise InputError(
                f"{key} has {len(values)} values, the {side} arm {name!r} has {count} joints"
            )


def check_joint_counts(robot: RobotConfig, cell: CellConfig, errors: RobotErrors) -> None:
    """Raise InputError where a list has not one value per joint of a shipped arm that it is of."""
    for side in SIDES:
        name = robot.of(side)
        if not is_file(name):
            refuse_other_count(side, name, JOINT_COUNT[known_arm(name)], robot, cell, errors)


def with_arm_files(robot: object, folder: Path) -> object:
    """Return a table ``robot`` in which arms' files and package folders are found from a folder.

    Their paths are absolute, so that a run's own scenario finds them from wherever it is.
    """
    if not isinstance(robot, dict):
        return robot

    def found(path: object) -> object:
        if not isinstance(path, str):
            return path  # which is refused later, with its key
        return os.path.normpath(folder.absolute() / os.path.expanduser(path))  # noqa: PTH111

    told = dict(robot)
    model = told.get("model")
    if isinstance(model, str) and is_file(model):
        told["model"] = found(model)
    facts = told.get("arm")
    if isinstance(facts, dict) and isinstance(facts.get("packages"), list | tuple):
        told["arm"] = {**facts, "packages": [found(path) for path in facts["packages"]]}
    for side in SIDES:
        if side in told:
            told[side] = with_arm_files(told[side], folder)
    return told


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
    facts = robot.pop("arm", None)
    for side in SIDES:
        own = dict(_table(before, side))
        if side in changed:
            own.pop("arm", None)
            own["servo"] = _without_stiffness(own)
        elif facts:
            own["arm"] = {**facts, **_table(own, "arm")}
        if own:
            robot[side] = own
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


class ServedArmConfig(Config):
    """What one arm of a served cell speaks, and on which ports."""

    robot: Annotated[
        Literal["rsi", "egm", "rtde", "none"],
        said("KUKA RSI, ABB EGM or UR RTDE; none: the arm follows its nominal path"),
    ] = "rsi"
    robot_port: (
        Annotated[
            int,
            said(
                "on which the controller waits for the robot; none: 49152 left and 49153 "
                "right of RSI, 6510 and 6511 of EGM; of RTDE, on which the robot waits: 30004",
                ge=1,
                le=65535,
            ),
        ]
        | None
    ) = None
    robot_address: (
        Annotated[
            str,
            said(
                "where a robot that speaks RTDE listens; none: --address, and 127.0.0.2 the right "
                "one beside 127.0.0.1",
                min_length=1,
                max_length=255,
            ),
        ]
        | None
    ) = None
    sensor: Annotated[
        Literal["netft", "none"], said("ATI Net F/T, of an arm that senses; none: no port")
    ] = "netft"
    sensor_port: (
        Annotated[
            int,
            said("of the sensor's records; none: 49162 left, 49163 right; 0: any", ge=0, le=65535),
        ]
        | None
    ) = None
    http_port: (
        Annotated[
            int,
            said("of the sensor's page; none: 49172 left, 49173 right; 0: any", ge=0, le=65535),
        ]
        | None
    ) = None


class ServeConfig(Config):
    """How ``dualbend serve`` opens the cell, with these defaults also where the section is absent.

    The bounds are assumed.
    """

    client: (
        Annotated[
            str,
            said(
                "command that starts your controller, in the working folder, by `serve` and "
                "`check`; ports that are not given are free ones, told by DUALBEND_LEFT_ROBOT_PORT "
                "... and {left_robot_port} ...",
                min_length=1,
                max_length=4000,
                examples=["python my_controller.py"],
            ),
        ]
        | None
    ) = None
    left: ServedArmConfig = ServedArmConfig()
    right: ServedArmConfig = ServedArmConfig()
    correction: Annotated[
        Literal["absolute", "relative"],
        said("an answer is the whole deviation of its cycle, or what is added to the last one"),
    ] = "absolute"
    path: Annotated[
        Literal["inside", "outside"],
        said("the cell runs the path and answers correct it, or answers are the whole motion"),
    ] = "inside"
    unknown: Annotated[
        Literal["refused", "zero"],
        said("RTDE's variables that the cell does not know: NOT_FOUND, or there and 0"),
    ] = "refused"
    limit_m: Annotated[float, said("largest deviation from the path along an axis", gt=0, le=1)] = (
        0.05
    )
    limit_rad: Annotated[
        float, said("largest deviation from the path about an axis", gt=0, le=1)
    ] = 0.2
    step_m: Annotated[float, said("largest change of an answer in a cycle", gt=0, le=1)] = 0.005
    step_rad: Annotated[float, said("largest change of an answer in a cycle", gt=0, le=1)] = 0.05
    late_limit: Annotated[
        int, said("wrong or missed answers in a row at which a robot stops", ge=1, le=1_000_000)
    ] = 100
    wait_s: Annotated[float, said("for the first answer", gt=0, le=86400)] = 60.0
    timeout_s: Annotated[float, said("for every later answer", gt=0, le=3600)] = 10.0

    def own(self, side: Side) -> ServedArmConfig:
        """Return what one side speaks."""
        return self.left if side == "left" else self.right
