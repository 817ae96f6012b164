"""An arm's URDF, read as text: the chain of moving links from a base to a flange.

No loader of the package is imported, and nothing of MuJoCo: what is read here is also what the
oracle of the dynamics reads. Links that hang beside the chain or beyond the flange are left out,
links that are fixed to each other are one.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np

from dualbend.errors import InputError
from dualbend.types import Vector

_TURN = 2.0 * math.pi
"""Range to each side of a joint that the file calls continuous [rad]."""


@dataclass(frozen=True, kw_only=True)
class UrdfMesh:
    """A mesh file and where it is in the moving link's frame (4, 4), with its scale (3,)."""

    file: Path
    pose: Vector
    scale: Vector


@dataclass(frozen=True, kw_only=True)
class UrdfLink:
    """What moves together: mass [kg], centre (3,) [m], inertia about it (3, 3) [kg m²], meshes.

    All in the frame of the link that the joint moves. ``visuals`` and ``collisions`` are as the
    file has them.
    """

    name: str
    mass_kg: float
    centre_m: Vector
    inertia_kg_m2: Vector
    visuals: tuple[UrdfMesh, ...]
    collisions: tuple[UrdfMesh, ...]


@dataclass(frozen=True, kw_only=True)
class UrdfJoint:
    """A joint: pose (4, 4) of its frame in the moving link before it, axis (3,) in its own frame.

    ``damping`` [N m s/rad] and ``friction`` [N m] are 0 where the file does not have them.
    """

    name: str
    pose: Vector
    axis: Vector
    range_rad: tuple[float, float]
    effort_n_m: float
    speed_rad_per_s: float
    damping: float
    friction: float


@dataclass(frozen=True, kw_only=True)
class UrdfChain:
    """Base link, n joints each with the link that it moves, and the flange (4, 4) in the last."""

    base: UrdfLink
    joints: tuple[UrdfJoint, ...]
    links: tuple[UrdfLink, ...]
    flange: Vector


