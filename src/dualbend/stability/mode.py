"""What an eigenvalue of one command cycle means in time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True, kw_only=True)
class Mode:
    """The dominant eigenvalue z of the cycle, the one of largest |z|, and its meaning in time.

    With s = ln z / T: growth rate Re s [1/s], frequency |Im s|/(2π) [Hz], damping ratio −Re s/|s|.
    """

    spectral_radius: float
    growth_per_s: float
    frequency_hz: float
    damping_ratio: float

    @property
    def stable(self) -> bool:
        """All eigenvalues are inside the unit circle."""
        return self.growth_per_s < 0.0


def describe_mode(z: complex, period_s: float) -> Mode:
    """Return what an eigenvalue of one cycle of ``period_s`` [s] means in time."""
    if abs(z) < 1e-12:
        return Mode(
            spectral_radius=abs(z), growth_per_s=-math.inf, frequency_hz=0.0, damping_ratio=1.0
        )
    s = complex(math.log(abs(z)), math.atan2(z.imag, z.real)) / period_s
    return replace(describe_pole(s), spectral_radius=abs(z))


def describe_pole(s: complex) -> Mode:
    """Return what a pole [1/s] of a continuous loop means in time."""
    return Mode(
        spectral_radius=math.nan,
        growth_per_s=s.real,
        frequency_hz=abs(s.imag) / (2.0 * math.pi),
        damping_ratio=-s.real / abs(s) if s else 0.0,
    )
