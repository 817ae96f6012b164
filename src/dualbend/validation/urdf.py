"""An arm from its URDF, read as XML: reference for the model that MuJoCo's parser makes of it.

Of an MJCF the reference is :mod:`dualbend.validation.mjcf`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from dualbend.arm.file import ArmFile
from dualbend.types import Vector
from dualbend.validation import mjcf
from dualbend.validation.lagrange import Link, SerialArm, joined


def equations_of(file: ArmFile) -> SerialArm:
    """Return the arm between base and flange, z outward, as its file has it.

    What is fixed at the flange, or to the last link, is a tool, and without mass here.
    """
    if not file.is_urdf:
        return mjcf.equations_of(file)
    facts = file.facts
    root = ET.parse(file.file).getroot()
    bodies = {link.attrib["name"]: link.find("inertial") for link in root.findall("link")}
    above = {_of(joint, "child")["link"]: joint for joint in root.findall("joint")}
    way: list[str] = [str(facts.flange)]
    while _of(above[way[0]], "parent")["link"] != facts.base:
        way.insert(0, _of(above[way[0]], "parent")["link"])
    moving = [name for name in way if above[name].get("type") != "fixed"]
    links: list[Link] = []
    for name in way:
        fixed = name not in moving
        body = None if fixed and name == facts.flange else bodies[name]
        link = _link(above[name], body, fixed=fixed)
        # A tool hangs on the last link that moves; what stands still is no matter.
        if way.index(moving[0]) <= way.index(name) < way.index(moving[-1]):
            link = _with_what_is_fixed(link, name, np.eye(4), way, above, bodies)
        links.append(link)
    rpy = np.array(facts.flange_rpy_rad or (0.0, 0.0, 0.0))
    return SerialArm(links=tuple(links), flange=_transform(np.zeros(3), rpy))


def _with_what_is_fixed(
    link: Link,
    name: str,
    pose: Vector,
    way: list[str],
    above: dict[str, ET.Element],
    bodies: dict[str, ET.Element | None],
) -> Link:
    """Return a link with the bodies fixed beside it, ``pose`` (4, 4) that of the link ``name``."""
    for child, joint in above.items():
        if _of(joint, "parent")["link"] != name or child in way or joint.get("type") != "fixed":
            continue
        place = pose @ _pose(joint)
        more = _link(joint, bodies[child], fixed=True)
        centre = place[:3, :3] @ more.centre_m + place[:3, 3]
        inertia = place[:3, :3] @ more.inertia_kg_m2 @ place[:3, :3].T
        link = joined(link, more.mass_kg, centre, inertia)
        link = _with_what_is_fixed(link, child, place, way, above, bodies)
    return link


def _link(joint: ET.Element, body: ET.Element | None, *, fixed: bool) -> Link:
    axis = np.zeros(3) if fixed else _numbers(_of(joint, "axis").get("xyz", "1 0 0"))
    pose, given = _pose(body), _of(body, "inertia")
    xx, xy, xz, yy, yz, zz = (
        float(given.get(f"i{key}", 0.0)) for key in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Link(
        pose=_pose(joint),
        axis=axis if fixed else axis / np.linalg.norm(axis),
        mass_kg=float(_of(body, "mass").get("value", 0.0)),
        centre_m=pose[:3, 3],
        inertia_kg_m2=pose[:3, :3] @ inertia @ pose[:3, :3].T,
        slides=joint.get("type") == "prismatic",
    )


def _of(parent: ET.Element | None, tag: str) -> dict[str, str]:
    """Return the attributes of a child; none where there is no child."""
    child = None if parent is None else parent.find(tag)
    return {} if child is None else child.attrib


def _numbers(text: str) -> Vector:
    return np.array([float(part) for part in text.split()])


def _pose(parent: ET.Element | None) -> Vector:
    """Return the transform (4, 4) of the ``origin`` in an element."""
    origin = _of(parent, "origin")
    return _transform(*(_numbers(origin.get(key, "0 0 0")) for key in ("xyz", "rpy")))


def _transform(place: Vector, rpy: Vector) -> Vector:
    """Return the transform (4, 4) with R = Rz(yaw) Ry(pitch) Rx(roll), URDF's order."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), place
    return pose