def package_folder(package: str) -> Path:
    """Return the folder that holds an installed package's robots, found by its metadata.

    Raises
    ------
    InputError
        The package is not installed, or holds no robots.
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


def read_chain(file: Path, base: str, flange: str, share: Path) -> UrdfChain:
    """Return the chain between two links; ``share`` is the folder of ``package://`` names.

    Raises
    ------
    InputError
        The file cannot be read, or is no chain of hinges with masses and limits between the two.
    """
    try:
        root = ET.parse(file).getroot()
    except (OSError, ET.ParseError) as error:
        raise InputError(f"{file}: cannot be read as URDF: {error}") from error
    return _Reader(root, file, share).chain(base, flange)


class _Reader:
    def __init__(self, root: ET.Element, file: Path, share: Path) -> None:
        self._file, self._share = file, share
        self._links = {link.attrib["name"]: link for link in root.findall("link")}
        self._above = {_link_of(joint, "child"): joint for joint in root.findall("joint")}

    def chain(self, base: str, flange: str) -> UrdfChain:
        joints: list[UrdfJoint] = []
        groups: list[list[tuple[str, Vector]]] = [[(base, np.eye(4))]]
        pose = np.eye(4)
        for element in self._path(base, flange):
            child = _link_of(element, "child")
            pose = pose @ _pose(element.find("origin"))
            if element.attrib["type"] == "fixed":
                # The flange is where the arm ends: what the file puts there is a tool.
                if child != flange:
                    groups[-1].append((child, pose))
                continue
            joints.append(self._joint(element, pose))
            groups.append([(child, np.eye(4))])
            pose = np.eye(4)
        base_link, *links = (self._lump(group) for group in groups)
        for link in links:
            if not link.mass_kg > 0.0:
                raise InputError(f"{self._file}: link {link.name!r} moves and has no mass")
        return UrdfChain(base=base_link, joints=tuple(joints), links=tuple(links), flange=pose)

    def _path(self, base: str, flange: str) -> list[ET.Element]:
        path: list[ET.Element] = []
        link = flange
        while link != base:
            if link not in self._above:
                raise InputError(f"{self._file}: no chain of joints from {base!r} to {flange!r}")
            path.append(self._above[link])
            link = _link_of(path[-1], "parent")
        return path[::-1]

    def _joint(self, element: ET.Element, pose: Vector) -> UrdfJoint:
        name, kind = element.attrib["name"], element.attrib["type"]
        limit, dynamics = element.find("limit"), element.find("dynamics")
        if kind not in ("revolute", "continuous") or limit is None:
            raise InputError(f"{self._file}: joint {name!r} is {kind}; needs a hinge with limits")
        axis_element = element.find("axis")
        axis = _numbers("1 0 0" if axis_element is None else axis_element.attrib["xyz"])
        known = {} if dynamics is None else dynamics.attrib
        low, high = (-_TURN, _TURN)
        if kind == "revolute":
            low, high = (float(limit.attrib[key]) for key in ("lower", "upper"))
        effort, speed = (float(limit.attrib.get(key, 0.0)) for key in ("effort", "velocity"))
        if not (effort > 0.0 and speed > 0.0 and low < high):
            raise InputError(f"{self._file}: joint {name!r} lacks effort, velocity or range")
        return UrdfJoint(
            name=name,
            pose=pose,
            axis=axis / np.linalg.norm(axis),
            range_rad=(low, high),
            effort_n_m=effort,
            speed_rad_per_s=speed,
            damping=float(known.get("damping", 0.0)),
            friction=float(known.get("friction", 0.0)),
        )

    def _lump(self, group: list[tuple[str, Vector]]) -> UrdfLink:
        """Return links that are fixed to each other as one."""
        parts = [(_inertial(self._links[name]), pose) for name, pose in group]
        mass = sum(part[0] for part, _ in parts)
        centre, inertia = np.zeros(3), np.zeros((3, 3))
        if mass > 0.0:
            places = [(m, pose[:3, :3] @ c + pose[:3, 3]) for (m, c, _), pose in parts]
            centre = np.asarray(sum((m * c for m, c in places), np.zeros(3)) / mass)
            for (m, _, own), (_, place), pose in zip(
                (part for part, _ in parts), places, (pose for _, pose in parts), strict=True
            ):
                r = place - centre
                inertia += pose[:3, :3] @ own @ pose[:3, :3].T
                inertia += m * (r @ r * np.eye(3) - np.outer(r, r))
        return UrdfLink(
            name=group[0][0],
            mass_kg=mass,
            centre_m=centre,
            inertia_kg_m2=inertia,
            visuals=self._meshes(group, "visual"),
            collisions=self._meshes(group, "collision"),
        )

    def _meshes(self, group: list[tuple[str, Vector]], tag: str) -> tuple[UrdfMesh, ...]:
        return tuple(
            UrdfMesh(
                file=self._resolve(mesh.attrib["filename"]),
                pose=pose @ _pose(element.find("origin")),
                scale=_numbers(mesh.attrib.get("scale", "1 1 1")),
            )
            for name, pose in group
            for element in self._links[name].findall(tag)
            if (mesh := element.find("geometry/mesh")) is not None
        )

    def _resolve(self, name: str) -> Path:
        if name.startswith("package://"):
            # The first part names the package, whose folder ``share`` is.
            return self._share.joinpath(*name.removeprefix("package://").split("/")[1:])
        return (self._file.parent / name.removeprefix("file://")).resolve()


def _inertial(link: ET.Element) -> tuple[float, Vector, Vector]:
    """Return mass, centre and inertia about it in the link's axes; zero where there is none."""
    element = link.find("inertial")
    if element is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    mass, tensor = element.find("mass"), element.find("inertia")
    pose = _pose(element.find("origin"))
    given = {} if tensor is None else tensor.attrib
    xx, xy, xz, yy, yz, zz = (
        float(given.get(key, 0.0)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turn = pose[:3, :3]
    return (
        0.0 if mass is None else float(mass.attrib["value"]),
        pose[:3, 3],
        np.asarray(turn @ own @ turn.T),
    )


def _link_of(joint: ET.Element, role: str) -> str:
    element = joint.find(role)
    assert element is not None, f"joint {joint.attrib['name']} has no {role}"
    return element.attrib["link"]


def _numbers(text: str) -> Vector:
    return np.array([float(part) for part in text.split()])


def _pose(origin: ET.Element | None) -> Vector:
    """Return the homogeneous transform (4, 4) of an ``origin``."""
    pose = np.eye(4)
    if origin is not None:
        pose[:3, :3] = rotation_rpy(_numbers(origin.attrib.get("rpy", "0 0 0")))
        pose[:3, 3] = _numbers(origin.attrib.get("xyz", "0 0 0"))
    return pose


def rotation_rpy(rpy: Vector) -> Vector:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll) (3, 3), URDF's order, from (roll, pitch, yaw) [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
