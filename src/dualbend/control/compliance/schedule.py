"""What the controller knows of sheet, arms and tool along the path, and gains in proportion to it.

The stiffness that an arm meets along x falls as 16 π² EI/(α² L³): by more than two orders of
magnitude between the flat sheet, where arms and grasps in series bound it, and one radian. Gains
that are multiples of it keep the loop's bandwidth and its margins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from dualbend.errors import InputError
from dualbend.types import Config, Reals, Vector, said


class ScheduleConfig(Config):
    """Gains as multiples of the known stiffness: b is a time [s] and k a ratio [1].

    B(α) = b K(α) and K_c(α) = k K(α), with K the diagonal of the known stiffness. With ``curve``
    the force is taken as K₁₁ e(F), e the displacement along x at which the known sheet has this
    force: compressed it is softer, taut it is stiffer than its tangent says.
    """

    from_rad: Annotated[
        float, said("below it the stiffness of this slope [rad]", ge=0.005, le=1)
    ] = 0.01
    curve: Annotated[bool, said("force to displacement by the sheet's curve, not its tangent")] = (
        False
    )


class FusionConfig(Config):
    """Let x comply with what force and moment tell together, by least squares.

    A wrong x changes both by the known K₁₁ and K₂₁. Weighted with the errors σ of the readings,
    e_x = Σ (K_i1/σ_i²) w_i / Σ K_i1²/σ_i². On the nearly flat sheet the force decides, on the bent
    one, which is soft, the moment.
    """

    force_error_n: Annotated[float, said("σ of the force [N]", gt=0, le=1e4)] = 0.05
    moment_error_nm: Annotated[float, said("σ of the moment [N m]", gt=0, le=1e4)] = 0.004


@dataclass(frozen=True, kw_only=True)
class KnownSheet:
    """Tables over the bending angle, of the sheet in its zero-moment states with its weight.

    Every look-up takes angles of any leading shape (...).

    Attributes
    ----------
    alpha_rad : (n,) growing
    force_x_n : (n,) horizontal force on the arm
    stiffness : (n, 3, 2) force x, z and moment that the sensing arm loses per δx and δα of the
        complying arms, with arms and grasps in series
    inertia : (n, 3, 3) of the tool beyond the sensor, at the grip, in x, z, α
    deviation_jacobian : (n, 3, 2) change of a grip's x, z, α per δx and δα
    compression_m, compression_n : (n, m) displacements of the complying arms, inward and falling,
        and the force x on the arm there, growing
    force_z_n : vertical force on the arm: half the sheet's weight, negative
    lever_arm_m : from the sensor to the grip, as the controller believes it

    Raises
    ------
    InputError
        Angles that do not grow, or tables of another length.
    """

    alpha_rad: Vector
    force_x_n: Vector
    stiffness: Vector
    inertia: Vector
    deviation_jacobian: Vector
    compression_m: Vector
    compression_n: Vector
    force_z_n: float
    lever_arm_m: float

    def __post_init__(self) -> None:
        """Refuse what is no table."""
        n = len(self.alpha_rad)
        if n < 2 or not np.all(np.diff(self.alpha_rad) > 0.0):
            raise InputError(f"alpha_rad must be two or more growing angles, got {self.alpha_rad}")
        shapes = tuple(part.shape for part in self._parts)
        if shapes != ((n,), (n, 3, 2), (n, 3, 3), (n, 3, 2)):
            raise InputError(f"tables of {n} angles have the shapes {shapes}")
        if self.compression_m.shape != self.compression_n.shape or not np.all(
            np.diff(self.compression_n, axis=1) > 0.0
        ):
            raise InputError(
                "compression_n must grow along its rows, one number for each of compression_m"
            )

    @property
    def _parts(self) -> tuple[Vector, ...]:
        return self.force_x_n, self.stiffness, self.inertia, self.deviation_jacobian

    @cached_property
    def _table(self) -> tuple[Vector, Vector]:
        """All that is interpolated over the angle (n, 22), and its differences."""
        n = len(self.alpha_rad)
        table = np.hstack([part.reshape(n, -1) for part in self._parts])
        return table, np.diff(table, axis=0)

    @cached_property
    def _gaps(self) -> tuple[Vector, Vector]:
        """The angles between the first and the last, and the differences of all."""
        return self.alpha_rad[1:-1], np.diff(self.alpha_rad)

    def _place(self, alpha_rad: Reals) -> tuple[NDArray[np.intp], Vector]:
        """Return the row before an angle (...) and how far on it is, 0 to 1."""
        inner, gaps = self._gaps
        row = np.asarray(inner.searchsorted(alpha_rad))
        part = (alpha_rad - self.alpha_rad.take(row)) / gaps.take(row)
        return row, np.minimum(np.maximum(part, 0.0), 1.0)

    def _row(self, alpha_rad: Reals) -> Vector:
        """Interpolate the table linearly (..., 22); outside it its nearest end."""
        row, part = self._place(alpha_rad)
        table, differences = self._table
        return np.asarray(
            table.take(row, axis=0) + part[..., np.newaxis] * differences.take(row, axis=0)
        )

    def force(self, alpha_rad: Reals) -> Vector:
        """Return the horizontal force on the arm (...) [N]."""
        return np.asarray(self._row(alpha_rad)[..., 0])

    def tangent(self, alpha_rad: Reals) -> Vector:
        """Return the stiffness (..., 3, 2)."""
        row = self._row(alpha_rad)
        return row[..., 1:7].reshape(*row.shape[:-1], 3, 2)

    def tool(self, alpha_rad: Reals) -> tuple[Vector, Vector]:
        """Return the tool's inertia (..., 3, 3) and what a deviation moves (..., 3, 2)."""
        row = self._row(alpha_rad)
        leading = row.shape[:-1]
        return row[..., 7:16].reshape(*leading, 3, 3), row[..., 16:].reshape(*leading, 3, 2)

    def displacement(self, force_x_n: Reals, alpha_rad: Reals) -> Vector:
        """Return how far inward of the zero-moment state the arms have this force (...) [m].

        Beyond a curve of the tables by its angle's tangent.
        """
        row, part = self._place(alpha_rad)
        both = row[..., np.newaxis] + _NEIGHBOURS
        force = np.asarray(force_x_n)[..., np.newaxis]
        on_it, beyond = _interpolate(self.compression_n, self.compression_m, both, force)
        found = on_it - beyond / self.stiffness[:, 0, 0].take(both)
        first, last = found[..., 0], found[..., 1]
        return np.asarray(first + part * (last - first))

    def compression_force(self, inward_m: Reals, alpha_rad: Reals) -> Vector:
        """Return the force x on the arm (...) [N] at displacements, on the nearest curve."""
        away = np.abs(np.asarray(alpha_rad)[..., np.newaxis] - self.alpha_rad)
        row = np.argmin(away, axis=-1)
        outward = -np.asarray(inward_m)
        on_it, beyond = _interpolate(-self.compression_m, self.compression_n, row, outward)
        return np.asarray(on_it + beyond * self.stiffness[:, 0, 0].take(row))


_NEIGHBOURS = np.array([0, 1])


def _interpolate(
    growing: Vector, values: Vector, row: NDArray[np.intp], at: Vector
) -> tuple[Vector, Vector]:
    """Interpolate linearly on curves (n, m), at each place (...) on that of its row (...).

    Return the value, at the ends that of the end, and how far beyond the end the place is.
    """
    curves = growing.take(row, axis=0)
    inside = np.minimum(np.maximum(at, curves[..., 0]), curves[..., -1])
    reached = np.add.reduce(curves[..., 1:-1] <= inside[..., np.newaxis], axis=-1, dtype=np.intp)
    start = row * growing.shape[1] + reached
    end = start + 1
    x0, y0 = growing.take(start), values.take(start)
    slope = (values.take(end) - y0) / (growing.take(end) - x0)
    return slope * (inside - x0) + y0, at - inside
