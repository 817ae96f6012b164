"""matplotlib as every picture has it: alike whatever the environment and its own files say."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager

_backend = os.environ.pop("MPLBACKEND", None)
_log = logging.getLogger("matplotlib")
_level = _log.level
_log.setLevel(logging.ERROR)  # of a home that cannot be written
try:
    # It refuses to be imported where MPLBACKEND names what is not installed here.
    import matplotlib as mpl
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline
finally:
    _log.setLevel(_level)
    if _backend is not None:
        os.environ["MPLBACKEND"] = _backend

__all__ = ["Axes", "Figure", "FigureBase", "Outline", "PathPatch", "mpl", "own_style"]

_STYLE = {key: mpl.rcParamsDefault[key] for key in mpl.rcParamsDefault if "backend" not in key}


@contextmanager
def own_style() -> Iterator[None]:
    """Draw with matplotlib's defaults, not with a ``matplotlibrc``; also a decorator.

    A figure that is made without pyplot needs no display and no choice of a backend.
    """
    with mpl.rc_context(_STYLE):
        yield
