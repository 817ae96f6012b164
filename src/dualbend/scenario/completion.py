"""What a shell offers at a tab, where the tools' own completion does not know it.

A shell starts the command at every tab, so this reads the folder and imports nothing heavy.
"""

from __future__ import annotations

import os
import tomllib

from click.shell_completion import CompletionItem

from dualbend.errors import DualbendError
from dualbend.scenario import shipped


def complete_scenario(incomplete: str) -> list[CompletionItem]:
    """Return the shipped scenarios that begin so, with their descriptions, else files.

    An unreadable installation offers files instead of a traceback in the user's prompt.
    """
    try:
        found = shipped.descriptions()
    except (DualbendError, OSError, tomllib.TOMLDecodeError):
        found = {}
    names = [name for name in found if name.startswith(incomplete)]
    if os.sep in incomplete or not names:
        return [CompletionItem(incomplete, type="file")]
    return [CompletionItem(name, help=found[name]) for name in names]
