"""Rigidity between beam and plate: the stiffness of a strip of given width and curvature.

A strip that is bent about y tends to curve across its width in the opposite direction
(anticlastically), by ν κ. A narrow strip does so and is a beam, EI. In a wide strip the membrane
stress flattens all but the edges, and the strip is a plate, D w = EI / (1 − ν²). The section across
is a beam on an elastic foundation of stiffness E t κ²: D w'''' + E t κ² w = 0, free edges
w'' = −ν κ, w''' = 0. With B = β w/2 and β² = (κ/t) √(3 (1 − ν²)), so that B² is 0.41 of Searle's
parameter w²/(R t) at ν = 0.33,

    −mean w'' / (ν κ) = F(B) = (cosh 2B − cos 2B) / (B (sinh 2B + sin 2B)),
    M / (EI κ) = (1 − ν² (F + B F'/4)) / (1 − ν²)        from M = dU/dκ, U = D w κ² (1 − ν² F) / 2.

Source: Lamb, Proc. London Math. Soc. 21 (1891) 70; Searle, Experimental Elasticity (1908); Ashwell,
J. R. Aeronaut. Soc. 54 (1950) 708. For a laminate ν is D12/√(D11 D22) and β⁴ = A κ² / (4 D22).
"""

from __future__ import annotations

import math
from typing import Literal

from dualbend.beam._check import positive
from dualbend.errors import InputError

Rigidity = Literal["beam", "plate", "width"]

_FLAT, _WIDE = 0.03, 18.0
"""Below the first B the strip is a beam to 1e-6, above the second e^-2B is 0."""


def searle_parameter(width_m: float, thickness_m: float, curvature_per_m: float) -> float:
    """Return w² κ / t, about 1 for a beam, above 100 for a plate."""
    return width_m**2 * abs(curvature_per_m) / thickness_m


def anticlastic_share(B: float) -> float:
    """Return F + B F'/4: 1 where the strip is free to bend across, 0 where it is held flat."""
    if B < _FLAT:
        return 1.0
    if B > _WIDE:
        return 0.75 / B
    cosh, cos = math.cosh(2.0 * B), math.cos(2.0 * B)
    total = math.sinh(2.0 * B) + math.sin(2.0 * B)
    share = (cosh - cos) / (B * total)
    slope = 2.0 - share - 2.0 * (cosh * cosh - cos * cos) / total**2
    return share + slope / 4.0


def rigidity_ratio(
    rigidity: Rigidity,
    poisson_ratio: float,
    width_m: float,
    thickness_m: float,
    curvature_per_m: float,
    foundation_ratio: float = 1.0,
) -> float:
    """Return the bending stiffness over EI: 1, 1 / (1 − ν²), or between them for the width.

    ``foundation_ratio`` is A t² / (12 (1 − ν²) D22) of a laminate, 1 of one isotropic layer.
    """
    if rigidity == "beam":
        return 1.0
    square = poisson_ratio**2
    plate = 1.0 / (1.0 - square)
    if rigidity == "plate":
        return plate
    if rigidity != "width":
        raise InputError(f"rigidity must be 'beam', 'plate' or 'width', got {rigidity!r}")
    positive("width_m", width_m)
    positive("thickness_m", thickness_m)
    beta_square = (
        abs(curvature_per_m) / thickness_m * math.sqrt(3.0 * (1.0 - square) * foundation_ratio)
    )
    B = math.sqrt(beta_square) * width_m / 2.0
    return (1.0 - square * anticlastic_share(B)) * plate
