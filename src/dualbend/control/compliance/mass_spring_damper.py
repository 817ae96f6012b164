"""Admittance in full: a mass, a damper and a spring in any of the six directions of a grip.

M δ̈ + B δ̇ + K δ = F, each direction by itself, in axes that rest or turn with the grip. Sampled
exactly, with the load held over a period T: with the state s = (δ, δ̇) and ṡ = A s + b F,

    s[n] = e^(A T) s[n−1] + ∫₀ᵀ e^(A t) dt b F[n]

The load of a cycle is taken to act through the period that ends with its set-point, as in the
paper's filter, of which the form "static" is M = 0: δ[n] = a δ[n−1] + ((1 − a)/K) F[n].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from scipy.linalg import expm

from dualbend.control.alter import conjugated
from dualbend.control.clock import TransferFunction
from dualbend.control.compliance.base import ComplianceBase, DirectionConfig
from dualbend.control.controller import Observation
from dualbend.control.wrist import arm_slice
from dualbend.types import Mask, Vector, said

Frame = Literal["world", "grip", "tool"]

DIRECTIONS = ("x", "y", "z", "roll", "pitch", "yaw")


class MassSpringDamperConfig(ComplianceBase, tag="mass-spring-damper"):
    """A mass, a damper and a spring in each direction that is given: M δ̈ + B δ̇ + K δ = F, in SI.

    `frame`: the axes along and about which load and deviation are told, with "world" those of the
    arm's bending frame, with "grip" those of the grip on its path, turned by the nominal slope,
    with "tool" those of the gripper, turned by the slope that the encoders tell. A complying arm
    without a sensor mirrors the deviation of the arm that has one.
    """

    frame: Annotated[Frame, said("axes of the directions")] = "world"
    x: DirectionConfig | None = None
    y: DirectionConfig | None = None
    z: DirectionConfig | None = None
    roll: DirectionConfig | None = None
    pitch: DirectionConfig | None = None
    yaw: DirectionConfig | None = None

    @property
    def units(self) -> str:
        """In which b and k are given."""
        return "si"

    @property
    def in_space(self) -> bool:
        """It deviates in other directions than x and pitch, or its axes turn."""
        others = (self.y, self.z, self.roll, self.yaw)
        return self.frame != "world" or any(other is not None for other in others)

    @property
    def beyond(self) -> str:
        """It has m besides b and k, in each direction."""
        return "compliance.kind = 'mass-spring-damper' has m, b and k in up to six directions"

    @property
    def not_predicted(self) -> str:
        """What of it no linear analysis of x and pitch covers, in words; "" where it covers all."""
        given = [name for name in DIRECTIONS if getattr(self, name) is not None]
        covered = ("x", "pitch") if self.frame == "world" else ("pitch",)
        left = [name for name in given if name not in covered]
        zones = [name for name in given if getattr(self, name).dead_zone]
        parts = [f"{', '.join(left)} in the frame {self.frame!r}"] if left else []
        parts += [f"the dead zone of {', '.join(zones)}"] if zones else []
        return "; ".join([*parts, "limits"]) if given else ""


class MassSpringDamper:
    """One direction in state space: s[n] = A s[n−1] + b F[n] of deviation and speed, in SI."""

    def __init__(self, config: DirectionConfig, *, period_s: float, largest: float) -> None:
        self.config, self.limit = config, largest if config.limit is None else config.limit
        self.transition, self.input = np.zeros((2, 2)), np.zeros(2)
        m, b, k, period = config.m, config.b, config.k, period_s
        if m:
            rates = np.array([[0.0, 1.0, 0.0], [-k / m, -b / m, 1.0 / m], [0.0, 0.0, 0.0]])
            exact = expm(rates * period)
            self.transition, self.input = exact[:2, :2], exact[:2, 2]
        else:
            self.transition[0, 0] = math.exp(-k * period / b)
            self.input[0] = -math.expm1(-k * period / b) / k if k else period / b

    def transfer_function(self) -> TransferFunction:
        """Tell H(z) = δ/F, without dead zone and limit, in powers of z⁻¹ [m/N] or [rad/(N m)]."""
        (a, c), (d, e) = self.transition.tolist()
        first, second = self.input.tolist()
        if not self.config.m:
            return np.array([first]), np.array([1.0, -a])
        # The first row of (I − A z⁻¹)⁻¹ b.
        return (
            np.array([first, c * second - e * first]),
            np.array([1.0, -(a + e), a * e - c * d]),
        )


class SpatialAdmittance:
    """The mass-spring-dampers of both arms as one controller.

    Parameters
    ----------
    sensing, complying
        Indices of the arms with a sensor, and of those that deviate.
    shape
        Leading shape of the worlds.

    Attributes
    ----------
    filters : of each of `DIRECTIONS`; None: the direction is off
    saturated : (..., sensing arms, 6): the deviation is at its limit
    """

    def __init__(
        self,
        config: MassSpringDamperConfig,
        *,
        period_s: float,
        sensing: Sequence[int],
        complying: Sequence[int],
        shape: tuple[int, ...] = (),
    ) -> None:
        self.config = config
        self._sensing, self._complying = arm_slice(sensing), arm_slice(complying)
        self._source = self._complying if len(sensing) > 1 else slice(None)
        given = {name: getattr(config, name) for name in DIRECTIONS}
        self.filters = tuple(
            None
            if part is None
            else MassSpringDamper(part, period_s=period_s, largest=0.02 if i < 3 else 0.1)
            for i, part in enumerate(given.values())
        )
        off = DirectionConfig(b=1.0), np.zeros((2, 2)), np.zeros(2), math.inf
        parts = [
            off if f is None else (f.config, f.transition, f.input, f.limit) for f in self.filters
        ]
        configs, transitions, inputs, limits = zip(*parts, strict=True)
        self._transition, self._input = np.array(transitions), np.array(inputs)
        self._limit = np.array(limits)
        self._zone = np.array([c.dead_zone for c in configs])
        self._from_alpha = np.array([c.from_alpha_rad for c in configs])
        self._state = np.zeros((*shape, len(sensing), 6, 2))
        self.saturated: Mask = np.zeros((*shape, len(sensing), 6), dtype=np.bool_)

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation (..., 2, 6)."""
        arms = self._sensing
        wrench = observation.filtered.components[..., arms, :]
        nominal = observation.nominal.alpha_rad[..., arms]
        slope = {
            "world": np.zeros_like(nominal),
            "grip": nominal,
            "tool": observation.measured.alpha_rad[..., arms],
        }[self.config.frame]
        given = in_bending_frame(self.update(in_frame(wrench, slope), nominal), slope)
        deviation = np.zeros(observation.filtered.components.shape)
        deviation[..., self._complying, :] = given[..., self._source, :]
        return deviation

    def update(self, load: Vector, alpha_rad: Vector) -> Vector:
        """Take the loads of a cycle (..., arms, 6) in the frame; return the deviations there."""
        beyond = np.sign(load) * np.maximum(np.abs(load) - self._zone, 0.0)
        beyond = beyond * (np.asarray(alpha_rad)[..., np.newaxis] >= self._from_alpha)
        before = self._transition @ self._state[..., np.newaxis]
        state = before[..., 0] + self._input * beyond[..., np.newaxis]
        deviation: Vector = np.clip(state[..., 0], -self._limit, self._limit)
        self.saturated = np.abs(state[..., 0]) > self._limit
        state[..., 0] = deviation
        state[..., 1][self.saturated] = 0.0
        self._state = state
        return deviation

    def transfer_functions(self, alpha_rad: float) -> tuple[TransferFunction | None, ...]:
        """Return H(z) from force x to δx and from moment to δα at a bending angle, where it has.

        Where the axes turn with the grip, x is none of the bending frame's.
        """
        x, pitch = (
            None
            if part is None or part.config.from_alpha_rad > alpha_rad
            else part.transfer_function()
            for part in (self.filters[0], self.filters[4])
        )
        return (x if self.config.frame == "world" else None), pitch


def in_frame(wrench: Vector, slope_rad: Vector) -> Vector:
    """Tell wrenches (..., 6) of the bending frame along axes turned by slopes (...) about y."""
    return _about_y(wrench, -np.asarray(slope_rad))


def in_bending_frame(deviation: Vector, slope_rad: Vector) -> Vector:
    """Tell deviations (..., 6) along axes turned by slopes (...) in the bending frame.

    Exactly: R_y(φ) R(δ) R_y(−φ) is the rotation that roll, pitch and yaw then say.
    """
    turned = _about_y(deviation, slope_rad)
    turned[..., 3:] = conjugated(deviation[..., 3:], slope_rad)
    return turned


def _about_y(vectors: Vector, angle_rad: Vector) -> Vector:
    """Turn both vectors in (..., 6) about y, by angles (...)."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turned = vectors.copy()
    for x, z in ((0, 2), (3, 5)):
        turned[..., x] = vectors[..., x] * c + vectors[..., z] * s
        turned[..., z] = vectors[..., z] * c - vectors[..., x] * s
    return turned
