"""The outer half of a hanging sheet on its zero-moment path, with its weight.

x is measured from the middle outward, z upward from the middle, s is the arc length from the
middle, θ ≥ 0 the slope (rising outward).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from dualbend.beam import elastica
from dualbend.beam._check import FloatArray, within
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError

NODES: Final = 49
"""Bending angles at which shape_family solves for the shape."""
LOWEST_RAD: Final = 5e-3
"""Below this end slope the bed is assumed to carry the sheet, whose weight then bends nothing."""
HIGHEST_RAD: Final = math.pi / 2
"""Upright ends of the sheet, where the planner stops; up to there all holes still rise."""


class HolePose(NamedTuple):
    """Pose of the centre of a hole: x and z from the sheet's middle [m], slope θ [rad]."""

    x_m: float
    z_m: float
    slope_rad: float


@dataclass(frozen=True, kw_only=True)
class HangingSheet:
    """The outer half of a symmetric sheet on its zero-moment path, sampled over s from the middle.

    rise_m is the height of the grips above the middle, end_force_n the compressive P,
    end_moment_nm the moment M on a gripper, strain the largest one at the surface.
    """

    alpha_rad: float
    half_distance_m: float
    rise_m: float
    end_force_n: float
    end_moment_nm: float
    strain: float
    s_m: FloatArray = field(repr=False)
    nodes: FloatArray = field(repr=False)
    """Rows x, z, θ at s_m."""
    rates: FloatArray = field(repr=False)
    """Their derivatives along s: cos θ, sin θ and the curvature."""

    def at(self, s: float) -> HolePose:
        """Return the pose at arc length s ≥ 0 [m] from the middle, by cubic Hermite pieces.

        With 40 pieces of the half the error is below 2e-8 L, at upright ends.
        InputError off the sheet.
        """
        within("arc length from the middle [m]", s, 0.0, float(self.s_m[-1]))
        i = min(int(np.searchsorted(self.s_m, s, side="right")) - 1, self.s_m.size - 2)
        h = float(self.s_m[i + 1] - self.s_m[i])
        u = (s - float(self.s_m[i])) / h
        v = 1.0 - u
        value = (
            v * v * (1.0 + 2.0 * u) * self.nodes[:, i]
            + u * u * (1.0 + 2.0 * v) * self.nodes[:, i + 1]
            + h * u * v * (v * self.rates[:, i] - u * self.rates[:, i + 1])
        )
        return HolePose(*(float(part) for part in value))


def hang(sheet: Sheet, alpha: float, *, weight: bool = True) -> HangingSheet:
    """Return the sheet whose grips are where the zero-moment path has them at α [rad].

    With weight the shape and the loads are those of the reference solution
    (beam.rod.planar.solve_symmetric). Without it, and below LOWEST_RAD, they are those of the
    closed form: there a hanging sheet that cannot stretch would be taut (P → −∞ as 1/α), but this
    one lies on a bed. For 0.5 mm aluminium of 0.4 m the weight lowers the holes against the middle
    by 0.02 mm and takes 1 % off their approach at 0.13 rad. Raises InputError where α lies outside
    [0, HIGHEST_RAD], or the reference solution finds no state.
    """
    within("end slope α [rad]", alpha, 0.0, HIGHEST_RAD)
    if weight and alpha >= LOWEST_RAD:
        return _by_reference(sheet, alpha)
    return _by_closed_form(sheet, alpha)


def _half_sheet(sheet: Sheet, alpha: float, s: FloatArray, row: FloatArray) -> HangingSheet:
    """Return the half sheet of a row: x, z, θ, curvature over s, then rise, P, M and strain."""
    x, z, theta, curvature = row[:-4].reshape(4, -1)
    rise, force, moment, strain = row[-4:].tolist()
    return HangingSheet(
        alpha_rad=alpha,
        half_distance_m=elastica.half_distance(alpha, sheet.length_m),
        rise_m=rise,
        end_force_n=force,
        end_moment_nm=moment,
        strain=strain,
        s_m=s,
        nodes=np.stack([x, z, theta]),
        rates=np.stack([np.cos(theta), np.sin(theta), curvature]),
    )


def _by_reference(sheet: Sheet, alpha: float) -> HangingSheet:
    EI, L = sheet.bending_stiffness_nm2, sheet.length_m
    half = elastica.half_distance(alpha, L)
    state = rod.solve_symmetric(EI, L, alpha, half, sheet.weight_per_length_n_per_m)
    if not state.converged:
        raise InputError(f"no shape of the hanging sheet found at {alpha:.4f} rad: {state.reason}")
    middle = state.s_m.size // 2
    x, z = (row[middle:] - row[middle] for row in (state.x_m, state.z_m))
    theta, curvature = -state.theta_rad[middle:], -state.curvature_per_m[middle:]
    strain = float(np.max(np.abs(curvature))) * sheet.thickness_m / 2.0
    numbers = (state.rise_m, state.end_force_n, state.end_moment_nm, strain)
    row = np.concatenate([x, z, theta, curvature, numbers])
    return _half_sheet(sheet, alpha, state.s_m[middle:] - L / 2.0, row)


def _by_closed_form(sheet: Sheet, alpha: float) -> HangingSheet:
    EI, L = sheet.bending_stiffness_nm2, sheet.length_m
    s = np.linspace(0.0, L / 2.0, 41)
    x, z, theta = elastica.shape(alpha, L, s + L / 2.0)
    # κ² = 2 (P/EI) (cos θ − cos α), written without a difference of nearly equal cosines.
    drop = np.maximum(math.sin(alpha / 2.0) ** 2 - np.sin(theta / 2.0) ** 2, 0.0)
    curvature = 2.0 * np.sqrt(elastica.end_force(alpha, 1.0, L) * drop)
    rise, force = elastica.rise(alpha, L), elastica.end_force(alpha, EI, L)
    numbers = (rise, force, 0.0, elastica.surface_strain(alpha, L, sheet.thickness_m))
    row = np.concatenate([x - x[0], z - z[0], -theta, curvature, numbers])
    return _half_sheet(sheet, alpha, s, row)


@lru_cache(maxsize=16)
def shape_family(sheet: Sheet) -> Callable[[float], HangingSheet]:
    """Return hang(sheet, ·) with weight as a table: 49 shapes and a cubic spline between them.

    The spline runs over √(α − LOWEST_RAD), so that the nodes crowd where the weight matters, and
    carries P α instead of P. For 0.5 mm aluminium it is within 0.1 µm of hang.
    The function returned raises what hang raises.
    """
    u = np.linspace(0.0, math.sqrt(HIGHEST_RAD - LOWEST_RAD), NODES)
    shapes = [_by_reference(sheet, min(LOWEST_RAD + float(v) ** 2, HIGHEST_RAD)) for v in u]
    loads = [(h.rise_m, h.end_force_n * h.alpha_rad, h.end_moment_nm, h.strain) for h in shapes]
    rows = [np.hstack([*h.nodes, h.rates[2], own]) for h, own in zip(shapes, loads, strict=True)]
    spline, s = CubicSpline(u, np.stack(rows)), shapes[0].s_m

    def look_up(alpha: float) -> HangingSheet:
        within("end slope α [rad]", alpha, 0.0, HIGHEST_RAD)
        if alpha < LOWEST_RAD:
            return _by_closed_form(sheet, alpha)
        row = np.asarray(spline(math.sqrt(alpha - LOWEST_RAD)))
        row[-3] /= alpha
        return _half_sheet(sheet, alpha, s, row)

    return look_up
