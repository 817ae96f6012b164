"""A sheet between clamps in CalculiX: the input deck, the run, the loads read from its listing.

Twenty-node bricks with reduced integration (C3D20R), one through the thickness: what CalculiX makes
of its own shell S8R, and on solids symmetry planes and clamps are plain displacements. A quarter is
meshed: x from the left clamp to the middle, y from the middle of the width to one edge. The sheet
is flat and free of stress; its end is tilted in small steps while the clamps come together as far
as a circular arc asks (no end force, so no buckling point is passed), then brought to the pose.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dualbend.beam.sheet import Sheet

Vector = NDArray[np.float64]

EXECUTABLES = ("ccx", "ccx_2.20", "ccx_2.21", "ccx_2.22")
TILT_STEP_RAD = 0.05
"""Tilt between two steps of the way to the first pose."""
FIRST_INCREMENT = 0.05
"""Part of the way between two poses with which CalculiX begins."""
TIME_LIMIT_S = 900.0

_BRICK = (
    *((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)),
    *((1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)),
    *((0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)),
)
"""Node order of C3D20 in half spacings."""


def executable() -> str | None:
    """Return CalculiX's solver on this machine, or None."""
    return next((found for name in EXECUTABLES if (found := shutil.which(name))), None)


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Elements of the quarter: along half the length, across half the width; plane strain or not.

    ``clamp_grading``, ``edge_grading``: how much shorter an element is at the clamp, and narrower
    at the free edge, than one in the middle. The clamp does not let the thickness change, which
    stiffens the elements beside it: an error of the order of their length, hence short ones.
    """

    along: int = 24
    across: int = 8
    clamp_grading: float = 40.0
    edge_grading: float = 12.0
    plane_strain: bool = False


@dataclass(frozen=True, kw_only=True)
class PlateLoads:
    """End force P [N] (compression positive) and moment at the left clamp [N m], both (n,)."""

    force_n: Vector
    moment_nm: Vector


def clamped_loads(
    sheet: Sheet, poses: Sequence[tuple[float, float]], mesh: Mesh, folder: Path
) -> PlateLoads:
    """Return the loads at poses (α [rad], half distance [m]), one after another.

    Raises RuntimeError where CalculiX does not finish.
    """
    solver = executable()
    if solver is None:
        raise RuntimeError("CalculiX is not installed")
    nodes, elements = _mesh(sheet, mesh)
    steps = [*_way(poses[0][0]), *poses]
    face = np.flatnonzero(np.isclose(nodes[:, 0], -sheet.length_m / 2.0))
    folder.mkdir(parents=True, exist_ok=True)
    deck = "\n".join(_deck(sheet, mesh, nodes, elements, face, steps))
    (folder / "sheet.inp").write_text(deck + "\n", encoding="ascii")
    done = subprocess.run(
        [solver, "-i", "sheet"],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT_S,
        check=False,
    )
    reactions = _reactions(folder / "sheet.dat") if "Job finished" in done.stdout else []
    if len(reactions) != len(steps):
        raise RuntimeError(f"CalculiX stopped after {len(reactions)} of {len(steps)} steps")
    loads = []
    for (alpha, _), reaction in zip(steps, reactions, strict=True):
        place = _clamped(nodes[face], sheet.length_m, alpha)
        force = np.array([reaction[int(n) + 1] for n in face])
        # The clamp on the quarter → the sheet's whole width on the gripper, about its centre.
        moment = place[:, 2] * force[:, 0] - (place[:, 0] + sheet.length_m / 2.0) * force[:, 2]
        loads.append((2.0 * force[:, 0].sum(), -2.0 * moment.sum()))
    force_n, moment_nm = np.array(loads[-len(poses) :]).T
    return PlateLoads(force_n=force_n, moment_nm=moment_nm)


def _way(alpha: float) -> list[tuple[float, float | None]]:
    """Return the tilts up to α with the middle free to follow."""
    count = math.ceil(alpha / TILT_STEP_RAD)
    return [(tilt, None) for tilt in np.linspace(0.0, alpha, count + 1)[1:].tolist()]


def _mesh(sheet: Sheet, mesh: Mesh) -> tuple[Vector, NDArray[np.int_]]:
    """Return nodes (n, 3) [m] and bricks (m, 20)."""
    nx, ny = 2 * mesh.along, 2 * mesh.across
    x = -_graded(sheet.length_m / 2.0, mesh.along, mesh.clamp_grading)[::-1]
    y = _graded(sheet.width_m / 2.0, mesh.across, mesh.edge_grading)
    z = np.array([-0.5, 0.0, 0.5]) * sheet.thickness_m
    number, nodes = {}, []
    for i in range(nx + 1):
        for j in range(ny + 1):
            for k in range(3):
                if i % 2 + j % 2 + k % 2 < 2:
                    number[i, j, k] = len(nodes)
                    nodes.append((x[i], y[j], z[k]))
    bricks = [
        [number[i + a, j + b, c] for a, b, c in _BRICK]
        for i in range(0, nx, 2)
        for j in range(0, ny, 2)
    ]
    return np.array(nodes), np.array(bricks)


def _graded(size: float, count: int, grading: float) -> Vector:
    """Return corners and middles (2 count + 1,) of elements that get shorter from 0 to size."""
    lengths = np.geomspace(grading, 1.0, count) if count > 1 else np.ones(1)
    corners = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum() * size
    return np.interp(np.arange(2 * count + 1) / 2.0, np.arange(count + 1), corners)


def _clamped(face: Vector, length: float, alpha: float) -> Vector:
    """Return where the nodes of the clamped face (n, 3) are when it is tilted about its middle."""
    through, along = face[:, 2], face[:, 0] + length / 2.0
    c, s = math.cos(alpha), math.sin(alpha)
    x = -length / 2.0 + c * along + s * through
    return np.stack([x, face[:, 1], -s * along + c * through], axis=-1)


def _deck(
    sheet: Sheet,
    mesh: Mesh,
    nodes: Vector,
    elements: NDArray[np.int_],
    face: NDArray[np.int_],
    steps: Sequence[tuple[float, float | None]],
) -> Iterator[str]:
    yield "*NODE, NSET=ALL"
    yield from (f"{i},{x:.12g},{y:.12g},{z:.12g}" for i, (x, y, z) in enumerate(nodes, 1))
    yield "*ELEMENT, TYPE=C3D20R, ELSET=SHEET"
    for i, brick in enumerate(elements + 1, 1):
        yield f"{i}," + ",".join(map(str, brick[:15])) + ","
        yield ",".join(map(str, brick[15:]))
    middle = np.flatnonzero(np.isclose(nodes[:, 0], 0.0))
    flat = np.arange(len(nodes)) if mesh.plane_strain else np.flatnonzero(nodes[:, 1] == 0.0)
    for name, members in (("CLAMP", face), ("MIDDLE", middle), ("NOY", np.setdiff1d(flat, face))):
        yield f"*NSET, NSET={name}"
        yield from (f"{n}," for n in members + 1)
    yield from ("*MATERIAL, NAME=METAL", "*ELASTIC", f"{sheet.young_pa:.12g},{sheet.poisson_ratio}")
    yield "*SOLID SECTION, ELSET=SHEET, MATERIAL=METAL"
    reference, *others = (middle + 1).tolist()
    for n in others:
        yield from ("*EQUATION", "2", f"{n},1,1.,{reference},1,-1.")
    yield from ("*BOUNDARY", "NOY,2,2")
    for alpha, half_distance in steps:
        moved = _clamped(nodes[face], sheet.length_m, alpha) - nodes[face]
        first = 1.0 if half_distance is None else FIRST_INCREMENT
        yield from ("*STEP, NLGEOM, INC=1000", "*STATIC", f"{first},1.,1e-5,1.", "*BOUNDARY")
        for n, shift in zip(face + 1, moved, strict=True):
            yield from (f"{n},{i},{i},{value:.11e}" for i, value in enumerate(shift, 1))
        if half_distance is not None:
            yield f"{reference},1,1,{half_distance - sheet.length_m / 2.0:.11e}"
        yield from ("*NODE PRINT, NSET=CLAMP, FREQUENCY=1000", "RF")
        yield from ("*NODE PRINT, NSET=MIDDLE, FREQUENCY=1000", "U", "*END STEP")


def _reactions(listing: Path) -> list[dict[int, tuple[float, float, float]]]:
    """Return the reactions of the clamp's nodes at the end of each step [N]."""
    found: list[dict[int, tuple[float, float, float]]] = []
    for line in listing.read_text(encoding="ascii").splitlines():
        if line.lstrip().startswith("forces"):
            found.append({})
        elif re.match(r"\s+\d+(\s+\S+){3}\s*$", line):
            number, *values = line.split()
            found[-1][int(number)] = (float(values[0]), float(values[1]), float(values[2]))
    return found
