"""Seeded streams of random numbers: one for each imperfection, which no other one moves."""

from __future__ import annotations

import zlib

import numpy as np

from dualbend.types import Vector


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Return the generator of a scenario's seed that belongs to these names.

    Two streams of different names are independent, and none is that of the sensors' noise.
    """
    words = [zlib.crc32(str(name).encode()) for name in names]
    return np.random.default_rng([seed, *words])


def cut_normal(generator: np.random.Generator, spread: float, shape: tuple[int, ...]) -> Vector:
    """Return normal draws of mean 0 and standard deviation ``spread``, cut at 3 σ."""
    return spread * np.clip(generator.standard_normal(shape), -3.0, 3.0)
