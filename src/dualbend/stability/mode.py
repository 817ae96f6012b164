"""What an eigenvalue of one 28 ms cycle means in time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dualbend.control.clock import COMMAND_PERIOD_S


@dataclass(frozen=True, kw_only=True)
class Mode:
    """The eigenvalue of the cycle that decides: the largest |z|, and what it is in time.

    Growth rate ln|z|/T [1/s], frequency |arg z|/(2πT) [Hz], damping ratio −Re s/|s| of s = ln z/T.
    """

    spectral_radius: float
    growth_per_s: float
    frequency_hz: float
    damping_ratio: float

    @property
    def stable(self) -> bool:
        """All eigenvalues are inside the unit circle."""
        return self.spectral_radius < 1.0


def describe_mode(z: complex) -> Mode:
    """Return what an eigenvalue of one cycle means in time."""
    radius = abs(z)
    if radius < 1e-12:
        return Mode(
            spectral_radius=radius, growth_per_s=-math.inf, frequency_hz=0.0, damping_ratio=1.0
        )
    s = complex(math.log(radius), abs(math.atan2(z.imag, z.real))) / COMMAND_PERIOD_S
    return Mode(
        spectral_radius=radius,
        growth_per_s=s.real,
        frequency_hz=s.imag / (2.0 * math.pi),
        damping_ratio=-s.real / abs(s) if s else 0.0,
    )
