"""The flexible sheet as a plate: a grid of vertices with membrane and bending elasticity.

Columns of vertices stand at arc lengths ``(i − 1/2) h``, ``h = L/N``, i from 0 to N + 1; the first
two and the last two are the grips'. So it bends at ``(i + 1/2) h`` as the strips do, each clamp
holds the sheet where it ends, and the error is O(h²). Rows stand at both edges and in the middles
of M cells between, so that it bends across in each cell's middle, for the same reason.

Two of MuJoCo's flexes share the vertices, and both are only containers: their numbers are written
into the compiled model by :func:`set_elasticity`, since MuJoCo's own are no thin plate.

* Its bending of triangles is on a grid D/2 ∫ κ_x² + κ_y² + 6 κ_xy² (and a bias along the
  diagonals): no coupling by Poisson's ratio, and 4.5 times too stiff in twist (ν = 0.33). What it
  sums is a quadratic form of four vertices a hinge though, and they may be any four. So the second
  flex lists hinges, each with its own vertices, whose sum is Kirchhoff's plate by finite
  differences: ``D/2 ∫ κ_x² + κ_y² + 2ν κ_x κ_y + 2 (1 − ν) κ_xy²``, ``D = E t³ / 12 (1 − ν²)``.
  It holds for large deflections as far as the sheet does not stretch, since second derivatives of
  the place are then curvatures times the normal.
* Its stretching of triangles locks: where the sheet is bent and off its middle surface too, as at
  free edges that curl, they see a shear that is not there. The first flex has a flat tetrahedron a
  cell, whose form in its six edges' lengths can be any; it is a bilinear plane-stress element with
  the shear of its middle.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import mujoco
import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.scene.contacts import sheet_bits
from dualbend.scene.mjcf import DRAWN, SHEET_RGBA, SITE, about_z, make_plate
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, damping_time
from dualbend.types import Tagged, Vector, said

MEMBRANE, BENDING = "sheet_membrane", "sheet_bending"
"""Names of the two flexes."""

_BLOCK, _CELL = 17, 24
"""Numbers that MuJoCo keeps of a hinge, its 4 x 4 form and one for a curved rest shape; and of a
tetrahedron, the upper half of its 6 x 6 form and three more."""

_EDGE_MASS_KG, _EDGE_INERTIA_KG_M2 = 0.1, 1e-4
"""Inertia without weight that an edge gets from its gripper, which it is welded to: grams alone,
against the membrane's stiffness, are more than the solver's preconditioner bears."""


class ShellConfig(Tagged, tag="shell"):
    """A plate, at many times the cost: how finely it is divided and how it is damped."""

    cells_along: Annotated[int, said("between the grips, even", ge=8, le=100)] = 20
    cells_across: Annotated[int, said("over the width", ge=2, le=60)] = 4
    damping_ratio: Annotated[float, said("of the first clamped bending mode", ge=0, lt=1)] = 0.02

    def __post_init__(self) -> None:
        """Refuse an odd number of cells along: the middle of the sheet is that of a cell."""
        if self.cells_along % 2:
            raise ValueError(f"cells_along must be even, got {self.cells_along}")

    @property
    def sections(self) -> int:
        """Number of places along the sheet at which it bends."""
        return self.cells_along


@dataclass(frozen=True)
class Hinge:
    """Four vertices (column, row), whose weighted sum is a curvature [1/m], and its stiffness.

    The energy is ``stiffness |Σ weights_k x_k|² / 2`` with the stiffness D times an area [N m³].
    """

    vertices: tuple[tuple[int, int], ...]
    weights: tuple[float, float, float, float]
    stiffness: float = 0.0


def end_body(end: str) -> str:
    """Name of the body that holds an edge's vertices, and of its free joint."""
    return f"{end}_edge"


def vertex_body(column: int, row: int) -> str:
    """Name of a free vertex's body; columns 2 to N - 1."""
    return f"sheet_vertex_{column:03d}_{row:02d}"


