"""The material library as text, Markdown and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict

from dualbend.beam.material import GRADES, NUMBERS, Material
from dualbend.table import Code, Table, quantity

_COLUMNS = (
    # attribute, heading, unit, divisor
    ("young_pa", "E", "GPa", 1e9),
    ("transverse_young_pa", "E across", "GPa", 1e9),
    ("poisson_ratio", "ν", "", 1.0),
    ("density_kg_per_m3", "ρ", "kg/m³", 1.0),
    ("yield_pa", "yield", "MPa", 1e6),
    ("tangent_pa", "slope beyond", "GPa", 1e9),
    ("strain_at_failure", "breaks at", "%", 0.01),
)


def overview(materials: Mapping[str, Material]) -> str:
    """Return one line per material, with the letter of each number's grade."""
    grades = "; ".join(f"{grade[0]}: {grade}, {said}" for grade, said in GRADES.items())
    lines = [_numbers(materials, "").text(), "", grades, "dualbend materials NAME: the sources"]
    return "\n".join(lines) + "\n"


def sources(material: Material) -> str:
    """Return each number of a material with its grade and source."""
    lines = [f"{material.name}: {material.title}"]
    for key in NUMBERS:
        value, said = getattr(material, key), material.evidence.get(key)
        if said is not None:
            lines.append(f"  {key:<22}{value:>10.4g}  {said.grade}: {said.source}")
        elif value:
            lines.append(f"  {key:<22}{value:>10.4g}")
    return "\n".join(lines) + "\n"


def markdown(materials: Mapping[str, Material]) -> str:
    """Return the table of numbers and the list of sources."""
    sources = [
        (Code(name), Code(key), evidence.grade, evidence.source)
        for name, material in materials.items()
        for key, evidence in material.evidence.items()
    ]
    columns = ("material", "number", "grade", "source")
    grades = "\n".join(f"* {grade[0]}, {grade}: {said}" for grade, said in GRADES.items())
    numbers, listed = _numbers(materials, "material"), Table(columns, sources)
    parts = (numbers.markdown(), "The letter is the grade:", grades, listed.markdown())
    return "\n\n".join(parts) + "\n"


def as_json(materials: Mapping[str, Material]) -> str:
    """Return the numbers with their evidence, one object per material."""
    return json.dumps({n: asdict(m) for n, m in materials.items()}, indent=2) + "\n"


def _numbers(materials: Mapping[str, Material], first: str) -> Table:
    numbers = [quantity(name, unit, width=8) for _, name, unit, _ in _COLUMNS]
    rows = [
        (Code(name), *(_cell(material, key, divisor) for key, _, _, divisor in _COLUMNS))
        for name, material in materials.items()
    ]
    return Table([first, *numbers], rows)


def _cell(material: Material, key: str, divisor: float) -> str | None:
    value = getattr(material, key)
    if value is None or key not in material.evidence:
        return None
    return f"{value / divisor:.4g} {material.evidence[key].grade[0]}"
