"""The arms that can be named: what their files do not say, each number with its grade.

Geometry, masses, joint limits, speeds and torques of an arm from the package example-robot-data are
read from its URDF. This table has what no URDF holds: where the flange is, payload, reach, rotors.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Final, Literal

from dualbend.errors import InputError, brief

ArmName = Literal["puma560", "ur3", "ur5", "ur10", "panda", "xarm7", "z1"]

PACKAGE: Final = "example-robot-data"
"""The package that holds the URDFs."""

JOINT_COUNT: Final[dict[ArmName, int]] = {
    **{"puma560": 6, "ur3": 6, "ur5": 6, "ur10": 6, "panda": 7, "xarm7": 7, "z1": 6}
}


def arm_name(text: str, key: str = "robot.model") -> ArmName:
    """Return the name of an arm; InputError with the choices where there is none of that name."""
    for name in JOINT_COUNT:
        if name == text:
            return name
    close = difflib.get_close_matches(text, JOINT_COUNT, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    raise InputError(
        f"{key} = {brief(text)}: no such arm; {hint}there are {', '.join(JOINT_COUNT)}"
    )


@dataclass(frozen=True, kw_only=True)
class UrdfFacts:
    """An arm in the package's files, and what they do not say of it.

    Attributes
    ----------
    file : below the package's folder ``robots``
    base, flange : links between which the arm is
    flange_rpy : turn [rad] from the flange link's axes to ones with z outward
    payload_kg, reach_m : rated
    rated : whose numbers those two are, and how sure
    torque_limit_n_m : where those of the URDF are wrong
    armature_kg_m2 : of every joint's rotor at the joint; no URDF has it
    upstream : where the package has the description from
    grade : of the dynamics in the URDF
    """

    file: str
    base: str
    flange: str
    flange_rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    payload_kg: float
    reach_m: float
    rated: str
    torque_limit_n_m: tuple[float, ...] | None = None
    armature_kg_m2: float = 0.1
    upstream: str
    grade: str


_UR_GRADE = "manufacturer's masses; inertias of cylinders, no friction"
_WRISTS = (
    "; the wrists' inertias are those of a body of 0.4 m radius of gyration, as in the upstream"
)


def _universal(
    name: ArmName,
    payload_kg: float,
    reach_m: float,
    grade: str = _UR_GRADE,
    torque_limit_n_m: tuple[float, ...] | None = None,
) -> UrdfFacts:
    return UrdfFacts(
        file=f"ur_description/urdf/{name}_robot.urdf",
        base="base_link",
        flange="tool0",
        payload_kg=payload_kg,
        reach_m=reach_m,
        rated="Universal Robots CB3 data sheets (recalled)",
        torque_limit_n_m=torque_limit_n_m,
        upstream="ros-industrial/universal_robot (ur_description)",
        grade=grade,
    )


URDF_ARMS: Final[dict[ArmName, UrdfFacts]] = {
    # The file repeats the UR10's 330, 150 and 54 N m; these are recalled of the UR3's sheet.
    "ur3": _universal("ur3", 3.0, 0.5, torque_limit_n_m=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0)),
    "ur5": _universal("ur5", 5.0, 0.85, grade=_UR_GRADE + _WRISTS),
    "ur10": _universal("ur10", 10.0, 1.3),
    "panda": UrdfFacts(
        file="panda_description/urdf/panda.urdf",
        base="panda_link0",
        flange="panda_link8",
        payload_kg=3.0,
        reach_m=0.855,
        rated="Franka Emika data sheet (recalled)",
        upstream="frankaemika/franka_ros (franka_description)",
        grade="identified masses and inertias; friction is a simulator's placeholder",
    ),
    "xarm7": UrdfFacts(
        file="xarm_description/urdf/xarm7.urdf",
        base="link_base",
        flange="link_eef",
        payload_kg=3.5,
        reach_m=0.7,
        rated="UFACTORY data sheet (recalled)",
        upstream="xArm-Developer/xarm_ros2",
        grade="manufacturer's masses and inertias; friction in round numbers",
    ),
    "z1": UrdfFacts(
        file="z1_description/urdf/z1.urdf",
        base="link00",
        # The gripper's stator starts on the mounting face of the last joint; x is outward there.
        flange="gripperStator",
        flange_rpy=(0.0, 1.5707963267948966, 0.0),
        payload_kg=3.0,
        reach_m=0.74,
        rated="Unitree, Z1 specifications",
        upstream="unitreerobotics/unitree_ros (z1_description)",
        grade="manufacturer's masses and inertias; friction in round numbers",
    ),
}
