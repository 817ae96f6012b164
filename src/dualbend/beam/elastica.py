"""The zero-moment elastica in closed form, as functions of the end slope α.

Symbols as in the paper: m = sin²(α/2), K = K(m) and E = E(m) the complete elliptic integrals,
x the half distance between the grippers, y the rise of the ends above the middle. Every function
takes a float and returns a float, or takes an array and returns one of the same shape. An end
slope that is not a number in [0, END_SLOPE_GRIPPERS_MEET] raises InputError.

Source: the paper, equations (1)-(5).
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipj, ellipk, elliprd, elliprf

from dualbend.beam._check import FloatArray, Real, like, positive, within


def _parameter(alpha: float) -> float:
    return math.sin(alpha / 2.0) ** 2


def _root(function: Callable[[float], float]) -> float:
    return float(brentq(function, 1.0, 3.0, xtol=1e-15, rtol=1e-15))


END_SLOPE_GRIPPERS_MEET: Final = _root(
    lambda a: 2.0 * float(ellipe(_parameter(a))) - float(ellipk(_parameter(a)))
)
"""End slope at which the two grippers touch, the root of E/K = 1/2 [rad]."""

END_SLOPE_HIGHEST_RISE: Final = _root(
    lambda a: (
        2.0 * (1.0 - _parameter(a)) * float(ellipk(_parameter(a))) - float(ellipe(_parameter(a)))
    )
)
"""End slope of the largest rise, the root of 2 (1 − m) K = E, where dy/dα = 0 [rad]."""


def _modulus(alpha: float | FloatArray) -> tuple[FloatArray, FloatArray]:
    """Check the end slopes and return k = sin(α/2) and K(k²)."""
    slopes = within("end slope α [rad]", alpha, 0.0, END_SLOPE_GRIPPERS_MEET)
    k = np.sin(slopes / 2.0)
    return k, np.asarray(ellipk(k * k))


def _shortening_ratio(m: FloatArray) -> FloatArray:
    """1 − E/K = (m/3) R_D(0, 1 − m, 1) / K: without a difference of nearly equal numbers."""
    return np.asarray(m * elliprd(0.0, 1.0 - m, 1.0) / (3.0 * ellipk(m)))


def end_force(alpha: Real, EI: float, L: float) -> Real:
    """Return the compressive end force P = (2K)² EI / L² [N]; π² EI / L² at α = 0. Paper (1)."""
    _, K = _modulus(alpha)
    return like(alpha, np.asarray((2.0 * K / positive("L", L)) ** 2 * positive("EI", EI)))


def half_distance(alpha: Real, L: float) -> Real:
    """Return half the distance of the grippers, x = L (E/K − 1/2) [m]. Paper (3)."""
    k, K = _modulus(alpha)
    return like(alpha, np.asarray(positive("L", L) * (ellipe(k * k) / K - 0.5)))


def shortening(alpha: Real, L: float) -> Real:
    """Return L/2 − x = L (1 − E/K) [m], to full relative accuracy for any small α."""
    k, _ = _modulus(alpha)
    return like(alpha, np.asarray(positive("L", L) * _shortening_ratio(k * k)))


def rise(alpha: Real, L: float) -> Real:
    """Return the height of the ends above the middle, y = (L/K) sin(α/2) [m]. Paper (4).

    It grows up to END_SLOPE_HIGHEST_RISE and falls from there on.
    """
    k, K = _modulus(alpha)
    return like(alpha, np.asarray(positive("L", L) * k / K))


def curvature_max(alpha: Real, L: float) -> Real:
    """Return the curvature in the middle, the largest one, κ = (4K/L) sin(α/2) [1/m]."""
    k, K = _modulus(alpha)
    return like(alpha, np.asarray(4.0 * K * k / positive("L", L)))


def surface_strain(alpha: Real, L: float, thickness: float) -> Real:
    """Return the largest strain at the surface, κ t / 2 [-], for a thickness t [m]."""
    bend = np.asarray(curvature_max(alpha, L))
    return like(alpha, np.asarray(bend * positive("thickness", thickness) / 2.0))


def end_slope_from_shortening(shortened: Real, L: float) -> Real:
    """Return the end slope α at which L/2 − x has the given value [m]; accurate near flat.

    Newton on 1 − E/K as a function of m, which is convex, from the bound m ≤ 2 (1 − E/K).
    Raises InputError outside [0, L/2].
    """
    target = within("shortening L/2 − x [m]", shortened, 0.0, positive("L", L) / 2.0) / L
    limit = _parameter(END_SLOPE_GRIPPERS_MEET)
    m = np.minimum(2.0 * target, limit)
    for _ in range(12):
        value = _shortening_ratio(m)
        # d(1 − E/K)/dm = (1 + m b² / (1 − m)) / 2 with b = 1 − (1 − E/K)/m; b → 1/2 at m = 0.
        b = 1.0 - elliprd(0.0, 1.0 - m, 1.0) / (3.0 * ellipk(m))
        m = np.clip(m - 2.0 * (value - target) / (1.0 + m * b * b / (1.0 - m)), 0.0, limit)
    return like(shortened, 2.0 * np.arcsin(np.sqrt(m)))


def end_slope_from_half_distance(x: Real, L: float) -> Real:
    """Return the end slope α with half distance x [m]; one-to-one on the whole range of α.

    Near the flat sheet α ~ √(8 (L/2 − x)/L): a rounding error of x is magnified there, so use
    end_slope_from_shortening where L/2 − x is known by itself. Raises InputError outside [0, L/2].
    """
    distances = within("half distance x [m]", x, 0.0, positive("L", L) / 2.0)
    return like(x, np.asarray(end_slope_from_shortening(L / 2.0 - distances, L)))


def shape(alpha: float, L: float, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points (x, z) [m] and the slope θ [rad] at arc lengths s [m] from the left end.

    With v = 2 K s / L − K: x = (L/2K) (2 E(am v | m) − v), z = −(L/K) sin(α/2) cn v,
    θ = −2 asin(sin(α/2) sn v). x is measured from the mid-plane (−half distance at s = 0), z
    upwards from the level of the ends (−rise in the middle), θ below the horizontal (α at s = 0).
    Raises InputError for α or s out of range. Source: Love, Mathematical Theory of Elasticity,
    art. 262-263.
    """
    modulus, quarter = _modulus(alpha)
    k, K = float(modulus), float(quarter)
    v = 2.0 * K * within("arc length s [m]", s, 0.0, positive("L", L)) / L - K
    sn, cn, dn, _ = ellipj(v, k * k)
    scale = L / (2.0 * K)
    # E(am v | m) by Carlson's integrals: scipy's ellipeinc jumps at isolated amplitudes.
    c, d = cn * cn, dn * dn
    second = sn * elliprf(c, d, 1.0) - k * k / 3.0 * sn**3 * elliprd(c, d, 1.0)
    x = scale * (2.0 * second - v)
    return np.asarray(x), np.asarray(-2.0 * scale * k * cn), np.asarray(-2.0 * np.arcsin(k * sn))
