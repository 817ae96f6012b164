"""Seeded streams of random numbers: one for each imperfection, which no other one moves."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import partial

import numpy as np

from dualbend.control.worlds import BLOCK, Draw
from dualbend.types import Vector

_CUT = 3.0


def stream(seed: int, *names: str | int, repeat: int = 0) -> np.random.Generator:
    """Return the generator of a scenario's seed that belongs to these names.

    Two streams of different names are independent, and none is that of the sensors' noise.
    ``repeat``: number of the sheet in a series, of what differs from sheet to sheet.
    """
    words = [zlib.crc32(str(name).encode()) for name in names]
    return np.random.default_rng([seed, *words, *((repeat,) if repeat else ())])


def noise_streams(seed: int, count: int, repeat: int = 0) -> list[np.random.Generator]:
    """Return the generators of the sensors' noise, as :func:`stream` has seed and ``repeat``."""
    root = np.random.SeedSequence([seed, repeat] if repeat else seed)
    return [np.random.default_rng(child) for child in root.spawn(count)]


def cut_normal(rng: np.random.Generator, spread: float, shape: tuple[int, ...]) -> Vector:
    """Draw normal errors of standard deviation ``spread``, cut at three of it: no part is worse."""
    return np.clip(rng.standard_normal(shape), -_CUT, _CUT) * spread


def ahead(
    draw: Callable[[tuple[int, ...]], Vector], *size: int, when: float | bool = True
) -> Draw | None:
    """Return what draws numbers (*size) for the next BLOCK cycles; None where none are needed."""
    return partial(draw, (BLOCK, *size)) if when else None
