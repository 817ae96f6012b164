"""Shapes of an arm's links from mesh files, read by trimesh: capsules that collide, and looks."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError, refusing
from dualbend.types import Vector

if TYPE_CHECKING:
    import trimesh

GRAIN_M: Final = 0.004
"""Corners nearer than this become one: files of 20 000 triangles a link keep some 2000."""

_LIGHT, _DARK = (0.86, 0.87, 0.88, 1.0), (0.36, 0.42, 0.50, 1.0)

_PLAIN = (".stl", ".obj")
"""Shown as they are, in a shade; other files are drawn finely and in several colours."""

_FEWEST_FACES = 8

_NO_COLOUR = (0.5, 0.5, 0.5, 1.0)
"""What MuJoCo has of a geom to which no colour is given."""

_UNIT_BOX: Final = np.array([*itertools.product((-1.0, 1.0), repeat=3)])

_SOLIDS: Final = {
    mujoco.mjtGeom.mjGEOM_BOX: lambda size: size,
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda size: size[[0, 0, 0]],
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: lambda size: size,
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda size: size[[0, 0, 1]],
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda size: size[[0, 0, 1]] + [0.0, 0.0, size[0]],
}
"""Half sides of the box around a shape of a file, by its kind."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ColouredMesh:
    """Triangles of one colour: corners (m, 3) [m], indices (k, 3), rgba where the file has one."""

    vertices: Vector
    faces: NDArray[np.intp]
    rgba: tuple[float, ...] | None


@functools.lru_cache(maxsize=64)
def read_mesh(file: Path) -> tuple[ColouredMesh, ...]:
    """Return the triangles of a file in its own frame; COLLADA coarsened, one mesh per colour.

    Raises InputError where the file cannot be read, or holds no triangles.
    """
    import trimesh  # noqa: PLC0415  (an arm without mesh files does without)

    # Each format's reader raises errors of its own.
    with refusing(f"{file}: the arm's mesh cannot be read", Exception):
        parts = trimesh.load_scene(file, process=False).dump()
    for part in parts:
        if part.units is not None:
            part.convert_units("meters")
    if file.suffix.lower() in _PLAIN:
        for part in parts:
            part.merge_vertices()
        meshes = [
            ColouredMesh(vertices=part.vertices, faces=part.faces, rgba=None) for part in parts
        ]
    else:
        meshes = [coarsened(corners, rgba) for rgba, corners in _by_colour(parts).items()]
    kept = tuple(mesh for mesh in meshes if len(mesh.faces) >= _FEWEST_FACES)
    if not kept:
        raise InputError(f"{file}: no triangles in the arm's mesh")
    return kept


def _by_colour(parts: list[trimesh.Trimesh]) -> dict[tuple[float, ...], Vector]:
    """Return the triangles (3 k, 3) of each rgba."""
    found: dict[tuple[float, ...], list[Vector]] = {}
    for part in parts:
        # A mesh has its colour of a material, or of its own.
        colour = getattr(part.visual, "material", part.visual).main_color
        rgba = tuple(float(value) for value in (colour / 255.0).round(3))
        found.setdefault(rgba, []).append(part.triangles.reshape(-1, 3))
    return {rgba: np.concatenate(corners) for rgba, corners in found.items()}


