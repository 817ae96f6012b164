"""Where the models and scenarios are, in a wheel as well as in a source checkout; usable cores."""

import os
from pathlib import Path

from dualbend.errors import DualbendError

_PACKAGE = Path(__file__).resolve().parent


def _find(name: str, holding: str = "") -> Path:
    """Return the folder inside the installed package, else at the top of the checkout.

    ``holding``: a file that it must have.

    Raises
    ------
    DualbendError
        Neither place has the folder: the installation is incomplete.
    """
    # src/dualbend/resources.py: two levels above the package is the checkout.
    candidates = (_PACKAGE / name, _PACKAGE.parents[1] / name)
    for folder in candidates:
        if folder.is_dir() and (folder / holding).exists():
            return folder
    looked = " or ".join(str(folder) for folder in candidates)
    raise DualbendError(f"no folder {name!r}: looked for {looked}; reinstall dualbend")


def models_dir() -> Path:
    """Return the folder that holds one sub-folder per MJCF model."""
    return _find("models")


def scenarios_dir() -> Path:
    """Return the folder that holds the scenario TOML files."""
    return _find("scenarios")


def limitations_file() -> Path:
    """Return the page of known limitations, which every report quotes."""
    return _find("docs", "limitations.md") / "limitations.md"


def usable_cores() -> int:
    """Return how many processor cores this process may use; a machine may have more."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
