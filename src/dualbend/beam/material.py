"""Materials of a sheet: elastic constants, density and strength; each number has a source.

The numbers are in ``models/materials/materials.toml``. A material may be
orthotropic in the plane: 1 is along the sheet, 2 across it.
"""

from __future__ import annotations

import difflib
import functools
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from dualbend.beam._check import positive
from dualbend.errors import InputError
from dualbend.resources import models_dir

Grade = Literal["published", "typical", "assumed"]

GRADES: Mapping[Grade, str] = {
    "published": "read in a data sheet, handbook table or vendor's manual",
    "typical": "typical of a class of products, or from a secondary table",
    "assumed": "chosen or derived here; the source says from what",
}
_OPTIONAL = ("transverse_young_pa", "shear_pa", "yield_pa", "tangent_pa", "strain_at_failure")
_NUMBERS = ("young_pa", "poisson_ratio", "density_kg_per_m3", *_OPTIONAL)


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """The source of a number, and a grade of its reliability."""

    grade: Grade
    source: str


@dataclass(frozen=True, kw_only=True)
class Material:
    """The material of a sheet or of a layer.

    Attributes
    ----------
    young_pa, transverse_young_pa : E₁ along the sheet and E₂ across it [Pa]; None: E₂ = E₁
    poisson_ratio : ν₁₂, the contraction across per stretch along; ν₂₁ = ν₁₂ E₂/E₁
    shear_pa : G₁₂ in the plane [Pa]; None: isotropic, E / (2 (1 + ν))
    density_kg_per_m3 : [kg/m³]
    yield_pa : 0.2 % yield strength [Pa]; None: brittle, ``strain_at_failure`` is the limit
    tangent_pa : slope of the stress beyond yield [Pa], below E₁; 0: perfectly plastic
    strain_at_failure : at the surface in bending; None: not known or beyond use
    evidence : grade and source of each number, by the attribute's name

    Raises InputError where a number is not finite or has no meaning.
    """

    name: str
    young_pa: float
    poisson_ratio: float
    density_kg_per_m3: float
    title: str = ""
    transverse_young_pa: float | None = None
    shear_pa: float | None = None
    yield_pa: float | None = None
    tangent_pa: float = 0.0
    strain_at_failure: float | None = None
    evidence: Mapping[str, Evidence] = field(default_factory=dict, compare=False, hash=False)

    def __post_init__(self) -> None:
        for name in _NUMBERS:
            value = getattr(self, name)
            if value is not None and name not in ("poisson_ratio", "tangent_pa"):
                positive(name, value)
        if not 0.0 <= self.poisson_ratio < 0.5:
            raise InputError(f"poisson_ratio must lie in [0, 0.5), got {self.poisson_ratio!r}")
        if not 0.0 <= self.tangent_pa < self.young_pa:
            raise InputError(
                f"tangent_pa must lie in [0, young_pa = {self.young_pa:g}), got {self.tangent_pa!r}"
            )

    @property
    def transverse_pa(self) -> float:
        """Young's modulus across the sheet, E₂ [Pa]."""
        return self.young_pa if self.transverse_young_pa is None else self.transverse_young_pa

    @property
    def in_plane_shear_pa(self) -> float:
        """Shear modulus in the plane, G₁₂ [Pa]; isotropic without one of its own."""
        isotropic = math.sqrt(self.young_pa * self.transverse_pa) / (
            2.0 * (1.0 + self.mean_poisson)
        )
        return isotropic if self.shear_pa is None else self.shear_pa

    @property
    def mean_poisson(self) -> float:
        """Geometric mean √(ν₁₂ ν₂₁): ν where the material is isotropic."""
        return self.poisson_ratio * math.sqrt(self.transverse_pa / self.young_pa)

    @property
    def limit_strain(self) -> float | None:
        """Strain at yield, σ_y / E, or at failure if it does not yield; None: unknown."""
        if self.yield_pa is not None:
            return self.yield_pa / self.young_pa
        return self.strain_at_failure


@functools.cache
def library() -> Mapping[str, Material]:
    """Return the shipped materials by name."""
    path = models_dir() / "materials" / "materials.toml"
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: _read(name, table) for name, table in data.items()}


def find_material(name: str) -> Material:
    """Return a shipped material; InputError with the valid names if there is none."""
    found = library()
    if name not in found:
        folded = {known.casefold(): known for known in found}
        close = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.5)
        hint = f"did you mean {folded[close[0]]!r}? " if close else ""
        raise InputError(f"unknown material; {hint}the library holds {', '.join(found)}")
    return found[name]


def _read(name: str, table: Mapping[str, Any]) -> Material:
    numbers = {key: float(table[key]["value"]) for key in _NUMBERS if key in table}
    evidence = {
        key: Evidence(grade=table[key]["grade"], source=table[key]["source"]) for key in numbers
    }
    return Material(name=name, title=table["title"], evidence=evidence, **numbers)
