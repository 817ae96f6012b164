"""Compliance of what two arms hold together: the held object follows the net force on it.

The wrenches on the two grips that bend the sheet cancel in their sum; what remains of it, beside
the weight, comes from what the sheet touches. The object then moves as a whole, the arms keep their
relative pose. Source of the idea: object impedance control, Schneider and Cannon, IEEE Trans.
Robotics and Automation 8 (1992) 383.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np

from dualbend.control.clock import COMMAND_PERIOD_S, TransferFunction
from dualbend.types import Vector

NotNegative = Annotated[float, msgspec.Meta(ge=0)]


_SURE_N, _SURE_NM = 0.2, 0.05
"""Force and moment beyond the dead band that noise does not make."""

_MARGIN_SEEKING = 1.25
"""What is left of the gain margin while the sheet lies on the tips of pins."""


class ObjectComplianceConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the held sheet gives way to what it touches: a damper, ``B v = F``.

    A damper follows a force until none is left. What the loop works against is the stiffness of the
    sheet that is held by pins, which grows without bound towards the flat state but for the arms in
    series. B is not set: it follows from that stiffness, the loop's delays and the margin.
    """

    gain_margin: Annotated[
        float, msgspec.Meta(gt=1, le=100, description="of the loop, at every bending angle")
    ] = 4.0
    deadband_n: Annotated[
        NotNegative, msgspec.Meta(description="force below which nothing moves")
    ] = 0.1
    deadband_nm: Annotated[NotNegative, msgspec.Meta(description="the same, moment about z")] = 0.02
    seek_m_per_s: Annotated[
        float, msgspec.Meta(ge=0, le=0.01, description="least speed towards a pin, on its tip")
    ] = 0.5e-3
    seek_rad_per_s: Annotated[float, msgspec.Meta(ge=0, le=0.1, description="the same, yaw")] = 2e-3
    limit_m: Annotated[float, msgspec.Meta(gt=0, description="largest |δx|, |δy|")] = 5e-3
    limit_rad: Annotated[float, msgspec.Meta(gt=0, description="largest turn")] = 0.03


class ObjectAdmittance:
    """Turn the net force on the object into its deviation, δ[n] = δ[n−1] + (T/B) F[n].

    H(z) = (T/B) / (1 − z⁻¹) for each of x, y and yaw, clamped. Beyond the dead band the force less
    the band acts: noise does not make the object wander.

    Parameters
    ----------
    config
        Dead bands and bounds.
    bends, mobility
        1/B (n, 3) of x, y [m/(N s)] and yaw [rad/(N m s)] at n growing bending angles, (n,), each
        over that at which the sheet is laid.
    """

    def __init__(self, config: ObjectComplianceConfig, bends: Vector, mobility: Vector) -> None:
        self.config = config
        self._bends, self._mobility = bends, mobility
        self._seeking = max(1.0, config.gain_margin / _MARGIN_SEEKING)
        self._band = np.array([config.deadband_n, config.deadband_n, config.deadband_nm])
        self._limit = np.array([config.limit_m, config.limit_m, config.limit_rad])
        self.deviation = np.zeros(3)

    def relax(self, speed_m_per_s: float) -> None:
        """Go back towards no deviation, x and y with this speed [m/s], yaw in as long as that."""
        step = COMMAND_PERIOD_S * speed_m_per_s * self._limit / self._limit[0]
        self.deviation = self.deviation - np.clip(self.deviation, -step, step)

    def mobility(self, bend: float) -> Vector:
        """Return 1/B (3,) at a bending angle over that at which the sheet is laid."""
        return np.array([np.interp(bend, self._bends, column) for column in self._mobility.T])

    def update(self, wrench: Vector, bend: float, seeking: bool = False) -> Vector:
        """Take net force x, y [N] and moment z [N m]; return δx, δy [m] and the turn [rad].

        Seeking, on the tips of pins, it goes where the force points with a speed of its own: near
        the top of a tip the force is small however far the pin is. What the loop's margin leaves is
        for the moment at which the object falls into place.
        """
        beyond = np.sign(wrench) * np.maximum(np.abs(wrench) - self._band, 0.0)
        speed = self.mobility(bend) * beyond
        if seeking:
            speed *= self._seeking
            speed[:2] = _at_least(speed[:2], beyond[:2], self.config.seek_m_per_s, _SURE_N)
            speed[2:] = _at_least(speed[2:], beyond[2:], self.config.seek_rad_per_s, _SURE_NM)
        moved = self.deviation + COMMAND_PERIOD_S * speed
        self.deviation = np.clip(moved, -self._limit, self._limit)
        return self.deviation.copy()

    def transfer_function(self, axis: int, bend: float) -> TransferFunction:
        """Tell H(z) of one axis in powers of z⁻¹, without band and clamp."""
        return _damper(float(self.mobility(bend)[axis]))


def _damper(mobility: float) -> TransferFunction:
    """Tell H(z) = (T/B) / (1 − z⁻¹)."""
    return np.array([COMMAND_PERIOD_S * mobility]), np.array([1.0, -1.0])


def _at_least(speed: Vector, force: Vector, least: float, sure: float) -> Vector:
    """Return the speed, in its direction not below ``least`` where the force is a sure one."""
    size = float(np.linalg.norm(speed))
    if size == 0.0:
        return speed
    wanted = least * min(1.0, float(np.linalg.norm(force)) / sure)
    return speed * max(1.0, wanted / size)


def critical_rate(path: Sequence[TransferFunction], latency_cycles: float) -> float:
    """Return the largest stiffness over damping k/B [1/s] with which a damper's loop is stable.

    The loop is ``(k/B) T / (1 − z⁻¹)`` times what the path's elements make of it; at the frequency
    where its phase is −π its gain is one. ``latency_cycles``: age of the reading in periods.
    """
    omega = np.linspace(1e-3, np.pi, 4000)
    back = np.exp(-1j * omega)
    loop = back**latency_cycles
    for numerator, denominator in (_damper(1.0), *path):
        loop = loop * np.polyval(numerator[::-1], back) / np.polyval(denominator[::-1], back)
    turned = np.unwrap(np.angle(loop)) <= -np.pi
    if not turned.any():
        return math.inf
    at = int(np.argmax(turned))
    return float(1.0 / np.abs(loop[at]))