def coarsened(points: Vector, rgba: tuple[float, ...]) -> ColouredMesh:
    """Return triangles (3 k, 3) with corners of one grain joined at their mean."""
    import trimesh  # noqa: PLC0415

    cells = np.round(points / GRAIN_M).astype(np.int64)
    _, index = trimesh.grouping.unique_rows(cells)
    count = np.bincount(index)
    joined = np.stack([np.bincount(index, points[:, i]) / count for i in range(3)], axis=1)
    mesh = trimesh.Trimesh(joined, index.reshape(-1, 3), process=False)
    # The same triangle twice, from either side of a thin wall, is one.
    mesh.update_faces(mesh.nondegenerate_faces() & mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    return ColouredMesh(vertices=np.array(mesh.vertices), faces=np.array(mesh.faces), rgba=rgba)


def add_shapes(spec: mujoco.MjSpec, *, looks: bool) -> None:
    """Replace a parsed file's shapes by one capsule per link, which collides, and looks to see.

    Where a link has meshes, what else it has is left out.
    """
    from_file, moved = spec.meshes, 0
    for body in spec.bodies[1:]:
        moved += len(body.joints)
        shapes = body.geoms
        drawn = [geom for geom in shapes if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
        drawn = drawn or [geom for geom in shapes if geom.type in _SOLIDS]
        visual = [geom for geom in drawn if not geom.contype]
        solid = [geom for geom in drawn if geom.contype] or visual
        if solid:
            _add_capsule(body, np.concatenate([_corners(spec, geom) for geom in solid]))
        for geom in (visual or solid) if looks else ():
            _add_look(spec, body, geom, _DARK if moved in (2, 4, 6) else _LIGHT)
        for geom in shapes:
            spec.delete(geom)
    for mesh in from_file:
        spec.delete(mesh)


def _parts(mesh: mujoco.MjsMesh, rgba: tuple[float, ...] | None = None) -> tuple[ColouredMesh, ...]:
    """Return the triangles of a mesh: of its file, or as they stand there, then of a colour."""
    if mesh.file:
        return read_mesh(Path(mesh.file))
    vertices, faces = (np.array(values).reshape(-1, 3) for values in (mesh.uservert, mesh.userface))
    return (ColouredMesh(vertices=vertices, faces=faces, rgba=rgba),)


def _corners(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> Vector:
    """Return the corners (k, 3) of a geom, of its box where it is round, in the link's frame."""
    turn = np.empty(9)
    if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = spec.mesh(geom.meshname)
        points = np.concatenate([part.vertices for part in _parts(mesh)]) * mesh.scale
    else:
        points = _UNIT_BOX * _SOLIDS[geom.type](geom.size)
    mujoco.mju_quat2Mat(turn, geom.quat)
    return np.asarray(points @ turn.reshape(3, 3).T + geom.pos)


def _add_look(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, geom: mujoco.MjsGeom, shade: tuple[float, ...]
) -> None:
    """Show a geom in its own colours, or in a shade where the file has none."""
    own = None if np.array_equal(geom.rgba, _NO_COLOUR) else tuple(geom.rgba)
    if geom.type != mujoco.mjtGeom.mjGEOM_MESH:
        body.add_geom(
            type=geom.type,
            size=geom.size,
            pos=geom.pos,
            quat=geom.quat,
            rgba=own or shade,
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=2,
        )
        return
    mesh = spec.mesh(geom.meshname)
    for i, part in enumerate(_parts(mesh, own)):
        name = f"{body.name}_{mesh.name}_{i}"
        while spec.mesh(name) is not None:  # a link may show one mesh twice
            name += "_"
        shape = spec.add_mesh(
            name=name,
            uservert=(part.vertices * mesh.scale).ravel(),
            userface=part.faces.ravel(),
            # Open surfaces have no volume, and their mass is not asked for.
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=shape.name,
            pos=geom.pos,
            quat=geom.quat,
            rgba=part.rgba or shade,
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=2,
        )


def _add_capsule(body: mujoco.MjsBody, points: Vector) -> None:
    """Put a capsule that collides about points (k, 3) in the body's frame.

    Along the longest side of their box, as thick as the mean of the other two: a little too thin at
    the corners, a little too thick at the faces.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    axis = int(np.argmax(size))
    radius = 0.25 * float(size.sum() - size[axis])
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.roll(np.eye(3), 2 - axis, axis=1).ravel())
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[radius, max(0.5 * float(size[axis]) - radius, 1e-3), 0.0],
        pos=0.5 * (low + high),
        quat=quat,
        mass=0.0,
        contype=1,
        conaffinity=1,
        group=3,
        rgba=[0.3, 0.5, 0.9, 0.4],
    )
