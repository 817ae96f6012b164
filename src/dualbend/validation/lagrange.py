"""The mechanics of a serial arm from its energies, in plain NumPy: reference for MuJoCo's.

Kinetic energy ½ q̇ᵀ M q̇ and potential energy V give τ = M q̈ + Ṁ q̇ − ½ ∂(q̇ᵀ M q̇)/∂q + ∂V/∂q, all
without rotors. Nothing of MuJoCo is asked.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.errors import InputError
from dualbend.types import Vector

_COMPLEX_STEP_RAD = 1e-30
"""Imaginary, so that nothing is subtracted and a derivative is exact to rounding."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Link:
    """A joint and the rigid body that it moves.

    Attributes
    ----------
    pose : (4, 4) of the joint's frame in the frame of the link before [m]
    axis : (3,) unit vector in the joint's frame; zero for a joint that is fixed
    slides : the joint moves along the axis, not about it
    mass_kg, centre_m, inertia_kg_m2 : mass, centre (3,) and inertia (3, 3) about the centre, in the
        link's frame, which is the joint's turned about the axis by the joint's angle
    """

    pose: Vector
    axis: Vector
    mass_kg: float
    centre_m: Vector
    inertia_kg_m2: Vector
    slides: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class SerialArm:
    """Links from base to tip, n of which move, and the flange (4, 4) in the frame of the last."""

    links: tuple[Link, ...]
    flange: Vector

    def frames(self, q_rad: ArrayLike) -> Vector:
        """Return T_i = T_{i-1} P_i R(a_i, q_i) of base and links, (links + 1, 4, 4) [m].

        Raises InputError unless there is one angle per joint that turns.
        """
        turning = self._turning
        q = np.asarray(q_rad)
        if q.shape != (sum(turning),):
            raise InputError(f"q_rad needs shape ({sum(turning)},), got {q.shape}")
        angles = np.zeros(len(turning), q.dtype)
        angles[turning] = q
        frames = [np.eye(4)]
        for link, angle in zip(self.links, angles, strict=True):
            own = np.eye(4, dtype=angles.dtype)
            if link.slides:
                own[:3, 3] = link.axis * angle
            else:
                own[:3, :3] = _turn(link.axis, angle)
            frames.append(frames[-1] @ link.pose @ own)
        return np.array(frames)

    def flange_pose(self, q_rad: ArrayLike) -> Vector:
        """Return the flange in the base frame (4, 4) [m]."""
        return np.asarray(self.frames(q_rad)[-1] @ self.flange)

    def mass_matrix(self, q_rad: ArrayLike) -> Vector:
        """Return the joint-space inertia, M = Σ m Jᵥᵀ Jᵥ + Jωᵀ I Jω, (n, n) [kg m²]."""
        terms = [
            link.mass_kg * linear.T @ linear + angular.T @ R @ link.inertia_kg_m2 @ R.T @ angular
            for link, linear, angular, R in self._jacobians(q_rad)
        ]
        return np.asarray(np.sum(terms, axis=0))

    def gravity_torque(self, q_rad: ArrayLike) -> Vector:
        """Return the torques that hold the arm still, ∂V/∂q = Σ m g ∂z/∂q, (n,) [N m]."""
        masses = [link.mass_kg * linear[2] for link, linear, _, _ in self._jacobians(q_rad)]
        return np.asarray(GRAVITY_M_PER_S2 * np.sum(masses, axis=0))

    def velocity_torque(self, q_rad: Vector, velocity_rad_per_s: Vector) -> Vector:
        """Return centrifugal and Coriolis torques, Ṁ q̇ − ½ ∂(q̇ᵀ M q̇)/∂q, (n,) [N m]."""
        steps = q_rad + 1j * _COMPLEX_STEP_RAD * np.eye(len(q_rad))
        slopes = np.array([self.mass_matrix(q).imag for q in steps]) / _COMPLEX_STEP_RAD
        rate = np.tensordot(velocity_rad_per_s, slopes, axes=1)
        squares = slopes @ velocity_rad_per_s @ velocity_rad_per_s
        return np.asarray(rate @ velocity_rad_per_s - 0.5 * squares)

    @property
    def _turning(self) -> list[bool]:
        return [bool(link.axis.any()) for link in self.links]

    def _jacobians(self, q_rad: ArrayLike) -> Iterator[tuple[Link, Vector, Vector, Vector]]:
        """Yield each link, the Jacobians (3, n) of its centre and of its turn, its rotation."""
        frames, turning = self.frames(q_rad)[1:], self._turning
        places = frames[:, :3, 3]
        axes = np.array([T[:3, :3] @ link.axis for T, link in zip(frames, self.links, strict=True)])
        slides = np.array([link.slides for link in self.links])[:, None]
        for i, link in enumerate(self.links):
            R = frames[i, :3, :3]
            # Joints beyond do not move it.
            moving = axes * (np.arange(len(axes)) <= i)[:, None]
            turned = np.cross(moving, places[i] + R @ link.centre_m - places)
            linear, angular = np.where(slides, moving, turned), np.where(slides, 0.0, moving)
            yield link, linear[turning].T, angular[turning].T, R


def _turn(axis: Vector, angle: float) -> Vector:
    """Return the rotation (3, 3) about an axis: a aᵀ + cos (1 − a aᵀ) + sin [a]×."""
    x, y, z = axis
    along = np.outer(axis, axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(along + np.cos(angle) * (np.eye(3) - along) + np.sin(angle) * across)


def joined(link: Link, mass_kg: float, centre_m: Vector, inertia_kg_m2: Vector) -> Link:
    """Return a link with another body, given in the link's frame, as one; Steiner."""
    total = link.mass_kg + mass_kg
    if not total:
        return link
    centre = (link.mass_kg * link.centre_m + mass_kg * centre_m) / total
    inertia = link.inertia_kg_m2 + inertia_kg_m2
    for mass, at in ((link.mass_kg, link.centre_m), (mass_kg, centre_m)):
        away = at - centre
        inertia = inertia + mass * (away @ away * np.eye(3) - np.outer(away, away))
    return replace(link, mass_kg=total, centre_m=centre, inertia_kg_m2=inertia)
