"""What the shipped scenarios are, read as plain TOML, for lists and for a shell's completion.

No physics is imported: a shell starts the command at every tab.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

from click.shell_completion import CompletionItem

from dualbend.errors import DualbendError
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
    """Return the shipped scenarios with their descriptions, one per line."""
    found = descriptions()
    width = max(map(len, found), default=0) + 2
    return "\n".join(f"{name:<{width}}{text}" for name, text in found.items())


def complete_scenario(incomplete: str) -> list[CompletionItem]:
    """Return the shipped scenarios that begin so, with their descriptions, else files.

    An unreadable installation offers files instead of a traceback in the user's prompt.
    """
    try:
        found = descriptions()
    except (DualbendError, OSError, tomllib.TOMLDecodeError):
        found = {}
    names = [name for name in found if name.startswith(incomplete)]
    if os.sep in incomplete or not names:
        return [CompletionItem(incomplete, type="file")]
    return [CompletionItem(name, help=found[name]) for name in names]