def column_arcs(sheet: Sheet, config: ShellConfig) -> Vector:
    """Return the arc length of each column of vertices (N + 2,) [m]."""
    h = sheet.length_m / config.cells_along
    return np.asarray(h * (np.arange(config.cells_along + 2) - 0.5))


def row_places(sheet: Sheet, config: ShellConfig) -> Vector:
    """Return each row's place across the sheet, along the world's y (M + 2,) [m].

    Both edges, and the middles of the M cells: the outer two gaps are half as wide.
    """
    half, m = 0.5 * sheet.width_m, config.cells_across
    middles = sheet.width_m * ((np.arange(m) + 0.5) / m - 0.5)
    return np.concatenate(([-half], middles, [half]))


def row_shares(sheet: Sheet, config: ShellConfig) -> Vector:
    """Return the width that each row stands for (M + 2,) [m]."""
    gaps = np.concatenate(([0.0], np.diff(row_places(sheet, config)), [0.0]))
    return np.asarray(0.5 * (gaps[:-1] + gaps[1:]), dtype=np.float64)


def hinges(sheet: Sheet, config: ShellConfig) -> list[Hinge]:
    """Return the bending energy as hinges; each inner row bends across for a whole cell.

    ``2 κ_x κ_y = (κ_x² + c² κ_y² − (κ_x − c κ_y)²) / c``, with the c that takes the vertex at the
    crossing out of the last. The twist cells beside a clamp stand for one and a half cell each.
    """
    n, m = config.cells_along, config.cells_across
    hx, hy, gaps = sheet.length_m / n, sheet.width_m / m, np.diff(row_places(sheet, config))
    nu = sheet.poisson_ratio
    D = sheet.young_pa * sheet.thickness_m**3 / (12.0 * (1.0 - nu**2))
    shares = row_shares(sheet, config)
    found = []
    for i, j in itertools.product(range(1, n + 1), range(m + 2)):
        # The second vertex has no weight: any that is not on the line of the three.
        beside = (i, j + (1 if j == 0 else -1))
        along = Hinge(((i, j), beside, (i - 1, j), (i + 1, j)), _second(hx, hx, hx))
        if not 0 < j <= m:
            found.append(replace(along, stiffness=D * hx * shares[j]))
            continue
        weights = _second(gaps[j - 1], gaps[j], hy)
        across = Hinge(((i, j), (i + 1, j), (i, j - 1), (i, j + 1)), weights)
        c = along.weights[0] / weights[0]
        coupling = nu * D * hx * hy / c
        crossed = (*across.vertices[2:], *along.vertices[2:])
        found += [
            replace(along, stiffness=D * hx * shares[j] + coupling),
            replace(across, stiffness=D * hx * hy + c**2 * coupling),
            Hinge(crossed, (-c * weights[2], -c * weights[3], *along.weights[2:]), -coupling),
        ]
    for i, (j, gap) in itertools.product(range(1, n), enumerate(gaps.tolist())):
        area = hx * (1.5 if i in (1, n - 1) else 1.0) * gap
        corners = ((i, j), (i + 1, j + 1), (i + 1, j), (i, j + 1))
        weights = (1 / area, 1 / area, -1 / area, -1 / area)
        found.append(Hinge(corners, weights, 2.0 * D * (1.0 - nu) * area))
    return found


def _second(gap: float, next_gap: float, share: float) -> tuple[float, float, float, float]:
    """Return the weights of at, beside, before and after whose sum is the fold over a length."""
    a, b = 1.0 / (gap * share), 1.0 / (next_gap * share)
    return -a - b, 0.0, a, b


