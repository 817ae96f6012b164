"""The joint servo: stiff, damped, with feed-forward; the stiffness that a load feels.

How a command is tracked is said in :mod:`dualbend.control.response`; this servo follows
that response. They are two settings because a proportional servo soft enough to answer at 2 Hz
would yield by millimetres under a sheet, and the real arm does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np

from dualbend.control.worlds import stacked
from dualbend.types import Config, Vector, said

Positive = Annotated[float, msgspec.Meta(ge=1e-3, le=1e9)]

_COULOMB_SPEED_RAD_PER_S = 1e-4
"""Reference speed at which most of the Coulomb friction is fed forward: smooths its sign."""


class StiffnessConfig(Config):
    """Stiffness of the joint servos; each arm has one of its own by default."""

    stiffness_n_m_per_rad: (
        Annotated[
            tuple[Positive, ...],
            said(
                "one per joint, base to flange, what a load feels; none: the arm's own",
                min_length=6,
                max_length=20,
            ),
        ]
        | None
    ) = None


class IntegralConfig(Config):
    """Integral action of the joint servos, as VAL's INTON switches it on.

    An arm under a steady load goes back to where it was sent, with the time constant 1/k_i. The
    rate of 10 1/s and the limit are assumed.
    """

    rate_per_s: Annotated[float, said("k_i: set-point per error, over time", gt=0, le=50)] = 10.0
    torque_fraction: Annotated[
        float, said("of the joint's torque limit that the integral may ask for", gt=0, le=1)
    ] = 0.5


class FrictionEstimateConfig(Config):
    """Estimate of the joints' Coulomb friction, from what they need while they move freely.

    The arms go without a sheet before the first one of an assembly, or of dualbend learn. Friction
    changes with temperature, grease and wear. The rate is assumed.
    """

    rate_per_s: Annotated[float, said("at which an estimate comes to its value", gt=0, le=20)] = 2.0
    slowest_rad_per_s: Annotated[
        float, said("speed of a joint below which it tells nothing", gt=0, le=1)
    ] = 3e-3
    largest: Annotated[float, said("ratio to the believed friction", ge=1, le=10)] = 3.0


class JointServoConfig(StiffnessConfig):
    """Stiffness and damping of the joint servos; each arm has a stiffness of its own by default."""

    integral: IntegralConfig | None = None
    friction_estimate: FrictionEstimateConfig | None = None

    damping_ratio: Annotated[
        float, said("ζ of each joint by itself, 1 is critical [-]", gt=0, le=5)
    ] = 1.0


class JointServo:
    """Position servo of n joints with feed-forward of speed, acceleration and friction.

    The servo's torque is ``k (u − q) − c q̇``; it follows a reference (q_r, v_r, a_r) without error
    where the joint obeys ``J a + B v + T_c sign(v) = torque``, if it is sent
    ``u = q_r + (c + B) v_r / k + J a_r / k + r T_c tanh(v_r / v_0) / k`` with r = 1.

    Parameters
    ----------
    stiffness, inertia, viscous_friction, coulomb_friction
        (n,) [N m/rad], [kg m²], [N m s/rad], [N m]; inertia at the home pose, rotor included.
    damping_ratio
        Of each joint by itself: ``c = 2 ζ sqrt(k J) − B``, not below 0.
    """

    def __init__(
        self,
        *,
        stiffness: Vector,
        inertia: Vector,
        viscous_friction: Vector,
        coulomb_friction: Vector,
        damping_ratio: float,
    ) -> None:
        self.stiffness = stiffness
        self.damping = np.maximum(
            2.0 * damping_ratio * np.sqrt(stiffness * inertia) - viscous_friction, 0.0
        )
        self._speed_gain = (self.damping + viscous_friction) / stiffness
        self._acceleration_gain = inertia / stiffness
        self._friction = coulomb_friction / stiffness

    @classmethod
    def stacked(cls, many: Sequence[JointServo]) -> JointServo:
        """Return that of many worlds, for references (worlds, steps, n)."""
        joined = stacked(many, "_speed_gain", "_acceleration_gain", "_friction")
        for name in ("_speed_gain", "_acceleration_gain", "_friction"):
            setattr(joined, name, getattr(joined, name)[:, np.newaxis])
        return joined

    def setpoint(
        self,
        position: Vector,
        speed: Vector,
        acceleration: Vector,
        friction_ratio: Vector | float = 1.0,
    ) -> Vector:
        """Return u (..., n) [rad] for a reference position, speed and acceleration (..., n).

        ``friction_ratio``: r, estimated over believed Coulomb friction.
        """
        setpoint: Vector = self._speed_gain * speed
        setpoint += position
        setpoint += self._acceleration_gain * acceleration
        sign = speed / _COULOMB_SPEED_RAD_PER_S
        np.tanh(sign, out=sign)
        sign *= friction_ratio * self._friction
        setpoint += sign
        return setpoint


class FrictionEstimate:
    """Estimate of n joints' Coulomb friction over the believed T_c, from free motion.

    A joint that moves steadily and meets nothing but friction and a weight w that is believed
    wrongly needs the torque k (q_r − q + z) = (ρ − r) T_c sign(v_r) + w beyond what is fed forward.
    With ε = k (q_r − q + z) / T_c − b, r[n+1] = r[n] + γ T ε sign(v_r) and b[n+1] = b[n] + γ T ε
    come to ρ and w / T_c, where it moves forth and back. Source: Canudas de Wit, Åström, Braun,
    IEEE J. Robotics and Automation 3 (1987) 681.

    ``coulomb_friction`` (n,) believed T_c; a joint without it has nothing to estimate.

    Attributes
    ----------
    ratio : (..., n) r
    known : (n,) r before anything is estimated; 1, or what was given
    """

    def __init__(
        self,
        config: FrictionEstimateConfig | None,
        *,
        stiffness: Vector,
        coulomb_friction: Vector,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.config = config
        self.known: Vector = np.ones(len(stiffness))
        self.ratio: Vector = np.ones((*shape, len(stiffness)))
        self._weight: Vector = np.zeros((*shape, len(stiffness)))
        self._rate = 0.0 if config is None else config.rate_per_s * period_s
        has = coulomb_friction > 0.0
        self._share = np.where(has, stiffness, 0.0) / np.where(has, coulomb_friction, 1.0)

    @classmethod
    def stacked(cls, many: Sequence[FrictionEstimate]) -> FrictionEstimate:
        """Return that of many worlds, for errors and speeds (worlds, n)."""
        return stacked(many, "known", "ratio", "_weight", "_share")

    def reset(self) -> None:
        """Believe in what is known."""
        self.ratio[:], self._weight[:] = self.known, 0.0

    def update(self, error: Vector, speed: Vector) -> Vector:
        """Take q_r − q + z [rad] and the reference speed [rad/s], (..., n); return r (..., n).

        An error of more than the believed friction counts as that: it comes from something else.
        """
        if self.config is not None:
            moves = np.abs(speed) > self.config.slowest_rad_per_s
            more = np.clip(self._share * error - self._weight, -1.0, 1.0) * moves
            ratio = self.ratio + self._rate * more * np.sign(speed)
            self.ratio = np.clip(ratio, 0.0, self.config.largest)
            self._weight = self._weight + self._rate * more
        return self.ratio


class IntegralAction:
    """Integral of the position error of n joints, added to their set-points.

    z[n+1] = z[n] + k_i T (q_r[n] − q[n]), held over the command period T and kept within what the
    allowed fraction of the torque limit moves the servo by, |z| <= f τ_max / k: an integral that
    has nothing to gain does not wind up further.

    Attributes
    ----------
    most_n_m : torques (n,) that it may ask for
    """

    def __init__(
        self,
        config: IntegralConfig | None,
        *,
        stiffness: Vector,
        torque_limit: Vector,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.config = config
        fraction = 0.0 if config is None else config.torque_fraction
        self.gain = 0.0 if config is None else config.rate_per_s * period_s
        self.most_n_m = fraction * torque_limit
        self._limit = self.most_n_m / stiffness
        self._lowest = -self._limit
        self._offset = np.zeros((*shape, len(stiffness)))

    def reset(self) -> None:
        """Start from no offset."""
        self._offset[:] = 0.0

    def update(self, error: Vector) -> Vector:
        """Return the offset (..., n) [rad] of the next cycle from this one's error q_r − q."""
        if self.gain:
            self._offset += self.gain * error
            np.minimum(self._offset, self._limit, out=self._offset)
            np.maximum(self._offset, self._lowest, out=self._offset)
        return self._offset
