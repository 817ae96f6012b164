"""The reference solution in space: Kirchhoff's rod between any two grips.

With r(s) the centre line, R(s) = [t, d₂, d₃] the section's axes (t the tangent, d₂ across the
sheet, d₃ its normal), n and m the force and moment that the part beyond s exerts on the part
before it, both in fixed axes:

    r' = (1 + n·t / EA) t,   R' = R [κ]ₓ,   κ = (m·t / GJ, m·d₂ / EI, m·d₃ / EI_z)
    n' = q z,                m' = −r' × n

Source: Love, Mathematical Theory of Elasticity, chapters XVIII and XIX. In the plane this is
:mod:`dualbend.beam.rod.planar`. The torsional stiffness of a real strip grows with the
square of the twist (Wagner), which a rod neglects: it is valid for small twist.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dualbend.beam._check import FloatArray, finite, positive
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError

STEPS = 100
"""Steps of the fourth-order rule over the length: loads to 1e-7."""

TOLERANCE = 1e-9
"""Largest miss of the far grip, in lengths and radians, of a converged state."""

_MAX_ITERATIONS = 30
_DIFFERENCE = 1e-6


class RodStiffness(NamedTuple):
    """Stiffness of a section: EA [N], GJ, EI and EI_z [N m²]; infinite where it is rigid."""

    axial_n: float
    twist_nm2: float
    bend_nm2: float
    lateral_nm2: float

    @classmethod
    def of(cls, sheet: Sheet, *, in_plane: bool = True) -> "RodStiffness":
        """Return those of a sheet; EI_z = E t w³/12. Without ``in_plane`` EA and EI_z are infinite.

        The strips of the simulation are the case without.
        """
        if not sheet.is_plain:
            raise InputError("the rod in space is of one thickness and straight at rest")
        lateral = sheet.young_pa * sheet.thickness_m * sheet.width_m**3 / 12.0
        return cls(
            sheet.axial_stiffness_n if in_plane else math.inf,
            sheet.torsional_stiffness_nm2,
            sheet.bending_stiffness_nm2,
            lateral if in_plane else math.inf,
        )


class SpaceGrip(NamedTuple):
    """An end of the rod: place (3,) [m], axes (3, 3) whose columns are t, d₂ and d₃."""

    position_m: FloatArray
    axes: FloatArray


@dataclass(frozen=True, kw_only=True)
class SpaceState:
    """An equilibrium; ``left`` and ``right`` (6,) are force [N] and moment [N m] on the grippers.

    Each about its own gripper's centre, in the fixed axes of the grips that were given.
    ``left`` is also n and m at the left end; ``miss`` is the far end's, in lengths and radians.
    """

    left: FloatArray
    right: FloatArray
    middle_m: FloatArray
    miss: float

    @property
    def converged(self) -> bool:
        """Whether the far end has reached its grip."""
        return self.miss <= TOLERANCE


def solve_space(
    stiffness: RodStiffness,
    length_m: float,
    left: SpaceGrip,
    right: SpaceGrip,
    guess: FloatArray,
    weight_per_length: float = 0.0,
) -> SpaceState:
    """Return the rod between two grips, by shooting from the left one.

    ``guess`` (6,) is n [N] and m [N m] at the left end, from a state nearby: in the plane
    (−P, 0, V) and (0, EI θ', 0). Where the grips do not determine a load, as for a straight rigid
    rod, the solution nearest to the guess is returned. Raises InputError where a length or
    stiffness is not above zero.
    """
    positive("length_m", length_m)
    finite("weight_per_length", weight_per_length)
    if not all(value > 0.0 for value in stiffness):
        raise InputError(f"every stiffness must be above zero, got {tuple(stiffness)}")
    force = stiffness.bend_nm2 / length_m**2
    units = np.array([force] * 3 + [force * length_m] * 3)
    problem = _Problem(np.reciprocal(stiffness), length_m, left, right, weight_per_length, units)
    x = np.asarray(guess, dtype=float) / units
    for _ in range(_MAX_ITERATIONS):
        residual, jacobian = problem.linearised(x)
        if np.abs(residual).max() <= 0.01 * TOLERANCE or not np.isfinite(jacobian).all():
            break
        step = np.linalg.lstsq(jacobian, -residual, rcond=1e-11)[0]
        x = x + step * min(1.0, 5.0 / float(np.abs(step).max(initial=1e-300)))
    r, axes, load, middle = problem.shoot(x[np.newaxis])
    missed = float(np.abs(problem.miss(r, axes)).max())
    return SpaceState(left=x * units, right=-load[0], middle_m=middle[0], miss=missed)


class _Problem(NamedTuple):
    """One rod to be shot; ``compliance`` are 1/EA, 1/GJ, 1/EI, 1/EI_z."""

    compliance: FloatArray
    length_m: float
    left: SpaceGrip
    right: SpaceGrip
    weight: float
    units: FloatArray

    def linearised(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the far end's miss (6,) and its derivative (6, 6) by central differences."""
        shifts = np.vstack([np.zeros(6), _DIFFERENCE * np.eye(6), -_DIFFERENCE * np.eye(6)])
        r, axes, _, _ = self.shoot(x + shifts)
        miss = self.miss(r, axes)
        return miss[0], (miss[1:7] - miss[7:]).T / (2.0 * _DIFFERENCE)

    def miss(self, r: FloatArray, axes: FloatArray) -> FloatArray:
        """Return the errors of the far ends against their grip (k, 6), in lengths and radians."""
        turn = axes.transpose(0, 2, 1) @ self.right.axes
        skew = 0.5 * (turn - turn.transpose(0, 2, 1))[:, [2, 0, 1], [1, 2, 0]]
        return np.hstack([(self.right.position_m - r) / self.length_m, skew])

    def shoot(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Integrate k rods at once; return ends (k, 3), axes (k, 3, 3), loads (k, 6), middles."""
        load = x * self.units
        n0, m = load[:, :3], load[:, 3:]
        r = np.tile(self.left.position_m, (len(x), 1))
        axes = np.tile(self.left.axes, (len(x), 1, 1))
        h, down = self.length_m / STEPS, np.array([0.0, 0.0, self.weight])
        middle = r
        for i in range(STEPS):
            s = i * h
            k1 = self._rates(axes, n0 + s * down, m)
            half = n0 + (s + 0.5 * h) * down
            k2 = self._rates(axes + 0.5 * h * k1[1], half, m + 0.5 * h * k1[2])
            k3 = self._rates(axes + 0.5 * h * k2[1], half, m + 0.5 * h * k2[2])
            k4 = self._rates(axes + h * k3[1], n0 + (s + h) * down, m + h * k3[2])
            r, axes, m = (
                value + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                for value, a, b, c, d in zip((r, axes, m), k1, k2, k3, k4, strict=True)
            )
            if 2 * (i + 1) == STEPS:
                middle = r
        return r, axes, np.hstack([n0 + self.length_m * down, m]), middle

    def _rates(
        self, axes: FloatArray, n: FloatArray, m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        tangent = axes[:, :, 0]
        stretch = 1.0 + self.compliance[0] * np.sum(n * tangent, axis=1, keepdims=True)
        k = self.compliance[1:] * np.einsum("kij,ki->kj", axes, m)
        rate = stretch * tangent
        # R [κ]ₓ row by row, κ in the section's axes.
        return rate, np.cross(axes, k[:, np.newaxis]), -np.cross(rate, n)
