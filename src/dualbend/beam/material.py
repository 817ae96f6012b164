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
from dualbend.errors import InputError, brief, refusing
from dualbend.resources import models_dir

Grade = Literal["published", "typical", "assumed"]

GRADES: Mapping[Grade, str] = {
    "published": "read in a data sheet, handbook table or vendor's manual",
    "typical": "typical of a class of products, or from a secondary table",
    "assumed": "chosen or derived here; the source says from what",
}
_OPTIONAL = ("transverse_young_pa", "shear_pa", "yield_pa", "tangent_pa", "strain_at_failure")
_REQUIRED = ("young_pa", "poisson_ratio", "density_kg_per_m3")
NUMBERS = (*_REQUIRED, *_OPTIONAL)
"""Attributes of a material that are numbers."""


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
        for name in NUMBERS:
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
    return materials_of(data)


def materials_of(tables: Mapping[str, Any]) -> dict[str, Material]:
    """Return the materials of a file's tables: one a table, its name, numbers as the library's.

    A number stands alone or, as ``{ value, grade, source }``, with its evidence. InputError where a
    table, a key or a number is none.
    """
    if not tables:
        raise InputError("holds no material: it needs a table for each, [NAME] above its numbers")
    return {name: _read(name, table) for name, table in tables.items()}


def find_material(name: str, own: Mapping[str, Material] | None = None) -> Material:
    """Return a shipped material, or one's own; InputError with the valid names if there is none."""
    found = {**library(), **(own or {})}
    if name not in found:
        folded = {known.casefold(): known for known in found}
        close = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.5)
        hint = f"did you mean {folded[close[0]]!r}? " if close else ""
        raise InputError(f"unknown material; {hint}the library holds {', '.join(found)}")
    return found[name]


def _read(name: str, table: Any) -> Material:  # noqa: ANN401 - what a file has
    if not isinstance(table, dict):
        raise InputError(f"{name}: a material is a table: put [NAME] above its numbers")
    if unknown := [key for key in table if key not in ("title", *NUMBERS)]:
        raise InputError(
            f"[{name}] {unknown[0]}: unknown key; valid here: title, {', '.join(NUMBERS)}"
        )
    if missing := [key for key in _REQUIRED if key not in table]:
        raise InputError(f"[{name}] {', '.join(missing)}: missing")
    given = {key: _evident(f"[{name}] {key}", table[key]) for key in NUMBERS if key in table}
    title = table.get("title", "")
    if not isinstance(title, str):
        raise InputError(f"[{name}] title = {brief(title)}: needs a text")
    with refusing(f"[{name}]"):
        return Material(
            name=name,
            title=title,
            evidence={key: said for key, (_, said) in given.items() if said is not None},
            **{key: value for key, (value, _) in given.items()},
        )


def _evident(key: str, said: Any) -> tuple[float, Evidence | None]:  # noqa: ANN401 - a file's
    """Return a number and, where it has one, its evidence."""
    if not isinstance(said, dict):
        return _number(key, said), None
    if set(said) != {"value", "grade", "source"} or said["grade"] not in GRADES:
        raise InputError(
            f"{key}: needs a number, or {{ value, grade, source }} with the grade "
            f"{', '.join(GRADES)}"
        )
    evidence = Evidence(grade=said["grade"], source=str(said["source"]))
    return _number(key, said["value"]), evidence


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key} = {brief(value)}: needs a number")
    return float(value)
