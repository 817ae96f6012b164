"""A strip between clamps as a Cosserat rod of PyElastica, brought to rest by damping.

Stiffness, stretch and shear are those of the sheet's section, and so is the weight. The section's
rotary inertia, which statics do not feel, is that of an element as a rigid bar, for speed.
PyElastica bends between elements, so an element whose direction is fixed is a rigid piece: the rod
is one element longer than the sheet and the clamps are in the middle of the outermost two.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import elastica as ea
import numpy as np
from numpy.typing import NDArray

from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet

Vector = NDArray[np.float64]

COURANT = 0.4
SHEAR_CORRECTION = 5.0 / 6.0
DAMPING = 8.0
"""Rate at which speeds decay, over the first clamped mode's ω₁. Fixed clamps stop that mode, the
slowest that still swings alike on both sides has 5.4 ω₁."""

PERIODS = 1.0
"""How long is waited for rest, in periods of that first mode; `unrest` says what is left."""


class _World(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    """What PyElastica simulates."""


@dataclass(frozen=True, kw_only=True)
class RodLoads:
    """End force P [N] (compression positive) and moment at the left clamp [N m], both (n,).

    ``unrest``: largest change of P in the last tenth of the time, over the Euler load.
    """

    force_n: Vector
    moment_nm: Vector
    unrest: float


def clamped_loads(
    sheet: Sheet, poses: Sequence[tuple[float, float]], elements: int, *, weight: bool
) -> RodLoads:
    """Return the loads at rest at poses (α [rad], half distance [m]), each from the elastica."""
    loads, unrest = [], 0.0
    for alpha, half_distance in poses:
        before, after = _rest(sheet, alpha, half_distance, elements, weight=weight)
        loads.append(after)
        unrest = max(unrest, abs(after[0] - before[0]) / sheet.euler_load_n)
    force_n, moment_nm = np.array(loads).T
    return RodLoads(force_n=force_n, moment_nm=moment_nm, unrest=unrest)


def _rest(
    sheet: Sheet, alpha: float, half_distance: float, elements: int, *, weight: bool
) -> list[tuple[float, float]]:
    """Return P and M shortly before the end of the wait and at its end."""
    rod = _rod(sheet, alpha, half_distance, elements)
    h = sheet.length_m / elements
    per_length = sheet.mass_kg / sheet.length_m
    step = COURANT * h / math.sqrt(sheet.axial_stiffness_n / per_length)
    omega = (4.730 / sheet.length_m) ** 2 * math.sqrt(sheet.bending_stiffness_nm2 / per_length)
    world = _World()
    world.append(rod)
    world.constrain(rod).using(
        ea.FixedConstraint,
        constrained_position_idx=(0, 1, -2, -1),
        constrained_director_idx=(0, -1),
    )
    world.dampen(rod).using(
        ea.AnalyticalLinearDamper, uniform_damping_constant=DAMPING * omega, time_step=step
    )
    if weight:
        world.add_forcing_to(rod).using(
            ea.GravityForces, acc_gravity=np.array([0.0, 0.0, -GRAVITY_M_PER_S2])
        )
    world.finalize()
    stepper, time = ea.PositionVerlet(), 0.0
    count = math.ceil(PERIODS * 2.0 * math.pi / omega / step)
    loads = []
    for share in (0.9, 0.1):
        for _ in range(round(share * count)):
            time = stepper.step(world, time, step)
        loads.append(_left_loads(rod, h, weight=weight))
    return loads


def _rod(sheet: Sheet, alpha: float, half_distance: float, elements: int) -> ea.CosseratRod:
    """Return the rod on the elastica of this half distance, its outermost elements tilted by α."""
    h = sheet.length_m / elements
    w, t, E = sheet.width_m, sheet.thickness_m, sheet.young_pa
    with contextlib.redirect_stdout(io.StringIO()):
        rod = ea.CosseratRod.straight_rod(
            elements + 1,
            np.zeros(3),
            np.array([1.0, 0.0, 0.0]),
            np.array([0.0, 0.0, 1.0]),
            sheet.length_m + h,
            math.sqrt(w * t / math.pi),
            sheet.density_kg_per_m3,
            youngs_modulus=E,
        )
    # Axes of a section: through the thickness, across the width, along the rod.
    rod.bend_matrix[:] = np.diag(
        [E * w**3 * t / 12.0, sheet.bending_stiffness_nm2, sheet.torsional_stiffness_nm2]
    )[:, :, np.newaxis]
    shear = SHEAR_CORRECTION * E * w * t / (2.0 * (1.0 + sheet.poisson_ratio))
    rod.shear_matrix[:] = np.diag([shear, shear, sheet.axial_stiffness_n])[:, :, np.newaxis]
    mass = sheet.mass_kg / elements
    inertia = mass * np.diag([h**2 + w**2, h**2, h**2 + w**2]) / 12.0
    rod.mass_second_moment_of_inertia[:] = inertia[:, :, np.newaxis]
    rod.inv_mass_second_moment_of_inertia[:] = np.linalg.inv(inertia)[:, :, np.newaxis]
    slopes = _start_slopes(sheet.length_m, alpha, half_distance, elements)
    tangents = np.stack([np.cos(slopes), 0.0 * slopes, -np.sin(slopes)])
    nodes = np.concatenate([np.zeros((3, 1)), np.cumsum(h * tangents, axis=1)], axis=1)
    # The clamps where they belong; a gap at the middle node closes in the first steps.
    half = elements // 2
    nodes[0] -= nodes[0, 0] + 0.5 * h * math.cos(alpha) + half_distance
    nodes[2] += 0.5 * h * math.sin(alpha)
    rod.position_collection[:] = nodes
    mirrored = nodes[:, : half + 1][:, ::-1] * np.array([[-1.0], [1.0], [1.0]])
    rod.position_collection[:, half + 1 :] = mirrored
    across = np.tile([[0.0], [-1.0], [0.0]], elements + 1)
    rod.director_collection[:] = np.stack([np.cross(across, tangents, axis=0), across, tangents])
    return rod


def _start_slopes(length: float, alpha: float, half_distance: float, elements: int) -> Vector:
    """Return slopes of the elements (elements + 1,), between the clamps those of the elastica."""
    slope = elastica.end_slope_from_half_distance(half_distance, length)
    arcs = np.linspace(0.0, length, elements + 1)
    _, _, slopes = elastica.shape(slope, length, arcs)
    slopes[0], slopes[-1] = alpha, -alpha
    return slopes


def _left_loads(rod: ea.CosseratRod, h: float, *, weight: bool) -> tuple[float, float]:
    """Return P and M that the sheet exerts on the left clamp, about the clamp line.

    The clamp holds the first element with both its nodes: force of the second element and couple of
    the first bend, half an element away, and the weight of the node there.
    """
    stress = rod.internal_stress[:, 1] / rod.dilatation[1]
    force = rod.director_collection[:, :, 1].T @ stress
    force[2] -= GRAVITY_M_PER_S2 * rod.mass[1] * weight
    # The section's second axis is −y.
    couple = -rod.internal_couple[1, 0] / rod.voronoi_dilatation[0] ** 3
    arm = 0.5 * h * rod.director_collection[2, :, 0]
    return -float(force[0]), float(couple + arm[2] * force[0] - arm[0] * force[2])