def add_shell(
    spec: mujoco.MjSpec, sheet: Sheet, config: ShellConfig, middle_position_m: Vector
) -> None:
    """Add the flat sheet to ``spec``, its middle at ``middle_position_m`` (3,), set up the solver.

    Its ends have the sites that the strips' have. :func:`set_elasticity` must be called on the
    compiled model.
    """
    # The rows of a flex are sparse, and its membrane is a million times stiffer than its bending,
    # which the 100 iterations of the default do not always resolve.
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    spec.option.iterations, spec.option.tolerance = 3000, 1e-6
    n, m = config.cells_along, config.cells_across
    arcs, rows = column_arcs(sheet, config), row_places(sheet, config)
    h, masses = sheet.length_m / n, sheet.mass_kg * row_shares(sheet, config) / sheet.width_m / n
    middle, to_end = np.asarray(middle_position_m), np.array([sheet.length_m / 2, 0.0, 0.0])
    _add_edge(spec, LEFT_END, sheet, h, middle - to_end, 0.0)
    _add_edge(spec, RIGHT_END, sheet, h, middle + to_end, np.pi)
    for i, j in itertools.product(range(2, n), range(m + 2)):
        place = [arcs[i] - sheet.length_m / 2, rows[j], 0.0]
        body = spec.worldbody.add_body(name=vertex_body(i, j), pos=middle + place)
        body.explicitinertial, body.mass, body.inertia = True, masses[j], [1e-9] * 3
        for axis, letter in zip(np.eye(3), "xyz", strict=True):
            name = f"{body.name}_{letter}"
            body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[sheet.thickness_m / 2, 0.0, 0.0],
            mass=0.0,
            **{**DRAWN, "contype": sheet_bits(arcs[i], sheet.length_m - arcs[i])},
        )
    grid = list(itertools.product(range(n + 2), range(m + 2)))
    corners = [
        (m + 2) * column + row
        for i, j in itertools.product(range(n + 1), range(m + 1))
        for column, row in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
    ]
    _add_flex(spec, sheet, config, MEMBRANE, grid, corners, 3)
    # Each hinge has its four vertices for itself: only its own two triangles share an edge.
    ends = [vertex for hinge in hinges(sheet, config) for vertex in hinge.vertices]
    pairs = [k + offset for k in range(0, len(ends), 4) for offset in (0, 1, 2, 0, 3, 1)]
    _add_flex(spec, sheet, config, BENDING, ends, pairs, 2)


def _add_edge(
    spec: mujoco.MjSpec, end: str, sheet: Sheet, h: float, place_m: Vector, yaw_rad: float
) -> None:
    """Add the body that a grip holds: two columns of vertices, the first cell's mass, the site.

    It moves freely, so that the flat sheet is the one at rest wherever the arms are.
    """
    edge = spec.worldbody.add_body(name=end_body(end), pos=place_m, quat=about_z(yaw_rad))
    edge.add_freejoint(name=end_body(end))
    make_plate(edge, sheet, h, h / 2)
    edge.add_site(name=end, **SITE)


def _add_flex(
    spec: mujoco.MjSpec,
    sheet: Sheet,
    config: ShellConfig,
    name: str,
    vertices: Sequence[tuple[int, int]],
    elements: Sequence[int],
    dimension: int,
) -> None:
    flex = spec.add_flex()
    flex.name, flex.dim, flex.radius = name, dimension, sheet.thickness_m / 2
    # Of any size: they only ask the compiler for room, which set_elasticity fills.
    flex.young, flex.poisson, flex.thickness = sheet.young_pa, 0.0, sheet.thickness_m
    if dimension == 2:
        flex.elastic2d = 1  # bending alone
    flex.damping = damping_time(sheet, config.damping_ratio)
    flex.contype = flex.conaffinity = 0
    flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.rgba = SHEET_RGBA
    flex.group = 2 if dimension == 3 else 5
    places = [_place(sheet, config, *vertex) for vertex in vertices]
    flex.vertbody = [body for body, _ in places]
    flex.vert = np.concatenate([place for _, place in places])
    flex.elem = list(elements)


def _place(sheet: Sheet, config: ShellConfig, i: int, j: int) -> tuple[str, Vector]:
    """Return a vertex's body and its place there (3,); the right G's y is minus the row's."""
    arc, y = column_arcs(sheet, config)[i], row_places(sheet, config)[j]
    if i < 2:
        return end_body(LEFT_END), np.array([arc, y, 0.0])
    if i >= config.cells_along:
        return end_body(RIGHT_END), np.array([sheet.length_m - arc, -y, 0.0])
    return vertex_body(i, j), np.zeros(3)


