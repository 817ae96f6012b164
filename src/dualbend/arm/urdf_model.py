"""An arm from a URDF as a MuJoCo specification: bodies, joints with their drives, flange, looks."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from dualbend.arm.catalog import PACKAGE, URDF_ARMS, ArmName, UrdfFacts
from dualbend.arm.collada import read_collada
from dualbend.arm.mjcf import FLANGE_SITE
from dualbend.arm.urdf import (
    UrdfChain,
    UrdfLink,
    UrdfMesh,
    package_folder,
    read_chain,
    rotation_rpy,
)
from dualbend.errors import InputError
from dualbend.types import Vector

_LIGHT, _DARK = (0.86, 0.87, 0.88, 1.0), (0.36, 0.42, 0.50, 1.0)
_HARD_FRICTION: Final = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Nearly hard dry friction, as the PUMA's: the default smears it over 5 mrad/s."""

_NEIGHBOURS = 2
"""Links this near in the chain overlap at their joints: their capsules do not collide."""

_STL_HEADER = 84
_STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


@functools.cache
def urdf_chain(name: ArmName) -> UrdfChain:
    """Return the chain of an arm of the package, base to flange with z outward.

    Raises
    ------
    InputError
        The package is not installed, or its file is not as expected.
    """
    facts = URDF_ARMS[name]
    share = package_folder(PACKAGE)
    chain = read_chain(share / "robots" / facts.file, facts.base, facts.flange, share)
    return _turned(chain, facts)


def torque_limits(name: ArmName) -> tuple[float, ...]:
    """Return the joints' torque limits (n,) [N m]: the URDF's, unless they are known wrong."""
    known = URDF_ARMS[name].torque_limit_n_m
    return known or tuple(joint.effort_n_m for joint in urdf_chain(name).joints)


def _turned(chain: UrdfChain, facts: UrdfFacts) -> UrdfChain:
    flange = chain.flange.copy()
    flange[:3, :3] = flange[:3, :3] @ rotation_rpy(np.array(facts.flange_rpy))
    return UrdfChain(base=chain.base, joints=chain.joints, links=chain.links, flange=flange)


