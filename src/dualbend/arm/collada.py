"""The triangles and colours of a COLLADA file, coarsened: what an arm looks like from a metre.

Only what the package's files have is read: triangles and polygons, the matrices of their nodes, one
diffuse colour a material. No loader is imported.
"""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.types import Vector

Faces = NDArray[np.intp]

GRAIN_M: Final = 0.004
"""Corners nearer than this become one: files of 20 000 triangles a link keep some 2000."""

_NAMES = {"c": "http://www.collada.org/2005/11/COLLADASchema"}
_GREY = (0.7, 0.7, 0.7, 1.0)
_FEWEST_FACES = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class ColouredMesh:
    """Triangles of one colour: corners (m, 3) [m], indices (k, 3), rgba."""

    vertices: Vector
    faces: Faces
    rgba: tuple[float, ...]


@functools.lru_cache(maxsize=64)
def read_collada(file: Path) -> tuple[ColouredMesh, ...]:
    """Return the meshes of a file, one a colour, in its own frame and metres, z up.

    Raises
    ------
    InputError
        The file cannot be read, or holds no triangles.
    """
    try:
        root = ET.parse(file).getroot()
    except (OSError, ET.ParseError) as error:
        raise InputError(f"{file}: the arm's mesh cannot be read: {error}") from error
    colours, to_metres = _colours(root), _to_metres(root)
    found: dict[tuple[float, ...], list[Vector]] = {}
    geometries = {g.attrib["id"]: g for g in root.iterfind(".//c:geometry", _NAMES)}
    for node, pose in _nodes(root.find(".//c:visual_scene", _NAMES), to_metres):
        for instance in node.iterfind("c:instance_geometry", _NAMES):
            bound = {
                b.attrib["symbol"]: b.attrib["target"].removeprefix("#")
                for b in instance.iterfind(".//c:instance_material", _NAMES)
            }
            for symbol, corners in _triangles(geometries[instance.attrib["url"][1:]]):
                rgba = colours.get(bound.get(symbol, ""), _GREY)
                found.setdefault(rgba, []).append(corners @ pose[:3, :3].T + pose[:3, 3])
    meshes = (coarsened(np.concatenate(parts), rgba) for rgba, parts in found.items())
    kept = tuple(mesh for mesh in meshes if len(mesh.faces) >= _FEWEST_FACES)
    if not kept:
        raise InputError(f"{file}: no triangles in the COLLADA file")
    return kept


def coarsened(corners: Vector, rgba: tuple[float, ...]) -> ColouredMesh:
    """Return triangles (3 k, 3) with corners of one grain joined at their mean."""
    _, index = np.unique(np.round(corners / GRAIN_M).astype(np.int64), axis=0, return_inverse=True)
    index = index.ravel()
    count = np.bincount(index)
    vertices = np.stack([np.bincount(index, corners[:, i]) / count for i in range(3)], axis=1)
    faces = index.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    # The same triangle twice, from either side of a thin wall, is one.
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[np.sort(first)]
    used, faces = np.unique(faces, return_inverse=True)
    return ColouredMesh(vertices=vertices[used], faces=faces.reshape(-1, 3), rgba=rgba)


def _nodes(parent: ET.Element | None, pose: Vector) -> list[tuple[ET.Element, Vector]]:
    """Return all nodes below one with their poses (4, 4)."""
    found = []
    for node in [] if parent is None else parent.findall("c:node", _NAMES):
        matrix = node.find("c:matrix", _NAMES)
        own = np.eye(4) if matrix is None else _floats(matrix).reshape(4, 4)
        found.append((node, pose @ own))
        found += _nodes(node, pose @ own)
    return found


def _triangles(geometry: ET.Element) -> list[tuple[str, Vector]]:
    """Return material and corners (3 k, 3) of each set of triangles."""
    sources = {s.attrib["id"]: s for s in geometry.iterfind(".//c:source", _NAMES)}
    places = geometry.find(".//c:vertices/c:input[@semantic='POSITION']", _NAMES)
    if places is None:
        return []
    array = sources[places.attrib["source"][1:]].find("c:float_array", _NAMES)
    assert array is not None
    vertices = _floats(array).reshape(-1, 3)
    found = []
    for part in (
        *geometry.iterfind(".//c:triangles", _NAMES),
        *geometry.iterfind(".//c:polylist", _NAMES),
    ):
        indices = part.find("c:p", _NAMES)
        if indices is None or not indices.text:
            continue
        inputs = part.findall("c:input", _NAMES)
        offsets = [int(i.attrib["offset"]) for i in inputs]
        vertex = next(int(i.attrib["offset"]) for i in inputs if i.attrib["semantic"] == "VERTEX")
        every = np.array(indices.text.split(), dtype=np.int64).reshape(-1, max(offsets) + 1)
        counts = part.find("c:vcount", _NAMES)
        corners = every[:, vertex] if counts is None else _fans(every[:, vertex], counts)
        found.append((part.attrib.get("material", ""), vertices[corners]))
    return found


def _fans(corners: NDArray[np.int64], counts: ET.Element) -> NDArray[np.int64]:
    """Return polygons as triangles about their first corners (3 k,)."""
    sizes = np.array((counts.text or "").split(), dtype=np.int64)
    starts = np.concatenate(([0], np.cumsum(sizes)[:-1]))
    triangles = [
        np.stack((starts[some], starts[some] + i, starts[some] + i + 1), axis=1)
        for i in range(1, int(sizes.max()) - 1)
        for some in (np.flatnonzero(sizes > i + 1),)
    ]
    return np.asarray(corners[np.concatenate(triangles).ravel()])


def _colours(root: ET.Element) -> dict[str, tuple[float, ...]]:
    """Return the diffuse colour of each material."""
    effects = {}
    for effect in root.iterfind(".//c:effect", _NAMES):
        colour = effect.find(".//c:diffuse/c:color", _NAMES)
        if colour is not None:
            effects[effect.attrib["id"]] = tuple(_floats(colour).round(3).tolist())
    found = {}
    for material in root.iterfind(".//c:material", _NAMES):
        instance = material.find("c:instance_effect", _NAMES)
        key = "" if instance is None else instance.attrib["url"][1:]
        found[material.attrib["id"]] = effects.get(key, _GREY)
    return found


def _to_metres(root: ET.Element) -> Vector:
    """Return the matrix (4, 4) from the file's axes and unit to metres with z up."""
    unit, up = root.find("c:asset/c:unit", _NAMES), root.find("c:asset/c:up_axis", _NAMES)
    scale = 1.0 if unit is None else float(unit.attrib.get("meter", 1.0))
    turn = np.eye(4)
    if up is not None and up.text == "Y_UP":
        turn[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    return np.asarray(turn * np.array([scale, scale, scale, 1.0])[:, None])


def _floats(element: ET.Element) -> Vector:
    return np.array((element.text or "").split(), dtype=np.float64)
