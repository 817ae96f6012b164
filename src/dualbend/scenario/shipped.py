"""What the shipped scenarios are, read as plain TOML: no physics is imported to list them."""

from __future__ import annotations

import tomllib
from pathlib import Path

from dualbend.resources import scenarios_dir


def descriptions() -> dict[str, str]:
    """Return what each shipped scenario says of itself, by name, sorted.

    A description is never inherited with ``extends``, so the file alone has it.
    """
    found = {path.stem: _description(path) for path in scenarios_dir().glob("*.toml")}
    return dict(sorted(found.items()))


def _description(path: Path) -> str:
    with path.open("rb") as file:
        return str(tomllib.load(file).get("description", ""))


def table() -> str:
    """Return the shipped scenarios with their descriptions, a line each."""
    found = descriptions()
    width = max(map(len, found), default=0) + 2
    return "\n".join(f"{name:<{width}}{text}" for name, text in found.items())
