"""One line of the validation table: what was measured, against what, and whether that is enough."""

import math
from typing import Literal

import msgspec
import numpy as np

from dualbend.types import Vector

Checks = Literal["mechanics", "property"]


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """A measured quantity and its reference, both in ``unit``.

    ``error`` is what is compared with ``tolerance``; the name ends with how it is formed:
    ``(relative)`` |measured − reference| over a scale, ``(absolute)`` |measured − reference|,
    ``(at most)`` the excess over the reference, ``(at least)`` what is missing to it.

    ``checks``: the mechanics alone, where both sides read the same properties and a wrong one
    passes; a property, where the reference is a number that was written down from a source.
    """

    name: str
    checks: Checks = "mechanics"
    measured: float
    reference: float
    unit: str
    error: float
    tolerance: float
    passed: bool


def of_property(row: Row) -> Row:
    """Return a row whose reference was written down from a source, marked as such."""
    return msgspec.structs.replace(row, checks="property")


def relative(
    name: str,
    measured: float,
    reference: float,
    unit: str,
    tolerance: float,
    scale: float | None = None,
) -> Row:
    """Return the row of |measured − reference| / scale; the scale is |reference| by default."""
    size = abs(reference) if scale is None else scale
    error = abs(measured - reference) / size if size else math.nan
    return _row(f"{name} (relative)", measured, reference, unit, error, tolerance)


def worst(
    name: str,
    measured: Vector,
    reference: Vector,
    unit: str,
    tolerance: float,
    scale: Vector | float,
) -> Row:
    """Return the relative row of the point with the largest error; NaN is larger than anything."""
    error = np.abs((measured - reference) / scale)
    i = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    size = float(np.broadcast_to(scale, error.shape)[i])
    return relative(name, measured[i], reference[i], unit, tolerance, size)


def absolute(name: str, measured: float, reference: float, unit: str, tolerance: float) -> Row:
    """Return the row of |measured − reference|."""
    error = abs(measured - reference)
    return _row(f"{name} (absolute)", measured, reference, unit, error, tolerance)


def at_most(name: str, measured: float, bound: float, unit: str) -> Row:
    """Return the row of a measured quantity that must not exceed a bound."""
    excess = np.maximum(0.0, measured - bound)
    return _row(f"{name} (at most)", measured, bound, unit, excess, 0.0)


def at_least(name: str, measured: float, bound: float, unit: str) -> Row:
    """Return the row of a measured quantity that must reach a bound."""
    missing = np.maximum(0.0, bound - measured)
    return _row(f"{name} (at least)", measured, bound, unit, missing, 0.0)


def _row(
    name: str, measured: float, reference: float, unit: str, error: float, tolerance: float
) -> Row:
    # A comparison with NaN is false: what could not be measured has not passed.
    return Row(
        name=name,
        measured=float(measured),
        reference=float(reference),
        unit=unit,
        error=float(error),
        tolerance=tolerance,
        passed=bool(error <= tolerance),
    )
