"""The sheet: a rectangular elastic plate strip, held at two opposite edges."""

import math
from dataclasses import dataclass

import numpy as np

from dualbend.beam._check import positive
from dualbend.beam.plastic import Plasticity
from dualbend.beam.rigidity import Rigidity, rigidity_ratio
from dualbend.errors import InputError
from dualbend.types import Vector

GRAVITY_M_PER_S2 = 9.81
"""Standard gravity of this project [m/s²]."""


@dataclass(frozen=True, kw_only=True)
class Anisotropy:
    """Stiffness of a weave or laminate, where it is not isotropic, over its bending modulus E.

    ``shear``: 12 D66/t³, so that GJ = D66 · 4 w; ``stretch``: A11/t without Poisson's; ``across``:
    D22/D11.
    """

    shear: float
    stretch: float = 1.0
    across: float = 1.0

    def __post_init__(self) -> None:
        for name in ("shear", "stretch", "across"):
            positive(name, getattr(self, name))


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """A sheet of size length × width × thickness; the length is the free one between grippers.

    ``young_pa`` is the modulus of bending as a beam, ``poisson_ratio`` √(ν₁₂ ν₂₁). ``rigidity``
    says whether the sheet bends as a beam, as a plate, or between them for its width at the
    curvature ``curvature_per_m``. ``anisotropy`` None: isotropic; ``plasticity`` None: no yield.
    ``rest_curvature_per_m`` is that of the free sheet, positive as the path bends it; the physics
    knows it, the theory of this package is that of a sheet that is flat at rest.

    Raises InputError where a size, the modulus or the density is not finite and above zero, the
    Poisson ratio is outside [0, 0.5), or the thickness exceeds the width.
    """

    length_m: float
    width_m: float
    thickness_m: float
    young_pa: float
    poisson_ratio: float
    density_kg_per_m3: float
    rigidity: Rigidity = "beam"
    curvature_per_m: float = 0.0
    anisotropy: Anisotropy | None = None
    plasticity: Plasticity | None = None
    rest_curvature_per_m: float = 0.0

    def __post_init__(self) -> None:
        for name in ("length_m", "width_m", "thickness_m", "young_pa", "density_kg_per_m3"):
            positive(name, getattr(self, name))
        if not 0.0 <= self.poisson_ratio < 0.5:
            raise InputError(f"poisson_ratio must lie in [0, 0.5), got {self.poisson_ratio!r}")
        if self.thickness_m > self.width_m:
            raise InputError(
                f"thickness_m must not exceed width_m: got {self.thickness_m!r} > {self.width_m!r}"
            )

    @property
    def second_moment_m4(self) -> float:
        """Second moment of area about the bending axis, I = w t³ / 12 [m⁴]."""
        return self.width_m * self.thickness_m**3 / 12.0

    @property
    def bending_stiffness_nm2(self) -> float:
        """Bending stiffness of the strip, E I times :meth:`rigidity_over_beam` [N m²]."""
        beam = self.young_pa * self.second_moment_m4
        return beam if self.rigidity == "beam" else beam * self.rigidity_over_beam(self.rigidity)

    def rigidity_over_beam(self, rigidity: Rigidity) -> float:
        """Return the bending stiffness over E I: 1 as a beam, 1/(1 − ν²) as a plate.

        For ``width`` see :func:`~dualbend.beam.rigidity.rigidity_ratio`.
        """
        kind = self.anisotropy
        return rigidity_ratio(
            rigidity,
            self.poisson_ratio,
            self.width_m,
            self.thickness_m,
            self.curvature_per_m,
            1.0 if kind is None else kind.stretch / kind.across,
        )

    def surface_strain(self, angles_rad: Vector) -> Vector:
        """Return the largest surface strain (...) of a sheet bent at N places (..., N).

        ``ε = |Δθ/h + κ₀| t/2``, h = L/N: the slope falls where the sheet bends as the path does.
        """
        curvature = angles_rad * (angles_rad.shape[-1] / self.length_m)
        strained = np.abs(curvature + self.rest_curvature_per_m).max(axis=-1, initial=0.0)
        return np.asarray(strained * self.thickness_m / 2.0)

    @property
    def mass_kg(self) -> float:
        """Mass of the free length, ρ L w t [kg]."""
        return self.density_kg_per_m3 * self.length_m * self.width_m * self.thickness_m

    @property
    def weight_per_length_n_per_m(self) -> float:
        """Weight per arc length, q = ρ w t g [N/m]."""
        return self.mass_kg / self.length_m * GRAVITY_M_PER_S2

    @property
    def torsion_constant_m4(self) -> float:
        """Saint-Venant torsion constant of the rectangle [m⁴].

        J = (w t³ / 3) (1 − (192 r / π⁵) Σ tanh(n π / 2r) / n⁵), n odd, r = t / w ≤ 1.
        About (w t³ / 3) (1 − 0.63 r) for a thin sheet. Source: Timoshenko and Goodier, Theory of
        Elasticity, art. 109; the rest of the sum after n = 19 is below 1e-6.
        """
        ratio = self.thickness_m / self.width_m
        slender = self.width_m * self.thickness_m**3 / 3.0
        total = sum(math.tanh(n * math.pi / (2.0 * ratio)) / n**5 for n in range(1, 20, 2))
        return slender * (1.0 - 192.0 * ratio / math.pi**5 * total)

    @property
    def torsional_stiffness_nm2(self) -> float:
        """Torsional stiffness, G J with G = E / (2 (1 + ν)), or from D66 [N m²]."""
        if self.anisotropy is not None:
            return self.young_pa * self.anisotropy.shear * self.torsion_constant_m4
        return self.young_pa / (2.0 * (1.0 + self.poisson_ratio)) * self.torsion_constant_m4

    @property
    def axial_stiffness_n(self) -> float:
        """Axial stiffness, E w t [N]."""
        stretch = 1.0 if self.anisotropy is None else self.anisotropy.stretch
        return self.young_pa * stretch * self.width_m * self.thickness_m

    @property
    def euler_load_n(self) -> float:
        """Buckling load between pins, π² E I / L² [N]: the end force of an almost flat sheet."""
        return math.pi**2 * self.bending_stiffness_nm2 / self.length_m**2
