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

import numpy as np

from dualbend.control.clock import TransferFunction
from dualbend.types import Config, Mask, Reals, Vector, Wrench, said

_SURE_N, _SURE_NM = 0.2, 0.05
"""Force and moment beyond the dead band that noise does not make."""

_FLANK_N, _FLANK_NM = 2.0, 0.1
"""What a lightly pressed sheet feels of a tip's flank at most; more comes from a pin's side."""

_MARGIN_SEEKING = 1.25
"""What is left of the gain margin while the sheet lies on the tips of pins."""


class ObjectComplianceConfig(Config):
    """How the held sheet complies with what it touches: a damper, ``B v = F``.

    A damper follows a force until none is left. What the loop works against is the stiffness of the
    sheet that is held by pins, which grows without bound towards the flat state but for the arms in
    series. B is not set: it follows from that stiffness, the loop's delays and the margin.
    """

    gain_margin: Annotated[
        float, said("of the loop at every bending angle, a factor: 4 is 12 dB", gt=1, le=100)
    ] = 4.0
    deadband_n: Annotated[float, said("force below which nothing moves", ge=0, le=1e3)] = 0.1
    deadband_nm: Annotated[float, said("the same, moment about z", ge=0, le=1e3)] = 0.02
    seek_m_per_s: Annotated[float, said("least speed towards a pin, on its tip", ge=0, le=0.01)] = (
        0.5e-3
    )
    seek_rad_per_s: Annotated[float, said("the same, yaw", ge=0, le=0.1)] = 5e-3
    limit_m: Annotated[float, said("largest |δx|, |δy|", gt=0, le=1)] = 5e-3
    limit_rad: Annotated[float, said("largest turn", gt=0, le=3.15)] = 0.03


class ObjectAdmittance:
    """Turn the net force on the object into its deviation, δ[n] = δ[n−1] + (T/B) F[n].

    H(z) = (T/B) / (1 − z⁻¹) for each of x, y and yaw, clamped. Beyond the dead band the force less
    the band acts: noise does not make the object wander.

    Parameters
    ----------
    bends, mobility
        1/B (n, 3) of x, y [m/(N s)] and yaw [rad/(N m s)] at n growing bending angles, (n,), each
        over that at which the sheet is laid.

    Attributes
    ----------
    deviation
        δx, δy [m] and the turn [rad] (..., 3).
    """

    def __init__(
        self,
        config: ObjectComplianceConfig,
        bends: Vector,
        mobility: Vector,
        *,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.config, self._period_s = config, period_s
        self._bends, self._mobility = bends, mobility
        self._seeking = max(1.0, config.gain_margin / _MARGIN_SEEKING)
        self._band = np.array([config.deadband_n, config.deadband_n, config.deadband_nm])
        self._limit = np.array([config.limit_m, config.limit_m, config.limit_rad])
        self.deviation = np.zeros((*shape, 3))

    def relax(self, speed_m_per_s: float) -> None:
        """Go back towards no deviation, x and y with this speed [m/s], yaw in as long as that."""
        step = self._period_s * speed_m_per_s * self._limit / self._limit[0]
        self.deviation = self.deviation - np.clip(self.deviation, -step, step)

    def mobility(self, bend: Reals) -> Vector:
        """Return 1/B (..., 3) at bending angles (...) over that at which the sheet is laid."""
        columns = [np.interp(bend, self._bends, column) for column in self._mobility.T]
        return np.stack(columns, axis=-1, dtype=np.float64)

    def update(self, wrench: Vector, bend: Reals, seeking: Reals | Mask = False) -> Vector:
        """Take net force x, y [N] and moment z [N m] (..., 3); return the deviation (..., 3).

        ``seeking`` (...): 0, or the share of the least speed in turning that the sheet seeks with.

        Seeking, on the tips of pins, it goes where the force points with a speed of its own: near
        the top of a tip the force is small however far the pin is. What the loop's margin leaves is
        for the moment at which the object falls into place. It leaves nothing where a pin's side is
        felt, too: what is beyond the force of a flank moves the object as if it did not seek.
        """
        beyond = np.sign(wrench) * np.maximum(np.abs(wrench) - self._band, 0.0)
        speed = self.mobility(bend) * beyond
        if np.any(seeking):
            sought, share_of_turn = speed.copy(), np.asarray(seeking)[..., np.newaxis]
            for part, least, sure, flank in (
                (slice(0, 2), self.config.seek_m_per_s, _SURE_N, _FLANK_N),
                (slice(2, 3), share_of_turn * self.config.seek_rad_per_s, _SURE_NM, _FLANK_NM),
            ):
                force = beyond[..., part]
                share = flank / np.maximum(_size(force), flank)
                sought[..., part] *= 1.0 + (self._seeking - 1.0) * share
                sought[..., part] *= _raised(sought[..., part], force, least, sure)
            speed = np.where(share_of_turn, sought, speed)
        moved = self.deviation + self._period_s * speed
        self.deviation = np.clip(moved, -self._limit, self._limit)
        return self.deviation.copy()


def _size(vector: Vector) -> Vector:
    """Return the length (..., 1) of vectors (..., 1) or (..., 2)."""
    return np.hypot(vector[..., :1], vector[..., 1:]) if vector.shape[-1] > 1 else np.abs(vector)


def _raised(speed: Vector, force: Vector, least: Reals, sure: float) -> Vector:
    """Return by what a speed is multiplied that must not be below ``least`` for a sure force."""
    size = _size(speed)
    wanted = least * np.minimum(1.0, _size(force) / sure)
    return np.maximum(1.0, wanted / np.where(size == 0.0, np.inf, size))


def net_wrench(bending: Wrench, half_distance_m: Reals, yaw_rad: Reals) -> Vector:
    """Return net force x, y, z [N] in the world and moment about the vertical [N m], (..., 4).

    Of the wrenches (..., 2, 6) on both arms at the grips, each in its arm's bending frame; an arm
    without a sensor, of which all is NaN, adds nothing. The moment is about the vertical through
    the object's place, which lies midway between the grips.
    """
    both = np.where(np.isnan(bending.components), 0.0, bending.components)
    # The right arm's bending frame is the left one's turned by π.
    x, y = (both[..., 0, i] - both[..., 1, i] for i in (0, 1))
    turn = both[..., 5] - np.asarray(half_distance_m)[..., np.newaxis] * both[..., 1]
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    up = both[..., 0, 2] + both[..., 1, 2]
    return np.stack((c * x - s * y, s * x + c * y, up, turn[..., 0] + turn[..., 1]), axis=-1)


def critical_rate(
    path: Sequence[TransferFunction], latency_cycles: float, period_s: float
) -> float:
    """Return the largest stiffness over damping k/B [1/s] with which a damper's loop is stable.

    The loop is ``(k/B) T / (1 − z⁻¹)`` times what the path's elements make of it; at the frequency
    where its phase is −π its gain is one. ``latency_cycles``: sensor latency in command periods T
    of ``period_s`` [s].
    """
    omega = np.linspace(1e-3, np.pi, 4000)
    back = np.exp(-1j * omega)
    loop = back**latency_cycles
    damper = np.array([period_s]), np.array([1.0, -1.0])
    for numerator, denominator in (damper, *path):
        loop = loop * np.polyval(numerator[::-1], back) / np.polyval(denominator[::-1], back)
    turned = np.unwrap(np.angle(loop)) <= -np.pi
    if not turned.any():
        return math.inf
    at = int(np.argmax(turned))
    return float(1.0 / np.abs(loop[at]))
