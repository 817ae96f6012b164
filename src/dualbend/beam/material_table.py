"""The material library as text, Markdown and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict

from dualbend.beam.material import GRADES, Material

_COLUMNS = (
    # attribute, heading, divisor
    ("young_pa", "E [GPa]", 1e9),
    ("transverse_young_pa", "E across [GPa]", 1e9),
    ("poisson_ratio", "ν", 1.0),
    ("density_kg_per_m3", "ρ [kg/m³]", 1.0),
    ("yield_pa", "yield [MPa]", 1e6),
    ("tangent_pa", "slope beyond [GPa]", 1e9),
    ("strain_at_failure", "breaks at [%]", 0.01),
)


def overview(materials: Mapping[str, Material]) -> str:
    """Return one line per material, with the letter of each number's grade."""
    widths = [max(8, len(heading)) + 2 for _, heading, _ in _COLUMNS]
    name_width = max(len(name) for name in materials) + 2
    head = "".join(f"{h:>{w}}" for (_, h, _), w in zip(_COLUMNS, widths, strict=True))
    lines = [" " * name_width + head]
    for name, material in materials.items():
        cells = (
            f"{_cell(material, column):>{w}}" for column, w in zip(_COLUMNS, widths, strict=True)
        )
        lines.append(f"{name:<{name_width}}{''.join(cells)}")
    grades = "; ".join(f"{grade[0]}: {grade}, {said}" for grade, said in GRADES.items())
    return "\n".join([*lines, "", grades, "dualbend materials NAME: the sources"]) + "\n"


def sources(material: Material) -> str:
    """Return each number of a material with its grade and source."""
    lines = [f"{material.name}: {material.title}"]
    for key, evidence in material.evidence.items():
        value = getattr(material, key)
        lines.append(f"  {key:<22}{value:>10.4g}  {evidence.grade}: {evidence.source}")
    return "\n".join(lines) + "\n"


def markdown(materials: Mapping[str, Material]) -> str:
    """Return the table of numbers and the list of sources."""
    lines = [
        "| material | " + " | ".join(heading for _, heading, _ in _COLUMNS) + " |",
        "|---" * (len(_COLUMNS) + 1) + "|",
    ]
    for name, material in materials.items():
        cells = " | ".join(_cell(material, column) for column in _COLUMNS)
        lines.append(f"| `{name}` | {cells} |")
    lines += ["", "The letter is the grade:", ""]
    lines += [f"* {grade[0]}, {grade}: {said}" for grade, said in GRADES.items()]
    lines += ["", "| material | number | grade | source |", "|---|---|---|---|"]
    for name, material in materials.items():
        for key, evidence in material.evidence.items():
            lines.append(f"| `{name}` | `{key}` | {evidence.grade} | {evidence.source} |")
    return "\n".join(lines) + "\n"


def as_json(materials: Mapping[str, Material]) -> str:
    """Return the numbers with their evidence, one object per material."""
    return json.dumps({n: asdict(m) for n, m in materials.items()}, indent=2) + "\n"


def _cell(material: Material, column: tuple[str, str, float]) -> str:
    key, _, divisor = column
    value = getattr(material, key)
    if value is None or key not in material.evidence:
        return "-"
    return f"{value / divisor:.4g} {material.evidence[key].grade[0]}"
