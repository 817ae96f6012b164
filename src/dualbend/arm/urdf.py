"""An arm from its URDF as a MuJoCo specification: MuJoCo's own parser reads it.

Before, the file is cut to the chain between base and flange, and links and joints get the names
that every arm has; after, joints get what no URDF holds, links a capsule that collides and looks.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from dualbend.arm.catalog import UrdfFacts
from dualbend.arm.meshes import add_shapes
from dualbend.arm.mjcf import FLANGE_SITE
from dualbend.errors import InputError

_HARD_FRICTION: Final = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Nearly hard dry friction, as the PUMA's: the default smears it over 5 mrad/s."""

_TURN: Final = 2.0 * math.pi
"""Range to each side of a joint that the file calls continuous [rad]."""

_NEIGHBOURS = 2
"""Links this near in the chain overlap at their joints: their capsules do not collide."""

_AS_IT_IS: Final = {"discardvisual": "false", "fusestatic": "false"}
"""MuJoCo's parser drops by default what only shows, and fuses the base with the world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfArm:
    """A serial arm of n joints from its URDF.

    Attributes
    ----------
    spec : bodies ``base`` and ``link1`` ... ``link<n>`` with the URDF's frames, joints ``joint1``
        ... ``joint<n>``, site ``flange`` with z outward; no actuators
    joint_names : the URDF's (n,)
    speed_limit_rad_per_s : (n,), which MuJoCo's joints do not have
    """

    spec: mujoco.MjSpec
    joint_names: tuple[str, ...]
    speed_limit_rad_per_s: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class UrdfFile:
    """A URDF with what it does not say; ``share`` is the folder of ``package://`` names."""

    file: Path
    share: Path
    facts: UrdfFacts

    def read(self, *, looks: bool) -> UrdfArm:
        """Return the arm between base and flange, with meshes to look at or without.

        Links that hang beside the chain or beyond the flange are left out, links that are fixed to
        each other are one. Gravity is held up by the joints' own drives, as in
        :func:`dualbend.arm.mjcf.load_puma`. Raises InputError where the file cannot be read, or is
        no chain of hinges with masses and limits.
        """
        try:
            root = ET.parse(self.file).getroot()
        except (OSError, ET.ParseError) as error:
            raise self._error(f"cannot be read as URDF: {error}") from error
        links, joints = self._chain(root)
        moved = [(j, link) for j, link in zip(joints, links[1:], strict=True) if _turns(j)]
        names = tuple(joint.attrib["name"] for joint, _ in moved)
        moving = [link.attrib["name"] for _, link in moved]
        speeds = tuple(self._speed(joint) for joint, _ in moved)
        self._cut(root, links, joints)
        spec = self._parsed(root)
        add_shapes(spec, looks=looks)
        spec.fuse_static()
        for name, link in zip(moving, spec.bodies[2:], strict=True):
            link.gravcomp = 1.0
            if not link.mass > 0.0:
                raise self._error(f"link {name!r} moves and has no mass")
        self._add_drives(spec)
        return UrdfArm(spec=spec, joint_names=names, speed_limit_rad_per_s=speeds)

    def _error(self, text: str) -> InputError:
        return InputError(f"{self.file}: {text}")

    def _chain(self, root: ET.Element) -> tuple[list[ET.Element], list[ET.Element]]:
        """Return links and joints from base to flange, in order."""
        links = {link.get("name", ""): link for link in root.findall("link")}
        above = {
            self._end(joint, "child").get("link", ""): joint for joint in root.findall("joint")
        }
        joints: list[ET.Element] = []
        names = [self.facts.flange]
        while names[0] != self.facts.base and names[0] in above:
            joints.insert(0, above.pop(names[0]))
            names.insert(0, self._end(joints[0], "parent").attrib["link"])
        whole = names[0] == self.facts.base and links.keys() >= {*names}
        if not whole or not any(map(_turns, joints)):
            ends = f"{self.facts.base!r} to {self.facts.flange!r}"
            raise self._error(f"no chain of joints from {ends}")
        return [links[name] for name in names], joints

    def _end(self, joint: ET.Element, role: str) -> ET.Element:
        """Return the parent or child of a joint."""
        end = joint.find(role)
        if end is None or "link" not in end.attrib:
            raise self._error(f"joint {joint.get('name')!r} has no {role} link")
        return end

    def _speed(self, joint: ET.Element) -> float:
        """Return a joint's speed limit [rad/s]; a continuous joint gets a range."""
        name, kind, limit = joint.get("name"), joint.get("type"), joint.find("limit")
        if kind not in ("revolute", "continuous") or limit is None:
            raise self._error(f"joint {name!r} is {kind}; needs a hinge with limits")
        if kind == "continuous":
            joint.set("type", "revolute")
            limit.attrib |= {"lower": repr(-_TURN), "upper": repr(_TURN)}
        try:
            low, high, effort, speed = (
                float(limit.get(key, 0.0)) for key in ("lower", "upper", "effort", "velocity")
            )
        except ValueError as error:
            raise self._error(f"joint {name!r}: {error}") from error
        if not (effort > 0.0 and speed > 0.0 and low < high):
            raise self._error(f"joint {name!r} lacks effort, velocity or range")
        return speed

    def _cut(self, root: ET.Element, links: list[ET.Element], joints: list[ET.Element]) -> None:
        """Leave the chain alone in the file, under the names that every arm has."""
        kept = [*links, *joints, *root.findall("material")]
        for element in root.findall("*"):
            if element not in kept:
                root.remove(element)
        base, flange = links[0], links[-1]
        for inertial in base.findall("inertial"):
            base.remove(inertial)  # what stands still needs no mass
        if not _turns(joints[-1]):
            # The flange is where the arm ends: what the file fixes there is a tool.
            flange.clear()
        base.set("name", "base")
        name, count = "base", 0
        for i, (joint, link) in enumerate(zip(joints, links[1:], strict=True)):
            count += _turns(joint)
            self._end(joint, "parent").set("link", name)
            name = f"link{count}" if _turns(joint) else f"fixed{i}"
            self._end(joint, "child").set("link", name)
            link.set("name", name)
            joint.set("name", f"joint{count}" if _turns(joint) else name)

    def _parsed(self, root: ET.Element) -> mujoco.MjSpec:
        """Return what MuJoCo reads, with files of meshes as paths."""
        for mesh in root.iter("mesh"):
            mesh.set("filename", str(self._resolved(mesh.get("filename", ""))))
        ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", _AS_IT_IS)
        try:
            spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
        except ValueError as error:
            raise self._error(f"cannot be read as URDF: {error}") from error
        outward = np.empty(4)
        mujoco.mju_euler2Quat(outward, np.array(self.facts.flange_rpy), "XYZ")
        spec.bodies[-1].add_site(
            name=FLANGE_SITE,
            quat=outward,
            group=4,
            size=[0.006, 0.006, 0.006],
            rgba=[0.9, 0.2, 0.1, 1.0],
        )
        spec.bodies[1].fuse = False
        return spec

    def _resolved(self, name: str) -> Path:
        if name.startswith("package://"):
            # The first part names the package, whose folder ``share`` is.
            return self.share.joinpath(*name.removeprefix("package://").split("/")[1:])
        return (self.file.parent / name.removeprefix("file://")).resolve()

    def _add_drives(self, spec: mujoco.MjSpec) -> None:
        """Give links and joints what no URDF holds, and let neighbours overlap."""
        facts = self.facts
        for i, joint in enumerate(spec.joints):
            joint.limited = joint.actfrclimited = joint.actgravcomp = True
            joint.armature, joint.solimp_friction = facts.armature_kg_m2, _HARD_FRICTION
            if facts.torque_limit_n_m is not None:
                joint.actfrcrange = np.array([-1.0, 1.0]) * facts.torque_limit_n_m[i]
        names = [body.name for body in spec.bodies[1:]]
        for i, first in enumerate(names):
            for second in names[i + 1 : i + 1 + _NEIGHBOURS]:
                spec.add_exclude(bodyname1=first, bodyname2=second)


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


def _turns(joint: ET.Element) -> bool:
    return joint.get("type") != "fixed"
