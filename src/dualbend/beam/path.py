"""Paths of the grippers over the end slope: exact, piecewise linear, a cheap polynomial, a table.

A path gives the half distance x(α) and the rise y(α) [m]. In a symmetric
experiment only x causes force and moment; y keeps the middle of the sheet at its place.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import CubicSpline

from dualbend.beam import elastica
from dualbend.beam._check import FloatArray, Real, finite, like, positive, within
from dualbend.errors import InputError


class BendingPath(Protocol):
    """A path: half distance and rise of the grips over the end slope."""

    @property
    def length_m(self) -> float:
        """Free length of the sheet [m]."""

    @property
    def knots(self) -> FloatArray:
        """End slopes from the start to the target, where the pieces meet [rad]."""

    def at(self, alpha: Real) -> tuple[Real, Real]:
        """Return (half distance x, rise y) [m] at α [rad]; InputError outside the path."""


def _on(path: BendingPath, alpha: float | FloatArray) -> FloatArray:
    """Return end slopes as an array, or raise InputError where one is off the path."""
    return within("end slope α [rad]", alpha, float(path.knots[0]), float(path.knots[-1]))


def _range(start: float, target: float) -> FloatArray:
    """Check the ends of a path and return them as two knots."""
    finite("start_rad", start)
    within("target_rad", target, 0.0, elastica.END_SLOPE_GRIPPERS_MEET)
    if not 0.0 <= start < target:
        raise InputError(f"start_rad must lie in [0, target_rad = {target:.6g}), got {start!r}")
    return np.array([start, target])


@dataclass(frozen=True)
class _OnePiece:
    """A path without knots between its start and its target."""

    length_m: float
    target_rad: float = elastica.END_SLOPE_GRIPPERS_MEET
    start_rad: float = 0.0

    def __post_init__(self) -> None:
        positive("length_m", self.length_m)
        _range(self.start_rad, self.target_rad)

    @cached_property
    def knots(self) -> FloatArray:
        """Start and target [rad]."""
        return _range(self.start_rad, self.target_rad)


class ExactPath(_OnePiece):
    """The zero-moment path, paper equations (3) and (4)."""

    def at(self, alpha: Real) -> tuple[Real, Real]:
        """Return (x, y) [m] at α [rad]."""
        _on(self, alpha)
        return elastica.half_distance(alpha, self.length_m), elastica.rise(alpha, self.length_m)


@dataclass(frozen=True)
class PiecewiseLinearPath:
    """x and y linear in α between knots that lie on the zero-moment path."""

    length_m: float
    knots_rad: tuple[float, ...]

    def __post_init__(self) -> None:
        positive("length_m", self.length_m)
        if len(self.knots_rad) < 2 or not np.all(np.diff(self.knots_rad) > 0.0):
            raise InputError(
                f"knots_rad must be two or more growing end slopes, got {self.knots_rad!r}"
            )
        _range(self.knots_rad[0], self.knots_rad[-1])

    @classmethod
    def from_count(
        cls, length_m: float, target_rad: float, pieces: int, *, start_rad: float = 0.0
    ) -> "PiecewiseLinearPath":
        """Return the path of N equal pieces, α(k) = α₀ + (k/N) (α_d − α₀), k = 0..N.

        Paper (6), which prints α(k) = k/N, with the target α_d and the start k = 0 supplied.
        """
        if pieces < 1:
            raise InputError(f"pieces must be 1 or more, got {pieces!r}")
        _range(start_rad, target_rad)
        step = (target_rad - start_rad) / pieces
        inner = (start_rad + k * step for k in range(pieces))
        return cls(length_m=length_m, knots_rad=(*inner, target_rad))

    @classmethod
    def from_interval(
        cls, length_m: float, target_rad: float, interval_rad: float, *, start_rad: float = 0.0
    ) -> "PiecewiseLinearPath":
        """Return the path of pieces interval_rad long; the last piece is the remainder."""
        positive("interval_rad", interval_rad)
        _range(start_rad, target_rad)
        # A remainder of a rounding error is no piece.
        count = max(1, math.ceil((target_rad - start_rad) / interval_rad - 1e-9))
        inner = (start_rad + k * interval_rad for k in range(count))
        return cls(length_m=length_m, knots_rad=(*inner, target_rad))

    @cached_property
    def knots(self) -> FloatArray:
        """End slopes where the pieces meet [rad]."""
        return np.array(self.knots_rad)

    @cached_property
    def _values(self) -> tuple[FloatArray, FloatArray]:
        knots = self.knots
        return elastica.half_distance(knots, self.length_m), elastica.rise(knots, self.length_m)

    def at(self, alpha: Real) -> tuple[Real, Real]:
        """Return (x, y) [m] at α [rad]."""
        slopes = _on(self, alpha)
        x, y = (np.asarray(np.interp(slopes, self.knots, values)) for values in self._values)
        return like(alpha, x), like(alpha, y)


@dataclass(frozen=True)
class ApproximatePath(_OnePiece):
    """A polynomial in α² instead of two elliptic integrals: 2 × degree + 5 multiplications.

    Worst errors of x and y over L and the largest moment over EI/L that they cause, for a target
    of 1.2 rad (measured):

        degree 1   6.8e-5   3.2e-4   2.5e-3
        degree 2   1.0e-7   2.9e-6   3.7e-6
        degree 3   7.5e-9   9.0e-9   2.7e-7

    Use the true target: for 2.28 rad the errors of degree 3 are 1.5e-5 and 1.8e-5.
    """

    degree: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        self.coefficients  # noqa: B018 - refuses a bad degree now, not in the loop

    @cached_property
    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Coefficients f, g, lowest power first, for α up to the target.

        With u = α²:   x/L ≈ ½ − u f(u),   y/L ≈ α g(u).
        f and g interpolate (L/2 − x)/(L u) and y/(L α) of the closed form at the Chebyshev points
        of u, which is within a small factor of the best polynomial. The leading α² and α are kept
        in form: the error of x falls as α², so the moment that it causes falls as α; α = 0 is flat.
        """
        limit, count = self.target_rad, self.degree + 1
        within("target_rad", limit, 0.01, elastica.END_SLOPE_GRIPPERS_MEET)
        if not 0 <= self.degree <= 12:
            raise InputError(f"degree must lie in [0, 12], got {self.degree!r}")
        u = limit**2 / 2.0 * (chebyshev.chebpts1(count) + 1.0)
        alpha = np.sqrt(u)
        powers = np.vander(u / limit**2, count, increasing=True)
        scale = limit ** (2.0 * np.arange(count))
        f = np.linalg.solve(powers, elastica.shortening(alpha, 1.0) / u) / scale
        g = np.linalg.solve(powers, elastica.rise(alpha, 1.0) / alpha) / scale
        return f, g

    def at(self, alpha: Real) -> tuple[Real, Real]:
        """Return (x, y) [m] at α [rad]."""
        slopes = _on(self, alpha)
        f, g = self.coefficients
        u = slopes * slopes
        p, q = np.full_like(u, f[-1]), np.full_like(u, g[-1])
        for c, d in zip(f[-2::-1], g[-2::-1], strict=True):
            p, q = p * u + c, q * u + d
        x, y = self.length_m * (0.5 - u * p), self.length_m * slopes * q
        return like(alpha, np.asarray(x)), like(alpha, np.asarray(y))