def load_urdf_arm(name: ArmName, *, looks: bool = True) -> mujoco.MjSpec:
    """Return a fresh specification of one arm without actuators or tool.

    Bodies ``base`` and ``link1`` ... ``link<n>``, whose frames are the URDF's; gravity is held up
    by the joints' own drives, as :func:`dualbend.arm.mjcf.load_puma` has it. Meshes are looked
    at, capsules around them collide.
    """
    chain, armature = urdf_chain(name), URDF_ARMS[name].armature_kg_m2
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    body = spec.worldbody.add_body(name="base")
    _add_shape(spec, body, chain.base, "base", looks=looks)
    limits = torque_limits(name)
    for i, (joint, link) in enumerate(zip(chain.joints, chain.links, strict=True), 1):
        body = body.add_body(
            name=f"link{i}", pos=joint.pose[:3, 3], quat=quaternion(joint.pose[:3, :3])
        )
        body.gravcomp = 1.0
        body.explicitinertial = True
        body.mass, body.ipos = link.mass_kg, link.centre_m
        body.fullinertia = link.inertia_kg_m2[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        body.add_joint(
            name=f"joint{i}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=joint.axis,
            range=joint.range_rad,
            limited=True,
            armature=armature,
            damping=joint.damping,
            frictionloss=joint.friction,
            solimp_friction=_HARD_FRICTION,
            actfrcrange=[-limits[i - 1], limits[i - 1]],
            actfrclimited=True,
            actgravcomp=True,
        )
        _add_shape(spec, body, link, f"link{i}", looks=looks)
    body.add_site(
        name=FLANGE_SITE,
        pos=chain.flange[:3, 3],
        quat=quaternion(chain.flange[:3, :3]),
        group=4,
        size=[0.006, 0.006, 0.006],
        rgba=[0.9, 0.2, 0.1, 1.0],
    )
    _exclude_neighbours(spec, len(chain.joints))
    return spec


def _add_shape(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, link: UrdfLink, name: str, *, looks: bool
) -> None:
    """Give a body its meshes to look at and a capsule around them that collides."""
    if looks:
        for i, mesh in enumerate(link.visuals):
            _add_look(spec, body, mesh, f"{name}_{i}", _DARK if name[-1] in "246" else _LIGHT)
    solid = link.collisions or link.visuals
    if not solid:
        return
    middle, axis, radius, half = capsule(np.concatenate([corners(mesh) for mesh in solid]))
    turn = np.roll(np.eye(3), 2 - axis, axis=1)
    body.add_geom(
        name=f"{name}_c",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[radius, half, 0.0],
        pos=middle,
        quat=quaternion(turn),
        mass=0.0,
        contype=1,
        conaffinity=1,
        group=3,
        rgba=[0.3, 0.5, 0.9, 0.4],
    )


def _is_stl(mesh: UrdfMesh) -> bool:
    return mesh.file.suffix.lower() == ".stl"


def _add_look(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    mesh: UrdfMesh,
    name: str,
    shade: tuple[float, ...],
) -> None:
    """Show a mesh: an STL in a shade, a COLLADA file in its own colours."""
    if _is_stl(mesh):
        shape = spec.add_mesh(name=name, file=str(mesh.file), scale=mesh.scale)
        _add_mesh(body, shape, mesh, shade)
        return
    for i, part in enumerate(read_collada(mesh.file)):
        shape = spec.add_mesh(
            name=f"{name}_{i}",
            uservert=(part.vertices * mesh.scale).ravel(),
            userface=part.faces.ravel(),
        )
        _add_mesh(body, shape, mesh, part.rgba)


def _add_mesh(
    body: mujoco.MjsBody, shape: mujoco.MjsMesh, mesh: UrdfMesh, rgba: tuple[float, ...]
) -> None:
    # Open surfaces have no volume, and their mass is not asked for.
    shape.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=shape.name,
        pos=mesh.pose[:3, 3],
        quat=quaternion(mesh.pose[:3, :3]),
        rgba=rgba,
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=2,
    )


def _exclude_neighbours(spec: mujoco.MjSpec, count: int) -> None:
    names = ["base", *(f"link{i + 1}" for i in range(count))]
    for i, first in enumerate(names):
        for second in names[i + 1 : i + 1 + _NEIGHBOURS]:
            spec.add_exclude(bodyname1=first, bodyname2=second)


@functools.lru_cache(maxsize=64)
def _stl(file: Path) -> Vector:
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: the arm's mesh cannot be read: {error.strerror}") from error
    count = int(np.frombuffer(raw, "<u4", 1, 80)[0]) if len(raw) >= _STL_HEADER else 0
    if len(raw) != _STL_HEADER + count * _STL_RECORD.itemsize or not count:
        raise InputError(f"{file}: no binary STL")
    triangles = np.frombuffer(raw, _STL_RECORD, count, _STL_HEADER)
    return np.asarray(triangles["corners"].reshape(-1, 3), dtype=np.float64)


def corners(mesh: UrdfMesh) -> Vector:
    """Return the corners (k, 3) of a mesh's triangles in the link's frame [m]."""
    if _is_stl(mesh):
        points = _stl(mesh.file)
    else:
        points = np.concatenate([part.vertices for part in read_collada(mesh.file)])
    return np.asarray((points * mesh.scale) @ mesh.pose[:3, :3].T + mesh.pose[:3, 3])


def capsule(points: Vector) -> tuple[Vector, int, float, float]:
    """Return middle (3,), axis (0, 1, 2), radius and half length of a capsule about points (k, 3).

    Along the longest side of their box, as thick as the mean of the other two: a little too thin at
    the corners, a little too thick at the faces.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    axis = int(np.argmax(size))
    radius = 0.25 * float(size.sum() - size[axis])
    return 0.5 * (low + high), axis, radius, max(0.5 * float(size[axis]) - radius, 1e-3)


def quaternion(rotation: Vector) -> Vector:
    """Return the quaternion (4,), w first, of a rotation (3, 3)."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(rotation).ravel())
    return found
