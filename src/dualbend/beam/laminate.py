"""Laminates by classical lamination theory: the plate that is equivalent to a stack of layers.

Kirchhoff's plate with layers that do not slip: N = A ε + B κ, M = B ε + D κ for forces N and
moments M per width, stretch ε and curvature κ of the middle, with

    (A, B, D) = Σ Q_k (z_k − z_{k−1},  (z_k² − z_{k−1}²) / 2,  (z_k³ − z_{k−1}³) / 3)

and Q_k a layer's plane-stress stiffness, axes 1 along the sheet, 2 across, 6 shear. Source: Jones,
Mechanics of Composite Materials, 2nd ed., section 4.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dualbend.beam._check import positive
from dualbend.beam.material import Material
from dualbend.errors import InputError
from dualbend.types import Vector

MOST_COUPLING = 1e-6
"""Largest |B| of a laminate that counts as symmetric, over A times the thickness."""


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One layer of a laminate."""

    material: Material
    thickness_m: float

    def __post_init__(self) -> None:
        positive("thickness_m", self.thickness_m)


@dataclass(frozen=True)
class Laminate:
    """Layers from the lower to the upper face of a sheet; at least one."""

    layers: tuple[Layer, ...]

    def __post_init__(self) -> None:
        if not self.layers:
            raise InputError("a laminate needs at least one layer")

    @property
    def thickness_m(self) -> float:
        """Total thickness t [m]."""
        return math.fsum(layer.thickness_m for layer in self.layers)

    @property
    def density_kg_per_m3(self) -> float:
        """Mean density, Σ ρ_k t_k / t [kg/m³]."""
        mass = math.fsum(x.material.density_kg_per_m3 * x.thickness_m for x in self.layers)
        return mass / self.thickness_m

    @cached_property
    def faces_m(self) -> Vector:
        """Heights z of the layers' faces above the middle (layers + 1,) [m]."""
        z = np.concatenate(([0.0], np.cumsum([layer.thickness_m for layer in self.layers])))
        return np.asarray(z - z[-1] / 2.0)

    @cached_property
    def A(self) -> Vector:  # noqa: N802 - the theory's name
        """Stretching stiffness (3, 3) [N/m]."""
        return self._sum(1)

    @cached_property
    def B(self) -> Vector:  # noqa: N802
        """Coupling of stretching and bending (3, 3) [N]; 0 where the stack is symmetric."""
        return self._sum(2)

    @cached_property
    def D(self) -> Vector:  # noqa: N802
        """Bending stiffness about the middle (3, 3) [N m]."""
        return self._sum(3)

    def _sum(self, power: int) -> Vector:
        rises = np.diff(self.faces_m**power / power)
        parts = [
            reduced_stiffness(layer.material) * rise
            for layer, rise in zip(self.layers, rises, strict=True)
        ]
        return np.asarray(np.sum(parts, axis=0))

    def places(self) -> Iterator[tuple[Material, float, float]]:
        """Yield the material of each layer, and from where to where it is above the middle [m]."""
        materials = (layer.material for layer in self.layers)
        return zip(materials, self.faces_m[:-1], self.faces_m[1:], strict=True)

    @property
    def coupling(self) -> float:
        """Asymmetry of the stack, max |B| / (t max |A|): 0 where stretch causes no bending."""
        return float(np.abs(self.B).max() / (self.thickness_m * np.abs(self.A).max()))

    def refuse_curl(self) -> None:
        """Raise InputError if B is not 0: stretch, heat or cure would curl the sheet."""
        if self.coupling > MOST_COUPLING:
            share = self.free_neutral_axis_m / self.thickness_m
            stack = ", ".join(f"{1e6 * x.thickness_m:g} µm {x.material.name}" for x in self.layers)
            raise InputError(
                f"the stack {stack} is not symmetric about its middle: "
                f"B11 = {self.B[0, 0]:.4g} N, {100 * self.coupling:.2g} % of A11 t "
                f"(neutral axis {100 * share:.2g} % of the thickness off the middle), so it would "
                "curl; mirror the layers about the middle"
            )

    @property
    def free_neutral_axis_m(self) -> float:
        """Height of the neutral axis above the middle, B11/A11 [m]."""
        return float(self.B[0, 0] / self.A[0, 0])

    @property
    def bending_per_width_nm(self) -> float:
        """Moment per width and curvature of a narrow strip, free to bend across: 1/d11 [N m].

        d is the bending part of the inverse of the whole [A B; B D].
        """
        return 1.0 / float(self._compliance[3, 3])

    @property
    def stretch_per_width_n_per_m(self) -> float:
        """Force per width and stretch of a narrow strip, 1/a11 [N/m]."""
        return 1.0 / float(self._compliance[0, 0])

    @cached_property
    def _compliance(self) -> Vector:
        return np.asarray(np.linalg.inv(np.block([[self.A, self.B], [self.B, self.D]])))

    def surface_limit(self) -> float | None:
        """Surface strain κ t/2 at which the first layer yields or breaks; None: unknown.

        A layer reaches its own limit at its outer face z: κ = ε_limit / |z|.
        """
        found = [
            material.limit_strain * self.thickness_m / 2.0 / max(abs(low), abs(high))
            for material, low, high in self.places()
            if material.limit_strain is not None
        ]
        return float(min(found)) if found else None


def reduced_stiffness(material: Material) -> Vector:
    """Return a layer's plane-stress stiffness Q (3, 3) [Pa], σ = Q ε.

    Q11 = E₁ / (1 − ν₁₂ν₂₁), Q12 = ν₁₂ E₂ / (1 − ν₁₂ν₂₁), Q22 = E₂ / (1 − ν₁₂ν₂₁), Q66 = G₁₂.
    """
    E1, E2, nu12 = material.young_pa, material.transverse_pa, material.poisson_ratio
    rest = 1.0 - nu12 * nu12 * E2 / E1
    off = nu12 * E2 / rest
    shear = material.in_plane_shear_pa
    return np.array([[E1 / rest, off, 0.0], [off, E2 / rest, 0.0], [0.0, 0.0, shear]])


def stack(layers: Sequence[tuple[Material, float]]) -> Laminate:
    """Return the laminate of (material, thickness [m]) from the lower to the upper face."""
    return Laminate(tuple(Layer(material=m, thickness_m=t) for m, t in layers))
