"""Sheets that yield: moment against curvature, spring-back, and the law of a hinge.

A section stays plane, so the strain is κ z and each fibre follows its own material: elastic to ε_y,
then of slope E_t. For one perfectly plastic material, with κ_y = ε_y / (t/2) and M_y = EI κ_y,

    M(κ) = M_p (1 − (κ_y/κ)² / 3) beyond κ_y,  M_p = 1.5 M_y,  κ_residual = κ − M(κ) / EI.

Source: Timoshenko and Gere, Mechanics of Materials, 4th ed., section 6.10.

A hinge has the same law as parallel elastic, perfectly plastic springs (the model of Masing and
Iwan): M(q) = Σ k_j min(q, q_j) during loading; unloading and reloading follow Masing's rule, as
in the fibres. Source: Iwan, J. Appl. Mech. 34 (1967) 612.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dualbend.beam.laminate import Laminate, stack
from dualbend.beam.material import Material
from dualbend.errors import InputError
from dualbend.types import Vector

REACH = 12.0
"""Curvature over that of first yield up to which a hinge's springs are fitted."""

_GRID = 4001
_MIN_WEIGHT = 0.05
"""Residuals below this much of the curvature at first yield weigh no more in the fit."""


@dataclass(frozen=True, kw_only=True)
class Band:
    """Fibres of one material from ``low`` to ``high``, in half thicknesses off the middle.

    ``stiffness``: E relative to the E of the section's E I; ``yield_strain`` None: no yield.
    """

    low: float
    high: float
    stiffness: float
    yield_strain: float | None
    tangent_ratio: float


@dataclass(frozen=True, kw_only=True)
class HingeSprings:
    """Parallel springs of a hinge, as shares of its elastic stiffness.

    ``share`` and ``yield_curvature`` (n,): of the springs that slip, each at a curvature [1/m];
    ``elastic``: of the one that never does.
    """

    share: Vector
    yield_curvature: Vector
    elastic: float

    def moment(self, curvature: Vector) -> Vector:
        """Return M / EI [1/m] of a virgin hinge at curvatures (n,) of one sign [1/m]."""
        stretched = np.minimum(np.abs(curvature)[:, None], self.yield_curvature) @ self.share
        return np.asarray(np.sign(curvature) * stretched + self.elastic * curvature)

    def follow(self, curvature: Vector) -> Vector:
        """Return M / EI [1/m] over a history of curvatures (rows, hinges), virgin at the start."""
        slipped = np.zeros((*curvature.shape[1:], len(self.share)))
        moments = np.empty_like(curvature)
        for row, now in enumerate(curvature):
            stretch = now[..., None] - slipped
            held = np.clip(stretch, -self.yield_curvature, self.yield_curvature)
            slipped += stretch - held
            moments[row] = held @ self.share + self.elastic * now
        return moments


@dataclass(frozen=True)
class Plasticity:
    """The yield law of a section: its bands on one side of the middle; the other is the mirror."""

    bands: tuple[Band, ...]

    def first_yield(self, thickness_m: float) -> float:
        """Return the curvature at which the first fibre yields [1/m]."""
        return min(
            2.0 * band.yield_strain / (thickness_m * band.high)
            for band in self.bands
            if band.yield_strain is not None
        )

    def moment(self, curvature: Vector, thickness_m: float) -> Vector:
        """Return M / EI [1/m] of a section that is loaded for the first time, curvatures > 0."""
        half, total = thickness_m / 2.0, np.zeros_like(curvature)
        for band in self.bands:
            a, b, r = band.low, band.high, band.tangent_ratio
            if band.yield_strain is None:
                total += band.stiffness * curvature * (b**3 - a**3)
                continue
            yielding = band.yield_strain / half
            c = np.clip(yielding / curvature, a, b)
            total += band.stiffness * (
                curvature * (c**3 - a**3)
                + (1.0 - r) * 1.5 * yielding * (b**2 - c**2)
                + r * curvature * (b**3 - c**3)
            )
        return total

    def residual(self, curvature: Vector, thickness_m: float) -> Vector:
        """Return the residual curvature after release, κ − M(κ)/EI [1/m]."""
        return np.asarray(curvature - self.moment(curvature, thickness_m))

    def springs(self, thickness_m: float, count: int) -> HingeSprings:
        """Return ``count`` springs with the moment of the section, exact up to first yield.

        The kinks lie where M(κ) bends most, the moments there are fitted by least squares of the
        error of the residual curvature; beyond ``REACH`` times the first yield the slope is kept.
        """
        first = self.first_yield(thickness_m)
        grid = np.geomspace(first, REACH * first, _GRID)
        moment = self.moment(grid, thickness_m)
        weight = 1.0 / np.maximum(grid - moment, _MIN_WEIGHT * first)
        bend = np.abs(np.gradient(np.gradient(moment, grid), grid)) * weight
        crowd = np.concatenate(([0.0], np.cumsum(np.sqrt(bend[1:]) * np.diff(grid))))
        kinks = np.interp(np.linspace(0.0, crowd[-1], count), crowd, grid)
        # Piece-wise linear moments are linear in those at the kinks; the first is elastic.
        hats = np.stack([np.interp(grid, kinks, row) for row in np.eye(count)], axis=1)
        wanted = (moment - hats[:, 0] * first) * weight
        fitted, *_ = np.linalg.lstsq(hats[:, 1:] * weight[:, None], wanted, rcond=None)
        heights = np.concatenate(([0.0, first], fitted))
        elastic = float((moment[-1] - moment[-2]) / (grid[-1] - grid[-2]))
        slopes = np.diff(heights) / np.diff(np.concatenate(([0.0], kinks)))
        share = -np.diff(np.concatenate((slopes, [elastic])))
        if np.any(share <= 0.0):
            raise InputError(f"{count} springs cannot follow this section's moment; take fewer")
        return HingeSprings(share=share, yield_curvature=kinks, elastic=elastic)


def of_material(material: Material) -> Plasticity:
    """Return how a sheet of one material yields; InputError where it is brittle."""
    return of_laminate(stack([(material, 1.0)]))


def of_laminate(laminate: Laminate) -> Plasticity:
    """Return how a symmetric laminate yields; InputError where no layer does."""
    half = laminate.thickness_m / 2.0
    bands = [
        Band(
            low=max(float(low), 0.0) / half,
            high=float(high) / half,
            stiffness=material.young_pa,
            yield_strain=None if material.yield_pa is None else material.limit_strain,
            tangent_ratio=material.tangent_pa / material.young_pa,
        )
        for material, low, high in laminate.places()
        if high > 1e-9 * half
    ]
    if all(band.yield_strain is None for band in bands):
        names = ", ".join(dict.fromkeys(layer.material.name for layer in laminate.layers))
        raise InputError(f"{names} has no yield strength: it breaks, it does not yield")
    whole = sum(band.stiffness * (band.high**3 - band.low**3) for band in bands)
    return Plasticity(tuple(replace(band, stiffness=band.stiffness / whole) for band in bands))
