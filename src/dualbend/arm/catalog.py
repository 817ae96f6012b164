"""The arms that can be named: what their files do not say, each number with its grade.

Geometry, masses, joint limits, speeds and torques of an arm from the package example-robot-data are
read from its URDF. This table has what no URDF holds: where the flange is, payload, reach, rotors.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Final, Literal

from dualbend.arm.facts import ArmFacts
from dualbend.errors import InputError, brief

ArmName = Literal["puma560", "ur3", "ur5", "ur10", "panda", "xarm7", "z1"]

PACKAGE: Final = "example-robot-data"
"""The package that holds the URDFs."""

JOINT_COUNT: Final[dict[ArmName, int]] = {
    **{"puma560": 6, "ur3": 6, "ur5": 6, "ur10": 6, "panda": 7, "xarm7": 7, "z1": 6}
}


def known_arm(text: str, key: str = "robot.model") -> ArmName:
    """Return the name of a shipped arm; InputError with the choices where there is none."""
    for name in JOINT_COUNT:
        if name == text:
            return name
    close = difflib.get_close_matches(text, JOINT_COUNT, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    if text.endswith(".xacro"):
        hint = "xacro is expanded first: xacro arm.urdf.xacro > arm.urdf; "
    raise InputError(
        f"{key} = {brief(text)}: must be one of {', '.join(map(repr, JOINT_COUNT))}, or an arm's "
        f"file that ends in .urdf or .xml (MJCF); {hint}".rstrip("; ")
    )


@dataclass(frozen=True, kw_only=True)
class ShippedArm:
    """An arm in the package's files, and what is known of it beside them.

    Attributes
    ----------
    file : below the package's folder ``robots``
    facts : what the file does not say; the rotors' inertia no URDF has
    rated : whose numbers payload and reach are, and how sure
    upstream : where the package has the description from
    grade : of the dynamics in the URDF
    assumed : what stands in the place of wrong numbers of the file
    """

    file: str
    facts: ArmFacts
    rated: str
    upstream: str
    grade: str
    assumed: tuple[str, ...] = ()


_AS_IT_IS = (0.0, 0.0, 0.0)
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
    assumed: tuple[str, ...] = (),
) -> ShippedArm:
    return ShippedArm(
        file=f"ur_description/urdf/{name}_robot.urdf",
        facts=ArmFacts(
            base="base_link",
            flange="tool0",
            flange_rpy_rad=_AS_IT_IS,
            torque_limit_n_m=torque_limit_n_m,
            payload_kg=payload_kg,
            reach_m=reach_m,
        ),
        rated="Universal Robots CB3 data sheets (recalled)",
        upstream="ros-industrial/universal_robot (ur_description)",
        grade=grade,
        assumed=assumed,
    )


SHIPPED: Final[dict[ArmName, ShippedArm]] = {
    # The file repeats the UR10's 330, 150 and 54 N m; these are recalled of the UR3's sheet.
    "ur3": _universal(
        "ur3",
        3.0,
        0.5,
        torque_limit_n_m=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0),
        assumed=("torque limits of the manufacturer (the URDF has another arm's)",),
    ),
    "ur5": _universal("ur5", 5.0, 0.85, grade=_UR_GRADE + _WRISTS),
    "ur10": _universal("ur10", 10.0, 1.3),
    "panda": ShippedArm(
        file="panda_description/urdf/panda.urdf",
        facts=ArmFacts(
            base="panda_link0",
            flange="panda_link8",
            flange_rpy_rad=_AS_IT_IS,
            payload_kg=3.0,
            reach_m=0.855,
        ),
        rated="Franka Emika data sheet (recalled)",
        upstream="frankaemika/franka_ros (franka_description)",
        grade="identified masses and inertias; friction is a simulator's placeholder",
    ),
    "xarm7": ShippedArm(
        file="xarm_description/urdf/xarm7.urdf",
        facts=ArmFacts(
            base="link_base",
            flange="link_eef",
            flange_rpy_rad=_AS_IT_IS,
            payload_kg=3.5,
            reach_m=0.7,
        ),
        rated="UFACTORY data sheet (recalled)",
        upstream="xArm-Developer/xarm_ros2",
        grade="manufacturer's masses and inertias; friction in round numbers",
    ),
    "z1": ShippedArm(
        file="z1_description/urdf/z1.urdf",
        facts=ArmFacts(
            base="link00",
            # The gripper's stator starts on the mounting face of the last joint; x is outward.
            flange="gripperStator",
            flange_rpy_rad=(0.0, 1.5707963267948966, 0.0),
            payload_kg=3.0,
            reach_m=0.74,
        ),
        rated="Unitree, Z1 specifications",
        upstream="unitreerobotics/unitree_ros (z1_description)",
        grade="manufacturer's masses and inertias; friction in round numbers",
    ),
}


def package_folder(package: str) -> Path:
    """Return the folder that holds an installed package's robots, found by its metadata.

    Raises InputError where the package is not installed, or holds no robots.
    """
    try:
        installed = metadata.distribution(package)
    except metadata.PackageNotFoundError as error:
        raise InputError(
            f"robot.model: the arms' files are in the package {package}, which is not installed: "
            f"pip install {package}; without it there is robot.model = 'puma560'"
        ) from error
    folder = Path(str(installed.locate_file(f"cmeel.prefix/share/{package}")))
    if not (folder / "robots").is_dir():
        raise InputError(
            f"robot.model: the package {package} {installed.version} has no robots in {folder}: "
            f"pip install --force-reinstall {package}"
        )
    return folder