@dataclass(frozen=True)
class TablePath:
    """x and y from a table over α, straight or with a cubic spline between its rows.

    ``rows`` are (α [rad], half distance [m], rise [m]), α growing. ``smooth``: a natural cubic
    spline with knots at its ends only. From ``start_rad`` to ``target_rad`` the table is used.

    Raises InputError for fewer than two rows, α that does not grow, a part outside the table, or
    grips farther apart than the sheet is long.
    """

    length_m: float
    rows: tuple[tuple[float, float, float], ...]
    smooth: bool = False
    target_rad: float | None = None
    start_rad: float | None = None

    def __post_init__(self) -> None:
        positive("length_m", self.length_m)
        if len(self.rows) < 2:
            raise InputError(f"table needs two or more rows, got {len(self.rows)}")
        alpha, half, rise = self._columns
        if not (np.isfinite(half).all() and np.isfinite(rise).all()):
            raise InputError("table must hold finite numbers only")
        for n in np.flatnonzero(~(np.diff(alpha) > 0.0)).tolist():
            raise InputError(
                f"table: α must grow from row to row, got {alpha[n]:g} then {alpha[n + 1]:g} rad"
            )
        most = 0.5 * self.length_m
        for n in np.flatnonzero((half <= 0.0) | (half > most * (1.0 + 1e-3))).tolist():
            raise InputError(
                f"table, row {n + 1}: half distance = {half[n]:g} m must lie above 0 and at most "
                f"at half the free length, {most:g} m"
            )
        start, target = self._ends
        if not alpha[0] <= start < target <= alpha[-1]:
            raise InputError(
                f"start_rad = {start:g} and end_rad = {target:g} must lie, one after the other, in "
                f"the table, which goes from {alpha[0]:g} to {alpha[-1]:g} rad"
            )
        _range(start, target)

    @cached_property
    def _columns(self) -> FloatArray:
        return np.array(self.rows, dtype=np.float64).T

    @property
    def _ends(self) -> tuple[float, float]:
        """Start and target [rad]; without numbers of their own those of the table."""
        given = zip((self.start_rad, self.target_rad), self._columns[0, [0, -1]], strict=True)
        start, target = (float(end if own is None else own) for own, end in given)
        return start, target

    @cached_property
    def knots(self) -> FloatArray:
        """End slopes where the pieces meet [rad]."""
        alpha, (start, target) = self._columns[0], self._ends
        inner = () if self.smooth else alpha[(alpha > start) & (alpha < target)]
        return np.array([start, *inner, target])

    @cached_property
    def _spline(self) -> CubicSpline:
        alpha, *values = self._columns
        return CubicSpline(alpha, np.transpose(values), bc_type="natural")

    def at(self, alpha: Real) -> tuple[Real, Real]:
        """Return (x, y) [m] at α [rad]."""
        slopes = _on(self, alpha)
        if self.smooth:
            x, y = np.moveaxis(self._spline(slopes), -1, 0)
        else:
            x, y = (np.interp(slopes, self._columns[0], values) for values in self._columns[1:])
        return like(alpha, np.asarray(x)), like(alpha, np.asarray(y))
