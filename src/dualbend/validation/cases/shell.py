"""The shell against plate theory: cylindrical bending, anticlastic bending, twist, corner loads.

The plate hangs between two ideal grips and is settled at each pose with far more damping than a
sheet has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.scene.sheet.model import ShellModel
from dualbend.scene.sheet.shell import ShellConfig, add_shell, hinges, row_places, row_shares
from dualbend.types import Vector
from dualbend.validation.cases.ideal_grips import (
    add_ideal_grips,
    elastica_slopes,
    empty_scene,
    left_wrench,
    place_grips,
    roll_right_grip,
)
from dualbend.validation.cases.sheet import default_sheet, fitted_order, order_row
from dualbend.validation.row import Row, at_least, relative

TOLERANCE, TWIST_TOLERANCE, WIDE_TWIST_TOLERANCE, ANTICLASTIC_TOLERANCE = 0.03, 0.02, 0.05, 0.1
WIDE_M = 0.2

_STEP_S, _REST_S, _REST_SPEED = 3.5e-3, 1.5, 1e-7
_WELD_TIME_S, _WELD_ARM_M, _DAMPING_RATIO = 5e-4, 10.0, 0.3
_TWIST_RAD, _TWIST_STEPS = 2e-3, 20


@dataclass(frozen=True, kw_only=True)
class Settled:
    """A plate at rest: wrench (6,) on the left gripper, vertices [m], bending angles [rad]."""

    wrench: Vector
    vertices: Vector
    bends: Vector

    @property
    def force_n(self) -> float:
        """Compressive end force P."""
        return -float(self.wrench[0])

    @property
    def moment_nm(self) -> float:
        """Moment on the left gripper about the bending axis."""
        return float(self.wrench[4])


def shell_config(along: int | None = None, across: int | None = None) -> ShellConfig:
    """Return the shipped mesh, or another, with the damping of a validation."""
    cells = {"cells_along": along, "cells_across": across}
    changed = {name: count for name, count in cells.items() if count}
    return ShellConfig(damping_ratio=_DAMPING_RATIO, **changed)


def settle(
    sheet: Sheet, config: ShellConfig, alpha: float, half_distance: float, roll_rad: float = 0.0
) -> Settled:
    """Return the plate at rest between ideal grips, the right one rolled; no weight."""
    spec = empty_scene(_STEP_S, weight=False)
    add_shell(spec, sheet, config, np.zeros(3))
    add_ideal_grips(spec, _WELD_TIME_S, _WELD_ARM_M)
    model = spec.compile()
    shell, data = ShellModel(model, sheet, config), mujoco.MjData(model)
    slopes, rise = elastica_slopes(sheet, half_distance, config.cells_along)
    shell.place(data.qpos, slopes, np.array([0.0, 0.0, -rise]), 0.0)
    place_grips(data, alpha, half_distance)
    if roll_rad:
        roll_right_grip(model, data, roll_rad, _TWIST_STEPS)
    for step in range(round(_REST_S / _STEP_S)):
        mujoco.mj_step(model, data)
        if step > 20 and np.abs(data.qvel).max() < _REST_SPEED:
            break
    mujoco.mj_forward(model, data)
    return Settled(
        wrench=left_wrench(model, data),
        vertices=shell.columns(data).copy(),
        bends=shell.bending_angles(data),
    )


def _theory(sheet: Sheet, alpha: float, off_m: float) -> tuple[float, rod.RodState]:
    """Return a half distance off the path and the rod of D w there, D = E t³ / 12 (1 − ν²)."""
    half = float(elastica.half_distance(alpha, sheet.length_m)) + off_m
    plate = replace(sheet, rigidity="plate").bending_stiffness_nm2
    return half, rod.solve_symmetric(plate, sheet.length_m, alpha, half)


def cylindrical_rows() -> Iterator[Row]:
    """Compare force and moment with the rod of rigidity D w, on and off the zero-moment path.

    With ν = 0 bending is cylindrical at any width, and the shipped mesh alone differs; with the
    shipped ν the sheet is wide, and how far its free edges yield is within the error.
    """
    shipped, _ = default_sheet()
    cases = (
        ("ν = 0, shipped width and mesh", replace(shipped, poisson_ratio=0.0), shell_config()),
        (f"{WIDE_M:g} m wide, shipped ν", replace(shipped, width_m=WIDE_M), shell_config(None, 10)),
    )
    for name, sheet, config in cases:
        for alpha, off in ((0.3, 5e-4), (0.8, 2e-3)):
            half, wanted = _theory(sheet, alpha, off)
            found = settle(sheet, config, alpha, half)
            where = f"cylindrical, {name}, {alpha:g} rad"
            force, moment = wanted.end_force_n, wanted.end_moment_nm
            yield relative(f"shell force, {where}", found.force_n, force, "N", TOLERANCE)
            yield relative(f"shell moment, {where}", found.moment_nm, moment, "N m", TOLERANCE)


def order_rows(cells: Sequence[int] = (10, 20, 40), alpha: float = 0.8) -> Iterator[Row]:
    """Return the orders of convergence of force and moment in the number of cells along, ν = 0."""
    sheet = replace(default_sheet()[0], poisson_ratio=0.0)
    half, wanted = _theory(sheet, alpha, 2e-3)
    found = [settle(sheet, shell_config(n, 2), alpha, half) for n in cells]
    for name, values, reference in (
        ("force", [f.force_n for f in found], wanted.end_force_n),
        ("moment", [f.moment_nm for f in found], wanted.end_moment_nm),
    ):
        errors = np.abs(np.array(values) / reference - 1.0)
        yield order_row(f"shell {name}", fitted_order(cells, errors))


def ashwell(sheet: Sheet, radius_m: float) -> tuple[float, float]:
    """Return edge above middle [m] and rigidity over EI of a strip bent to a radius.

    Across the strip D z⁗ + E t z / R² = 0 with z″ = ν/R and z‴ = 0 at the free edges, so
    ``z = A cosh ay cos ay + B sinh ay sin ay``, ``a⁴ = 3 (1 − ν²) / R² t²``; the rigidity is the
    derivative of the energy, ``∫ D (κ − ν z″) + E t z² κ dy / κ``. Source: Ashwell, J. R.
    Aeronaut. Soc. 54 (1950), after Searle (1908).
    """
    nu, E, t = sheet.poisson_ratio, sheet.young_pa, sheet.thickness_m
    a, b = (3.0 * (1.0 - nu**2) / (radius_m * t) ** 2) ** 0.25, 0.5 * sheet.width_m
    ch, sh, c, s = math.cosh(a * b), math.sinh(a * b), math.cos(a * b), math.sin(a * b)
    edge = np.array(
        [
            [-2 * a**2 * sh * s, 2 * a**2 * ch * c],
            [-2 * a**3 * (ch * s + sh * c), 2 * a**3 * (sh * c - ch * s)],
        ]
    )
    A, B = np.linalg.solve(edge, [nu / radius_m, 0.0])
    y = np.linspace(-b, b, 4001)
    even, odd = np.cosh(a * y) * np.cos(a * y), np.sinh(a * y) * np.sin(a * y)
    z, bent = A * even + B * odd, 2 * a**2 * (B * even - A * odd)
    D = E * t**3 / (12.0 * (1.0 - nu**2))
    rigidity = np.trapezoid(D * (1.0 - nu * radius_m * bent) + E * t * z**2, y)
    return float(z[-1] - A), float(rigidity) / sheet.bending_stiffness_nm2


def bent_to_a_circle(sheet: Sheet, config: ShellConfig, radius_m: float) -> tuple[float, float]:
    """Return edge against middle [m], outward positive, and moment over EI κ, at the middle.

    The clamps keep the curl away, so the ends are stiffer and the arc is no perfect circle; the
    section's moment in the middle is ``M − P rise``.
    """
    alpha = 0.5 * sheet.length_m / radius_m
    settled = settle(sheet, config, alpha, radius_m * math.sin(alpha))
    half = config.cells_along // 2
    z = settled.vertices[half : half + 2, :, 2].mean(axis=0)
    middle = z[len(z) // 2 - 1 : len(z) // 2 + 1].mean()
    shares = row_shares(sheet, config) / sheet.width_m
    moment = settled.moment_nm + settled.force_n * float(z @ shares)
    curvature = settled.bends[half - 1 : half + 1].mean() * config.cells_along / sheet.length_m
    return float(middle - z[0]), moment / (sheet.bending_stiffness_nm2 * float(curvature))


def anticlastic_rows() -> Iterator[Row]:
    """Compare a strip bent to a circle with Ashwell: its rigidity at the shipped mesh, its profile.

    The profile needs cells of half the edge zone, 1/a = 9 mm: a shorter sheet has them cheaply.
    """
    sheet, _ = default_sheet()
    radius = 0.4
    _, rigidity = bent_to_a_circle(sheet, shell_config(), radius)
    _, wanted = ashwell(sheet, radius)
    where = "rigidity over EI in the middle, bent to 0.4 m"
    yield relative(f"shell {where}, shipped mesh", rigidity, wanted, "1", TOLERANCE)
    short, radius = replace(sheet, length_m=0.16), 0.3
    edge, _ = bent_to_a_circle(short, shell_config(16, 12), radius)
    wanted, _ = ashwell(short, radius)
    name = "shell anticlastic edge, bent to 0.3 m, cells of 10 by 5 mm"
    yield relative(name, edge, wanted, "m", ANTICLASTIC_TOLERANCE)


def restrained_twist(sheet: Sheet) -> float:
    """Return the twist stiffness of a plate between clamps over GJ/L.

    The clamps keep the ends from warping: with the deflection y φ(x), D w³/12 φ⁗ = 2 D (1 − ν) w φ″
    and L becomes ``L − 2 λ tanh(L/2λ)``, ``λ = w / sqrt(24 (1 − ν))``. Source: Reissner and Stein,
    NACA TN 2369 (1951).
    """
    length = sheet.width_m / math.sqrt(24.0 * (1.0 - sheet.poisson_ratio))
    L = sheet.length_m
    return L / (L - 2.0 * length * math.tanh(0.5 * L / length))


def twist_over_rod(sheet: Sheet, config: ShellConfig) -> tuple[float, Vector]:
    """Return the torque of a flat sheet over GJ φ/L, and each row's part of the clamp's reaction.

    The parts (M + 1,) are what the vertices of a row that the left grip holds bear of the torque.
    """
    settled = settle(sheet, config, 0.0, 0.5 * sheet.length_m, _TWIST_RAD)
    force = np.zeros(settled.vertices.shape[:2])
    for hinge in hinges(sheet, config):
        columns, rows = np.array(hinge.vertices).T
        weights = np.array(hinge.weights)
        bent = hinge.stiffness * float(weights @ settled.vertices[columns, rows, 2])
        np.add.at(force, (columns, rows), -bent * weights)
    torque = force[:2].sum(axis=0) * settled.vertices[0, :, 1]
    # As the edges stand: the welds of the ideal grips yield by some per cent of the angle.
    edges = settled.vertices[[0, -1]]
    tilts = (edges[:, -1, 2] - edges[:, 0, 2]) / sheet.width_m
    expected = sheet.torsional_stiffness_nm2 * (tilts[1] - tilts[0]) / sheet.length_m
    return float(settled.wrench[3]) / expected, torque / torque.sum()


def twist_rows() -> Iterator[Row]:
    """Compare the twist stiffness between clamps with theory, at the shipped width and wide."""
    sheet, _ = default_sheet()
    wide, config = replace(sheet, width_m=WIDE_M), shell_config(None, 10)
    for where, plate, mesh, allowed in (
        ("shipped", sheet, shell_config(), TWIST_TOLERANCE),
        (f"{WIDE_M:g} m wide", wide, config, WIDE_TWIST_TOLERANCE),
    ):
        found, parts = twist_over_rod(plate, mesh)
        name = f"shell twist stiffness over GJ/L, {where}"
        yield relative(name, found, restrained_twist(plate), "1", allowed)
    # What a load that grows linearly across the clamp would have outside the inner half.
    outer = np.abs(row_places(wide, config)) > 0.25 * WIDE_M
    linear = 1.0 - 0.5**3
    name = "shell twist, torque borne by the clamp's outer quarters"
    yield at_least(name, float(parts[outer].sum()), linear, "1")


def shell_rows() -> Iterator[Row]:
    """Check the shell; takes half a minute."""
    yield from cylindrical_rows()
    yield from order_rows()
    yield from anticlastic_rows()
    yield from twist_rows()
