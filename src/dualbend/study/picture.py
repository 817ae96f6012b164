"""How the pictures of the studies are written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from dualbend.errors import InputError


def save(figure: Figure, path: Path, **options: Any) -> None:  # noqa: ANN401 - matplotlib's own
    """Write a picture; InputError where that fails.

    A figure that is made without pyplot needs no display and no choice of a backend.
    """
    try:
        figure.savefig(path, dpi=120, **options)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be written: {error}") from error
