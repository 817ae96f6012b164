"""One line of the audit: what the paper prints, what was found, and what a reader may conclude."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import msgspec

Verdict = Literal["confirmed", "confirmed under an assumption", "not reproducible", "misprint"]
VERDICTS: tuple[Verdict, ...] = (
    "confirmed",
    "confirmed under an assumption",
    "not reproducible",
    "misprint",
)


class Printed(msgspec.Struct, frozen=True, kw_only=True):
    """The numbers that the paper prints; every verdict is computed from these.

    Gains (26)-(27) and ``k_e`` in the paper's own (unnamed) units, ``omega_rad_per_s`` its 2 Hz.
    """

    b_x: float = 7.0
    k_x: float = 575.0
    b_rotation: float = 0.5
    k_rotation: float = 10000.0
    k_e: float = 11500.0
    omega_rad_per_s: float = 4.0 * math.pi
    two_xi_omega: float = 25.0
    limit_k: float = 550.0
    limit_b: float = 6.92
    period_s: float = 0.028
    rate_hz: float = 35.7
    cutoff_hz: float = 10.0
    interval_rad: float = 0.2


PAPER = Printed()

EXACT = 1e-9
"""Largest difference of two solutions of one equation that is rounding."""


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """One checked statement.

    ``where``: equation or section; ``claim``: what is printed; ``call``: an expression of the
    functions of this study and of ``dualbend.stability.continuous`` whose value is
    ``number``; ``found``: that number in words with its unit; ``assumption``: without which the
    verdict does not hold, or empty.
    """

    where: str
    claim: str
    found: str
    number: float
    call: str
    verdict: Verdict
    assumption: str
    conclusion: str


class Called(msgspec.Struct, frozen=True):
    """A function's value and the expression that gives it."""

    text: str
    number: float


def called(function: Callable[..., float], *arguments: float | str) -> Called:
    """Return what a function of this package gives, and how to ask it again."""
    module = function.__module__.rpartition(".")[2]
    shown = ", ".join(f"{a:.12g}" if isinstance(a, float) else repr(a) for a in arguments)
    return Called(f"{module}.{function.__name__}({shown})", float(function(*arguments)))


def finding(
    where: str,
    claim: str,
    call: Called,
    found: str,
    verdict: tuple[Verdict, str],
    assumption: str = "",
) -> Finding:
    """Return a finding; ``verdict`` comes with the conclusion that belongs to it.

    ``{}`` in ``found`` takes the number.
    """
    return Finding(
        where=where,
        claim=claim,
        found=found.format(call.number),
        number=call.number,
        call=call.text,
        verdict=verdict[0],
        assumption=assumption if verdict[0] == "confirmed under an assumption" else "",
        conclusion=verdict[1],
    )


def rounding(value: float) -> str:
    """Return a difference in words that do not depend on the machine where it is rounding."""
    return "less than 1e-9" if abs(value) < EXACT else f"{value:.1g}"


def either(
    holds: bool, if_so: tuple[Verdict, str], if_not: tuple[Verdict, str]
) -> tuple[Verdict, str]:
    """Return the verdict with its conclusion that a comparison decides."""
    return if_so if holds else if_not
