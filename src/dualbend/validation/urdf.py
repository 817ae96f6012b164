"""An arm from its URDF, read as XML: reference for the model that MuJoCo's parser makes of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from dualbend.arm.urdf import UrdfFile
from dualbend.types import Vector
from dualbend.validation.lagrange import Link, SerialArm


def equations_of(urdf: UrdfFile) -> SerialArm:
    """Return the arm between base and flange, z outward, as its file has it.

    What is fixed at the flange is a tool, and without mass here.
    """
    facts = urdf.facts
    root = ET.parse(urdf.file).getroot()
    bodies = {link.attrib["name"]: link.find("inertial") for link in root.findall("link")}
    above = {_of(joint, "child")["link"]: joint for joint in root.findall("joint")}
    links: list[Link] = []
    name = facts.flange
    while name != facts.base:
        joint = above[name]
        fixed = joint.get("type") == "fixed"
        body = None if fixed and name == facts.flange else bodies[name]
        links.insert(0, _link(joint, body, fixed=fixed))
        name = _of(joint, "parent")["link"]
    return SerialArm(links=tuple(links), flange=_transform(np.zeros(3), np.array(facts.flange_rpy)))


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
