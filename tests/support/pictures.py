"""Pictures as figures, for tests of what lies where in them."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure


def kept_figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Return a list that gets every figure written from now on, laid out; files are empty."""
    found: list[Figure] = []

    def keep(figure: Figure, path: Path, **_: object) -> None:
        figure.draw_without_rendering()  # type: ignore[no-untyped-call]
        found.append(figure)
        path.touch()

    monkeypatch.setattr(Figure, "savefig", keep)
    return found
