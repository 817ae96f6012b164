"""Checks of input numbers, and the scalar-or-array convention of this package."""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError

FloatArray = NDArray[np.float64]
Real = TypeVar("Real", float, FloatArray)
"""A float gives a float, an array gives an array of the same shape."""


def like(template: Real, value: FloatArray) -> Real:
    """Return ``value`` as a float where ``template`` is a scalar."""
    if isinstance(template, np.ndarray):
        return value
    return float(value)


def positive(name: str, value: float) -> float:
    """Return ``value`` if it is finite and above zero, or raise InputError."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be finite and above 0, got {value!r}")
    return float(value)


def finite(name: str, value: float) -> float:
    """Return ``value`` if it is finite, or raise InputError."""
    if not math.isfinite(value):
        raise InputError(f"{name} must be finite, got {value!r}")
    return float(value)


def within(name: str, value: float | FloatArray, low: float, high: float) -> FloatArray:
    """Return ``value`` as an array if all of it lies in [low, high], or raise InputError."""
    array = np.asarray(value, dtype=np.float64)
    bad = ~((array >= low) & (array <= high))
    if bad.any():
        worst = float(array[bad].flat[0])
        raise InputError(f"{name} must lie in [{low:.6g}, {high:.6g}], got {worst!r}")
    return array
