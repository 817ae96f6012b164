"""Figs. 6, 8 and 9 on the narrow strip: fixed scenarios, of which many tests hold numbers."""

from pathlib import Path

_FOLDER = Path(__file__).parents[2] / "docs" / "studies" / "icra1995"

STRIP6, STRIP8, STRIP9 = (str(_FOLDER / f"strip-fig{n}.toml") for n in (6, 8, 9))
"""What ``load_scenario`` and the command line take."""