def set_elasticity(model: mujoco.MjModel, sheet: Sheet, config: ShellConfig) -> None:
    """Write the plate's elasticity into a compiled model, over what MuJoCo's compiler has made."""
    _set_bending(model, sheet, config)
    flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, MEMBRANE)
    gaps = np.diff(row_places(sheet, config))
    hx = sheet.length_m / config.cells_along
    forms = [membrane_form(sheet, hx, gap)[np.triu_indices(6)] for gap in gaps.tolist()]
    start, count = model.flex_stiffnessadr[flex], model.flex_elemnum[flex]
    stiffness = model.flex_stiffness[start : start + _CELL * count].reshape(count, _CELL)
    # MuJoCo's energy is a quarter of the form.
    stiffness[:] = 0.0
    stiffness[:, :21] = 2.0 * np.tile(forms, (config.cells_along + 1, 1))
    for end in (LEFT_END, RIGHT_END):
        first = model.joint(end_body(end)).dofadr[0]
        model.dof_armature[first : first + 3] = _EDGE_MASS_KG
        model.dof_armature[first + 3 : first + 6] = _EDGE_INERTIA_KG_M2
    # The compiler could not weigh constraints against a cell without volume.
    mujoco.mj_setConst(model, mujoco.MjData(model))


def membrane_form(sheet: Sheet, hx: float, hy: float) -> Vector:
    """Return H (6, 6) of a cell: its energy is ``eᵀ H e / 2``, e the growth of the edges' squares.

    Edges in MuJoCo's order: near row, far column, diagonal, far row, near column, other diagonal.
    Strains ``e / 2 l²`` along rows and columns vary linearly over the cell; the shear
    ``γ = (e_diagonal − e_other) / 4 hx hy`` is that of its middle, so that a cell whose ends turn
    against each other, as a bent sheet's off its middle surface do, is not sheared.
    """
    nu, area = sheet.poisson_ratio, hx * hy
    plane = sheet.young_pa * sheet.thickness_m / (1.0 - nu**2)
    rows, columns = [0, 3], [1, 4]
    strain = np.zeros((6, 6))
    strain[rows, rows], strain[columns, columns] = 0.5 / hx**2, 0.5 / hy**2
    linear = np.array([[1.0, 0.5], [0.5, 1.0]]) / 3.0
    form = np.zeros((6, 6))
    form[np.ix_(rows, rows)] = form[np.ix_(columns, columns)] = plane * area * linear
    form[np.ix_(rows, columns)] = form[np.ix_(columns, rows)] = plane * area * nu / 4.0
    shear = np.zeros(6)
    shear[[2, 5]] = np.array([1.0, -1.0]) / (4.0 * area)
    modulus = sheet.young_pa / (2.0 * (1.0 + nu)) * sheet.thickness_m
    return np.asarray(strain @ form @ strain + modulus * area * np.outer(shear, shear))


def _set_bending(model: mujoco.MjModel, sheet: Sheet, config: ShellConfig) -> None:
    flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, BENDING)
    first, count = model.flex_edgeadr[flex], model.flex_edgenum[flex]
    near, far = (a[first : first + count] for a in (model.flex_edge, model.flex_edgeflap))
    start = model.flex_bendingadr[flex]
    forms = model.flex_bending[start : start + _BLOCK * count].reshape(count, _BLOCK)
    listed = hinges(sheet, config)
    forms[:] = 0.0
    for edge in np.flatnonzero((far >= 0).all(axis=1)):
        vertices = (*near[edge].tolist(), *far[edge].tolist())
        hinge = listed[vertices[0] // 4]
        weights = np.array([hinge.weights[vertex % 4] for vertex in vertices])
        forms[edge, :16] = hinge.stiffness * np.outer(weights, weights).ravel()
