"""The paper's continuous loop, its Routh condition, and the same loop with its delays.

Sheet k_e, robot G(s) = ω_n²/(s² + c s + ω_n²) with c = 2ξω_n, admittance 1/(b s + k). Paper (22):

    b s³ + (c b + k) s² + (b ω_n² + c k) s + (k + k_e) ω_n² = 0

and (23), Routh: (c b + k)(b ω_n² + c k) > b (k + k_e) ω_n².
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dualbend.errors import InputError
from dualbend.stability.margins import Margins, margins
from dualbend.stability.mode import Mode, describe_pole
from dualbend.stability.sampled import LoopElements
from dualbend.types import Vector

_FREQUENCIES_HZ: Vector = np.geomspace(1e-3, 1e3, 6000)


@dataclass(frozen=True, kw_only=True)
class ContinuousLoop:
    """One axis of the loop in continuous time, in any consistent units.

    ``b`` damping and ``k`` stiffness of the admittance, ``stiffness`` k_e of the sheet,
    ``omega_rad_per_s`` ω_n, ``two_xi_omega`` c = 2ξω_n [1/s], ``delay_s`` all dead time [s], 0 in
    the paper.
    """

    b: float
    k: float
    stiffness: float
    omega_rad_per_s: float
    two_xi_omega: float
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no admittance, no robot or no delay."""
        for name in ("b", "k", "omega_rad_per_s", "two_xi_omega"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise InputError(f"{name} = {getattr(self, name)!r}: must be positive and finite")
        if not 0.0 <= self.delay_s < math.inf:
            raise InputError(f"delay_s = {self.delay_s!r}: must not be negative")

    @property
    def polynomial(self) -> Vector:
        """Coefficients of (22), highest power first; without the delay."""
        b, k, c, w2 = self.b, self.k, self.two_xi_omega, self.omega_rad_per_s**2
        return np.array([b, c * b + k, b * w2 + c * k, (k + self.stiffness) * w2])

    @property
    def routh_stable(self) -> bool:
        """(23), and k + k_e > 0, which the paper takes for granted."""
        a3, a2, a1, a0 = self.polynomial.tolist()
        return bool(a0 > 0.0 and a2 * a1 > a3 * a0)

    def mode(self) -> Mode:
        """Return the dominant root of (22): without the delay exact, with it the crossing root."""
        roots = np.roots(self._with_pade())
        return describe_pole(complex(roots[np.argmax(roots.real)]))

    def _with_pade(self) -> Vector:
        """Return (22) with the delay as a Padé fraction of order 4, exact to 1e-4 for ωτ < 3."""
        closed = self.polynomial
        if not self.delay_s:
            return closed
        loop = self.stiffness * self.omega_rad_per_s**2
        numerator, denominator = pade(self.delay_s, 4)
        opened = closed - np.array([0.0, 0.0, 0.0, loop])
        return np.asarray(np.polyadd(np.polymul(opened, denominator), loop * numerator))

    def margins(self) -> Margins:
        """Return gain, phase and delay margin, by a sweep of the frequency; exact in the delay."""
        s = 2j * math.pi * _FREQUENCIES_HZ
        w2, c = self.omega_rad_per_s**2, self.two_xi_omega
        robot = w2 / (s * s + c * s + w2)
        loop = self.stiffness * robot * np.exp(-s * self.delay_s) / (self.b * s + self.k)
        found = margins(_FREQUENCIES_HZ, loop[:, np.newaxis], stable=True)
        # Without unstable parts of its own the gain margin is the verdict.
        if found.gain > 1.0:
            return found
        return margins(_FREQUENCIES_HZ, loop[:, np.newaxis], stable=False)


def pade(delay_s: float, order: int) -> tuple[Vector, Vector]:
    """Return e^(−sτ) as numerator and denominator of equal order, highest power first."""
    n = order
    terms = [
        math.factorial(2 * n - i)
        * math.factorial(n)
        / (math.factorial(2 * n) * math.factorial(i) * math.factorial(n - i))
        * delay_s**i
        for i in range(n + 1)
    ]
    denominator = np.array(terms[::-1])
    return denominator * (-1.0) ** np.arange(n, -1, -1), denominator


def largest_stiffness(
    b: Vector | float, k: Vector | float, omega_rad_per_s: float, two_xi_omega: float
) -> Vector:
    """Return the largest k_e that (23) allows: (c b + k)(b ω_n² + c k)/(b ω_n²) − k."""
    c, w2 = two_xi_omega, omega_rad_per_s**2
    return np.asarray((c * b + k) * (b * w2 + c * k) / (b * w2) - k)


def smallest_k(b: float, stiffness: float, omega_rad_per_s: float, two_xi_omega: float) -> float:
    """Return the k above which (23) holds at b; 0 where every k will do."""
    c, w2 = two_xi_omega, omega_rad_per_s**2
    # (23) in k: c k² + c² b k + b (c b ω² − ω² k_e) > 0.
    linear, constant = c * c * b, b * w2 * (c * b - stiffness)
    root = linear * linear - 4.0 * c * constant
    return max((-linear + math.sqrt(root)) / (2.0 * c), 0.0) if root > 0.0 else 0.0


def unstable_damping(
    k: float, stiffness: float, omega_rad_per_s: float, two_xi_omega: float
) -> tuple[float, float] | None:
    """Return the damping b between which (23) fails at k; None where it holds for every b."""
    c, w2 = two_xi_omega, omega_rad_per_s**2
    # (23) in b: c ω² b² + (c² k − ω² k_e) b + c k² > 0.
    linear = c * c * k - w2 * stiffness
    root = linear * linear - 4.0 * c * c * w2 * k * k
    if linear >= 0.0 or root <= 0.0:
        return None
    high = (-linear + math.sqrt(root)) / (2.0 * c * w2)
    return k * k / (w2 * high), high


def k_for_every_damping(stiffness: float, omega_rad_per_s: float, two_xi_omega: float) -> float:
    """Return the k above which (23) holds for every b: ω_n² k_e / (c² + 2 c ω_n)."""
    c, w = two_xi_omega, omega_rad_per_s
    return w * w * stiffness / (c * c + 2.0 * c * w)


def paper_loop(
    elements: LoopElements, axis: Literal["x", "rotation"], stiffness: float
) -> ContinuousLoop:
    """Return the loop of one axis as the paper analyses it: no delay, admittance 1/(b s + k)."""
    response = elements.response.config
    omega = 2.0 * math.pi * response.natural_frequency_hz
    b, k = elements.damping_and_stiffness(axis)
    return ContinuousLoop(
        b=b,
        k=k,
        stiffness=stiffness,
        omega_rad_per_s=omega,
        two_xi_omega=2.0 * response.damping_ratio * omega,
    )


def dead_time_s(elements: LoopElements, frequency_hz: float) -> float:
    """Return the loop's dead time [s] at a frequency: transport, age, interpolation and filter.

    A ramp to the set-point over one period delays by one period, as its triangular pulse says.
    """
    return (
        (elements.delay.cycles + 1) * elements.response.period_s
        + elements.age_s
        + elements.low_pass.group_delay_s(frequency_hz)
    )


def delayed_loop(
    elements: LoopElements,
    axis: Literal["x", "rotation"],
    stiffness: float,
    frequency_hz: float = 2.0,
) -> ContinuousLoop:
    """Return the continuous loop with all delays and the compliance that the filter really has.

    The sampled filter of pole a is the lag τ/(1 + τ s) of its own static compliance, with the
    delay a T/(1 − a) that the pole makes: for a pole near 0 that is far less than b/k.
    """
    base = paper_loop(elements, axis, stiffness)
    sampled = elements.axis(axis)
    compliance = sampled.static_compliance
    # Never quite 0, so that the polynomial keeps its degree.
    lag_s = max(sampled.pole * elements.response.period_s / (1.0 - sampled.pole), 1e-6)
    return replace(
        base,
        b=lag_s / compliance,
        k=1.0 / compliance,
        delay_s=dead_time_s(elements, frequency_hz),
    )
