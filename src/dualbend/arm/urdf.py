"""An arm from its URDF as a MuJoCo specification: MuJoCo's own parser reads it.

Before, the file is cut to the arm between base and flange, and links and joints get the names that
every arm has.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import mujoco

from dualbend.arm.drawn import Drawn, JointLimits
from dualbend.arm.facts import ArmFacts
from dualbend.arm.tree import FIXED, HINGE, SLIDE, Chain, Joint, Tree
from dualbend.errors import InputError

_TURN: Final = 2.0 * math.pi
"""Range to each side of a joint that the file calls continuous [rad]."""

_AS_IT_IS: Final = {"discardvisual": "false", "fusestatic": "false"}
"""MuJoCo's parser drops by default what only shows, and fuses the base with the world."""

_STUB: Final = (
    '<inertial><mass value="1e-6"/>'
    '<inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial>'
)
"""Of a frame that moves and has no mass: next to nothing beside a rotor."""

_KINDS = {"revolute": HINGE, "continuous": HINGE, "prismatic": SLIDE, "fixed": FIXED}


class Urdf:
    """A URDF, read as XML: its tree, and the arm cut out of it.

    Raises InputError where the file cannot be read.
    """

    def __init__(self, file: Path, text: bytes) -> None:
        self.file = file
        try:
            self._root = ET.fromstring(text)
        except ET.ParseError as error:
            raise self._error(f"cannot be read as URDF: {error}") from error
        xacro = "{http://www.ros.org/wiki/xacro}"
        if any(str(element.tag).startswith(xacro) for element in self._root.iter()):
            raise self._error(f"is xacro, not expanded: xacro {file.name} > arm.urdf")
        if self._root.tag != "robot":
            raise self._error(f"is no URDF: its outermost element is <{self._root.tag}>")
        self._links = {link.get("name", ""): link for link in self._root.findall("link")}
        self._joints = {
            self._end(joint, "child").get("link", ""): joint
            for joint in self._root.findall("joint")
        }
        self.tree = Tree(file, list(self._links), [*map(self._joint, self._joints.values())])

    def _error(self, text: str) -> InputError:
        return InputError(f"{self.file}: {' '.join(text.split())}")  # MuJoCo's has lines

    def _end(self, joint: ET.Element, role: str) -> ET.Element:
        """Return the parent or child of a joint."""
        end = joint.find(role)
        if end is None or "link" not in end.attrib:
            raise self._error(f"joint {joint.get('name')!r} has no {role} link")
        return end

    def _joint(self, joint: ET.Element) -> Joint:
        name, child = joint.get("name", ""), self._end(joint, "child").attrib["link"]
        link, mimic, limit = self._links.get(child), joint.find("mimic"), joint.find("limit")
        if link is None:
            raise self._error(f"joint {name!r} moves the link {child!r}, which there is not")
        stroke = math.inf
        if limit is not None and joint.get("type") == "prismatic":
            stroke = self._number(joint, limit, "upper") - self._number(joint, limit, "lower")
        return Joint(
            name=name,
            kind=_KINDS.get(joint.get("type", ""), joint.get("type", "")),
            parent=self._end(joint, "parent").attrib["link"],
            child=child,
            stroke=stroke,
            bare=link.find("visual") is None and link.find("collision") is None,
            mimics="" if mimic is None else mimic.get("joint", "another"),
        )

    def _number(self, joint: ET.Element, limit: ET.Element | None, key: str) -> float:
        """Return what the file says of a joint's limit; 0 where it says nothing."""
        try:
            return float(limit.get(key, 0.0)) if limit is not None else 0.0
        except ValueError as error:
            raise self._error(f"joint {joint.get('name')!r}: {error}") from error

    def limits(self, chain: Chain) -> JointLimits:
        """Return torque and speed limits of the joints that move, 0 where the file has none.

        Continuous joints get a range. Raises InputError where a joint has no range, or is no hinge
        and no slide.
        """
        torque, speed = [], []
        for one in chain.moving:
            joint = self._joints[one.child]
            limit = joint.find("limit")
            if one.kind not in (HINGE, SLIDE):
                raise self._error(f"joint {one.name!r} is {one.kind}; needs a hinge or a slide")
            if joint.get("type") == "continuous":
                joint.set("type", "revolute")
                limit = limit if limit is not None else ET.SubElement(joint, "limit")
                limit.attrib |= {"lower": repr(-_TURN), "upper": repr(_TURN)}
            low, high, most, fastest = (
                self._number(joint, limit, key) for key in ("lower", "upper", "effort", "velocity")
            )
            if not low < high:
                raise self._error(f"joint {one.name!r} lacks a range, lower < upper")
            torque.append(max(most, 0.0))
            speed.append(max(fastest, 0.0))
        return JointLimits(torque_n_m=tuple(torque), speed_rad_per_s=tuple(speed))

    def cut(self, chain: Chain, facts: ArmFacts) -> Drawn:
        """Return the arm alone, its links under the names that every arm has.

        What is fixed beside the chain is kept, with its mass; what hangs beyond the flange, and
        what moves beside the chain, is left out. The flange is where the arm ends: what the file
        fixes there is a tool.
        """
        stubs = self._give_stubs_mass(chain)
        sides = self.tree.sides(chain)
        names = {chain.base: "base"}
        count = 0
        for i, joint in enumerate(chain.joints):
            count += joint.moves
            names[joint.child] = f"link{count}" if joint.moves else f"fixed{i}"
        names |= {joint.child: f"beside{i}" for i, joint in enumerate(sides)}
        joints = {joint.child: joint for joint in (*chain.joints, *sides)}
        kept = [self._links[name] for name in names]
        kept += [self._joints[name] for name in joints]
        for element in self._root.findall("*"):
            if element not in kept and element.tag != "material":
                self._root.remove(element)
        base, flange = self._links[chain.base], self._links[chain.flange]
        for inertial in base.findall("inertial"):
            base.remove(inertial)  # what stands still needs no mass
        if not chain.joints[-1].moves:
            flange.clear()
        for name, new in names.items():
            self._links[name].set("name", new)
        for child, joint in joints.items():
            element, new = self._joints[child], names[child]
            self._end(element, "parent").set("link", names[joint.parent])
            self._end(element, "child").set("link", new)
            element.set("name", new.replace("link", "joint"))
        for mesh in self._root.iter("mesh"):
            mesh.set("filename", str(self._resolved(mesh.get("filename", ""), facts.packages)))
        ET.SubElement(ET.SubElement(self._root, "mujoco"), "compiler", _AS_IT_IS)
        try:
            spec = mujoco.MjSpec.from_string(ET.tostring(self._root, encoding="unicode"))
        except ValueError as error:
            raise self._error(f"cannot be read as URDF: {error}") from error
        return Drawn(spec=spec, flange=names[chain.flange], stubs=stubs)

    def _give_stubs_mass(self, chain: Chain) -> tuple[str, ...]:
        """Give frames that move and have no mass next to none; return their names."""
        *inner, last = chain.moving
        found = []
        for joint in inner:
            link = self._links[joint.child]
            if joint.bare and joint.child != last.child and link.find("inertial") is None:
                link.append(ET.fromstring(_STUB))
                found.append(joint.child)
        return tuple(found)

    def _resolved(self, name: str, folders: Iterable[str] | None) -> Path:
        """Return the file that a mesh's name stands for."""
        if not name.startswith("package://"):
            return (self.file.parent / name.removeprefix("file://")).resolve()
        package, *parts = name.removeprefix("package://").split("/")
        around = self.file.resolve().parents if folders is None else map(Path, folders)
        for folder in around:
            # A folder of packages, or the package itself.
            for found in (folder / package, folder):
                path = found.joinpath(*parts)
                if found.name == package and path.is_file():
                    return path
        looked = "upward of the file" if folders is None else f"in {', '.join(folders)}"
        raise self._error(
            f"{name}: not found {looked}; robot.arm.packages = [...] says in which folder the "
            f"folder {package!r} is"
        )
