"""Checks of the paper's stability analysis, (16)-(25)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from dualbend.stability.continuous import (
    ContinuousLoop,
    k_for_every_damping,
    largest_stiffness,
    smallest_k,
    unstable_damping,
)
from icra1995.row import Printed


def random_loops(count: int = 1000, seed: int = 24) -> Iterator[ContinuousLoop]:
    """Yield loops (22) with b, k, k_e, ω_n, ξ spread over decades."""
    rng = np.random.default_rng(seed)
    for b, k, k_e, omega, xi in 10.0 ** rng.uniform(
        [-3, -2, -2, 0, -2], [3, 4, 6, 2, 1], (count, 5)
    ):
        yield ContinuousLoop(
            b=b, k=k, stiffness=k_e, omega_rad_per_s=omega, two_xi_omega=2.0 * xi * omega
        )


def loop(b: float, k: float, k_e: float, omega: float, two_xi_omega: float) -> ContinuousLoop:
    """Return the loop of (16)-(22)."""
    return ContinuousLoop(b=b, k=k, stiffness=k_e, omega_rad_per_s=omega, two_xi_omega=two_xi_omega)


def error_of_18(sign: float, count: int = 100) -> float:
    """Return the largest relative difference from (19) of (16) with x_d = x_c + sign (Z_e/Z_c) x.

    (18) is printed with sign 1 (x₀ = 0). Compared at s = iω_n.
    """
    worst = 0.0
    for tried in random_loops(count):
        w2, s = tried.omega_rad_per_s**2, 1j * tried.omega_rad_per_s
        robot = w2 / (s * s + tried.two_xi_omega * s + w2)
        ratio = tried.stiffness / (tried.b * s + tried.k)
        x = np.linalg.solve([[1.0, -robot], [-sign * ratio, 1.0]], [0.0, 1.0])[0]
        worst = max(worst, abs(x * (1.0 + robot * ratio) / robot - 1.0))
    return worst


def error_of_22(count: int = 1000) -> float:
    """Return the largest relative error of (22)'s coefficients against (16), (20), (21) in (19)."""
    worst = 0.0
    for tried in random_loops(count):
        w2 = tried.omega_rad_per_s**2
        product = np.polymul([1.0, tried.two_xi_omega, w2], [tried.b, tried.k])
        closed = np.polyadd(product, [w2 * tried.stiffness])
        worst = max(worst, float(np.abs(tried.polynomial / closed - 1.0).max()))
    return worst


def left_side_of_23(tried: ContinuousLoop) -> float:
    """Return the left side of (23), term by term as printed."""
    b, k, k_e = tried.b, tried.k, tried.stiffness
    w, xi = tried.omega_rad_per_s, tried.two_xi_omega / (2.0 * tried.omega_rad_per_s)
    return 2 * b**2 * xi * w**3 + 4 * xi**2 * w**2 * b * k + 2 * xi * w * k**2 - w**2 * b * k_e


def disagreements_of_23(count: int = 1000) -> int:
    """Return at how many random loops (23) as printed contradicts the roots of (22).

    A loop whose rightmost root is within 1e-9 of the axis (relative) has no verdict.
    """
    wrong = 0
    for tried in random_loops(count):
        roots = np.roots(tried.polynomial)
        rightmost = roots.real.max()
        if abs(rightmost) > 1e-9 * np.abs(roots).max():
            wrong += int((left_side_of_23(tried) > 0.0) != bool(rightmost < 0.0))
    return wrong


def stiffness_of_limits(b: float, k: float, omega: float, two_xi_omega: float) -> float:
    """Return the k_e at which (23) has its boundary at (b, k)."""
    return float(largest_stiffness(np.array(b), np.array(k), omega, two_xi_omega))


def lower_damping(k: float, k_e: float, omega: float, two_xi_omega: float) -> float:
    """Return the b below which (23) holds at k; infinite where it holds for every b."""
    found = unstable_damping(k, k_e, omega, two_xi_omega)
    return math.inf if found is None else found[0]


def upper_damping(k: float, k_e: float, omega: float, two_xi_omega: float) -> float:
    """Return the b above which (23) holds at k; 0 where it holds for every b."""
    found = unstable_damping(k, k_e, omega, two_xi_omega)
    return 0.0 if found is None else found[1]


def growth_per_s(b: float, k: float, k_e: float, omega: float, two_xi_omega: float) -> float:
    """Return the growth rate of (22)'s dominant root [1/s]; positive: unstable."""
    return loop(b, k, k_e, omega, two_xi_omega).mode().growth_per_s


def onsets_by_less_damping(k: float, k_e: float, omega: float, two_xi_omega: float) -> int:
    """Count how often (22) turns unstable as b falls from 10 to 1e-4 in 400 logarithmic steps."""
    verdicts = [
        loop(float(b), k, k_e, omega, two_xi_omega).routh_stable
        for b in np.geomspace(10.0, 1e-4, 400)
    ]
    return sum(a and not b for a, b in itertools.pairwise(verdicts))


def delay_margin_s(b: float, k: float, k_e: float, omega: float, two_xi_omega: float) -> float:
    """Return the dead time [s] that the loop of (22) bears; negative where it is unstable."""
    return loop(b, k, k_e, omega, two_xi_omega).margins().delay_s


def robust_k(k_e: float, omega: float, two_xi_omega: float) -> float:
    """Return a k 5 % above what (23) needs for every b."""
    return 1.05 * k_for_every_damping(k_e, omega, two_xi_omega)


READINGS_OF_K_E = (0.5, 1.0, 2.0)
READINGS_OF_TWO_XI_OMEGA = (0.5, 1.0, 2.0)
READINGS_OF_OMEGA = (1.0, 1.0 / (2.0 * math.pi))


def nearest_reading(paper: Printed) -> tuple[float, tuple[float, float, float]]:
    """Return the reading of k_e, 2ξω_n and ω_n (factors) for which (23) comes nearest to (24).

    The error is |k needed at the printed limit of b / printed limit of k − 1|. The factors: one
    arm, both, half; 2ξω_n, ξω_n or 4ξω_n being 25; 2 Hz or 2 rad/s.
    """
    best = (math.inf, (1.0, 1.0, 1.0))
    for e in READINGS_OF_K_E:
        for c in READINGS_OF_TWO_XI_OMEGA:
            for w in READINGS_OF_OMEGA:
                k = smallest_k(
                    paper.limit_b,
                    e * paper.k_e,
                    w * paper.omega_rad_per_s,
                    c * paper.two_xi_omega,
                )
                best = min(best, (abs(k / paper.limit_k - 1.0), (e, c, w)))
    return best
