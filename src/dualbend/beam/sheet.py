"""The sheet: a rectangular elastic plate strip, held at two opposite edges."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.polynomial.legendre import leggauss

from dualbend.beam._check import positive
from dualbend.beam.plastic import Plasticity
from dualbend.beam.rigidity import Rigidity, rigidity_ratio
from dualbend.errors import InputError, brief
from dualbend.types import Vector

GRAVITY_M_PER_S2 = 9.81
"""Standard gravity of this project [m/s²]."""


_GAUSS = leggauss(6)
"""Of a mean over a stretch: exact for a thickness to the eleventh power, which no section has."""


def mean_thickness(profile: tuple[tuple[float, float], ...]) -> float:
    """Return the mean of a thickness that is straight between the rows (s, t) of a profile [m]."""
    s, t = np.transpose(profile)
    return float(np.trapezoid(t, s) / (s[-1] - s[0]))


def refuse_profile(profile: tuple[tuple[float, float], ...], length_m: float) -> None:
    """Raise InputError where the rows (s, t) of a profile do not lead over the whole length."""
    places = [s for s, _ in profile]
    if len(profile) < 2 or places[0] != 0.0 or abs(places[-1] - length_m) > 1e-9 * length_m:
        raise InputError(
            f"profile at {brief(places)} m: must lead from 0 to the sheet's length, "
            f"{length_m:g} m, in two rows or more"
        )
    for i, (a, b) in enumerate(pairwise(places)):
        # Two rows of one place are a step; a third would have no thickness of its own.
        is_step = b == a and 0.0 < a < places[-1] and places.count(a) == 2
        if not (b > a or is_step):
            raise InputError(
                f"profile, row {i + 2}: the places must grow (twice the same inside is a step), "
                f"got {a:g} then {b:g} m"
            )
    for _, thickness in profile:
        positive("profile: thickness", thickness)


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
    ``rest_curvature_per_m`` is that of the free sheet, positive as the path bends it. ``profile``:
    arc lengths and thicknesses (s, t) [m] of a sheet whose thickness varies along it, straight
    between them, two of one s for a step; ``thickness_m`` is their mean then. Of such a sheet
    stiffness and strain are those of a section; mass and weight per length are means.

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
    profile: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        for name in ("length_m", "width_m", "thickness_m", "young_pa", "density_kg_per_m3"):
            positive(name, getattr(self, name))
        if not 0.0 <= self.poisson_ratio < 0.5:
            raise InputError(f"poisson_ratio must lie in [0, 0.5), got {self.poisson_ratio!r}")
        if self.thickness_m > self.width_m:
            raise InputError(
                f"thickness_m must not exceed width_m: got {self.thickness_m!r} > {self.width_m!r}"
            )
        if self.profile:
            refuse_profile(self.profile, self.length_m)
            mean = mean_thickness(self.profile)
            if abs(self.thickness_m - mean) > 1e-9 * mean:
                raise InputError(
                    f"thickness_m = {self.thickness_m!r} must be the profile's mean, {mean!r}"
                )

    @property
    def is_plain(self) -> bool:
        """It is of one thickness and flat at rest, as the formulas of a uniform sheet have it."""
        return not (self.profile or self.rest_curvature_per_m)

    @property
    def is_symmetric(self) -> bool:
        """It is alike from both ends."""
        mirrored = [(self.length_m - s, t) for s, t in reversed(self.profile)]
        return all(
            math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)
            for rows in zip(self.profile, mirrored, strict=True)
            for a, b in zip(*rows, strict=True)
        )

    @property
    def breaks_m(self) -> tuple[float, ...]:
        """The arc lengths at which its thickness begins or goes on otherwise, ends included [m]."""
        inner = (s for s, _ in self.profile) if self.profile else (0.0, self.length_m)
        return tuple(dict.fromkeys(inner))

    def thicker(self, ratio: float) -> Self:
        """Return the sheet with its thickness, wherever it is, times a ratio."""
        profile = tuple((s, t * ratio) for s, t in self.profile)
        thickness = mean_thickness(profile) if profile else self.thickness_m * ratio
        return replace(self, thickness_m=thickness, profile=profile)

    def thickness_at(self, s_m: Vector) -> Vector:
        """Return the thickness at arc lengths (...) [m]."""
        if not self.profile:
            return np.full_like(s_m, self.thickness_m)
        return np.asarray(np.interp(s_m, *np.transpose(self.profile)))

    def section_at(self, s_m: float) -> Self:
        """Return the uniform sheet that has the section at an arc length."""
        thickness = float(self.thickness_at(np.array([s_m]))[0])
        return replace(self, thickness_m=thickness, profile=())

    def mean(self, low_m: float, high_m: float, of: Callable[[Self], float]) -> float:
        """Return the mean of a property of the sections between two arc lengths."""
        inner = [s for s in self.breaks_m if low_m < s < high_m]
        edges = [low_m, *inner, high_m]
        total = 0.0
        for a, b in pairwise(edges):
            places = a + (b - a) * (_GAUSS[0] + 1.0) / 2.0
            values = [of(self.section_at(s)) for s in places.tolist()]
            total += (b - a) / 2.0 * float(_GAUSS[1] @ values)
        return total / (high_m - low_m)

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
        places = angles_rad.shape[-1]
        curvature = angles_rad * (places / self.length_m)
        bent = np.abs(curvature + self.rest_curvature_per_m)
        if self.profile:
            hinges = (np.arange(places) + 0.5) * (self.length_m / places)
            bent = bent * (self.thickness_at(hinges) / self.thickness_m)
        return np.asarray(bent.max(axis=-1, initial=0.0) * self.thickness_m / 2.0)

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
        """Axial stiffness, E w t [N]; where t varies that of its ends, L / ∫ ds/EA."""
        stretch = 1.0 if self.anisotropy is None else self.anisotropy.stretch
        if self.profile:
            softness = self.mean(0.0, self.length_m, lambda section: 1.0 / section.thickness_m)
            return self.young_pa * stretch * self.width_m / softness
        return self.young_pa * stretch * self.width_m * self.thickness_m

    @property
    def euler_load_n(self) -> float:
        """Buckling load between pins, π² E I / L² [N]: the end force of an almost flat sheet."""
        return math.pi**2 * self.bending_stiffness_nm2 / self.length_m**2
