"""How the pictures of the studies are written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from dualbend.errors import writing


def save(figure: Figure, path: Path, **options: Any) -> None:  # noqa: ANN401 - matplotlib's own
    """Write a picture; InputError where that fails.

    A figure that is made without pyplot needs no display and no choice of a backend.
    """
    with writing(path, also=ValueError):
        figure.savefig(path, dpi=120, **options)
