"""Meshes of an arm's links through trimesh: corners to put capsules about, triangles to show."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.types import Vector

GRAIN_M: Final = 0.004
"""Corners nearer than this become one: files of 20 000 triangles a link keep some 2000."""

_COLOURED = (".dae",)
"""What is drawn to be looked at, finely and in several colours."""

_FEWEST_FACES = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class ColouredMesh:
    """Triangles of one colour: corners (m, 3) [m], indices (k, 3), rgba where the file has one."""

    vertices: Vector
    faces: NDArray[np.intp]
    rgba: tuple[float, ...] | None


@functools.lru_cache(maxsize=64)
def read_mesh(file: Path) -> tuple[ColouredMesh, ...]:
    """Return the triangles of a file in its own frame; COLLADA coarsened, one mesh per colour.

    Raises
    ------
    InputError
        The file cannot be read, or holds no triangles.
    """
    import trimesh  # noqa: PLC0415  (an arm without mesh files does without)

    try:
        parts = trimesh.load_scene(file, process=False).dump()
    except Exception as error:  # each format's reader raises errors of its own
        raise InputError(f"{file}: the arm's mesh cannot be read: {error}") from error
    found: dict[tuple[float, ...], list[Vector]] = {}
    for part in parts:
        if part.units is not None:
            part.convert_units("meters")
        # A mesh has its colour of a material, or of its own.
        colour = getattr(part.visual, "material", part.visual).main_color
        rgba = tuple(float(value) for value in (colour / 255.0).round(3))
        found.setdefault(rgba, []).append(part.triangles.reshape(-1, 3))
    if file.suffix.lower() in _COLOURED:
        meshes = [coarsened(np.concatenate(points), rgba) for rgba, points in found.items()]
    else:
        for part in parts:
            part.merge_vertices()
        meshes = [
            ColouredMesh(vertices=part.vertices, faces=part.faces, rgba=None) for part in parts
        ]
    kept = tuple(mesh for mesh in meshes if len(mesh.faces) >= _FEWEST_FACES)
    if not kept:
        raise InputError(f"{file}: no triangles in the arm's mesh")
    return kept


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
