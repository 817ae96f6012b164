"""How a controller couples two arms: deviation directions, who follows whom, modes of motion.

The six coordinates are x, z [m], α [rad] of the left and then of the right grip, each in its own
bending frame; a stiffness K says that the wrench on the arms changes by −K times their change.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from scipy.linalg import block_diag

from dualbend.types import SIDES, Side, Vector

ModeName = Literal["single", "symmetric", "antisymmetric"]
"""One arm moves; both move inward by the same; one moves inward as the other moves outward."""

EXACT_READING = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Force x and moment of a wrench in x, z, α."""


Angle = TypeVar("Angle", float, Vector)


def deviation_angle(
    mode: Literal["world", "tool", "tool-frozen"], alpha_rad: Angle, start_rad: Angle
) -> Angle | float:
    """Return the turn φ [rad] about y of the axes along which a deviation δx is executed.

    φ = 0 in mode "world", the bending angle α in mode "tool", and α at the start of the path
    modification in mode "tool-frozen". Source: Robotics FAQ, section 12 (VAL II's ALTER).
    """
    if mode == "world":
        return 0.0
    return alpha_rad if mode == "tool" else start_rad


def deviation_jacobian(angle_rad: float) -> Vector:
    """Return the change (3, 2) of a grip's x, z, α per δx, δα that are executed in axes at φ."""
    return np.array([[math.cos(angle_rad), 0.0], [-math.sin(angle_rad), 0.0], [0.0, 1.0]])


def wrench_response(stiffness: Vector, of: int, moved: Collection[int]) -> Vector:
    """Return what an arm's wrench (3, 3) loses when some arms move by the same x, z, α.

    Both bending frames are mirror images, so that moves of both arms add up.
    """
    return sum((_block(stiffness, of, by) for by in moved), np.zeros((3, 3)))


def _block(stiffness: Vector, of: int, by: int) -> Vector:
    return stiffness.reshape(2, 3, 2, 3)[of, :, by]


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """How the controller couples the arms: what is read, what is commanded, who follows whom.

    ``reading`` (2, 3): force x and moment as the sensing arm reads them, of the wrench on it;
    ``deviation_jacobian`` (3, 2): the change of a grip's x, z, α per δx, δα; ``source``: by
    complying arm, the arm whose reading it follows.
    """

    reading: Vector
    deviation_jacobian: Vector
    source: dict[int, int]

    @classmethod
    def between(
        cls,
        sensing: Collection[Side],
        complying: Collection[Side],
        angle_rad: float,
        reading: Vector = EXACT_READING,
    ) -> Coupling:
        """Couple arms of which one without a sensor follows the first that has one."""
        sensors = [i for i, side in enumerate(SIDES) if side in sensing]
        moving = [i for i, side in enumerate(SIDES) if side in complying]
        return cls(
            reading=reading,
            deviation_jacobian=deviation_jacobian(angle_rad),
            source={i: i if i in sensors else sensors[0] for i in moving},
        )

    def modes(self, stiffness: Vector) -> dict[ModeName, tuple[Vector, Vector]]:
        """Return what a moving grip meets: by mode, its own (3, 3) and what is read (3, 3) of it.

        Where both arms follow their own sensors the sheet's symmetry splits the loop into two: the
        symmetric mode and the antisymmetric one.
        """
        sources = set(self.source.values())
        if not sources:
            return {}
        if len(sources) == 2:
            # The means over both arms are exact where the state is symmetric, and it nearly is.
            own = (_block(stiffness, 0, 0) + _block(stiffness, 1, 1)) / 2
            other = (_block(stiffness, 0, 1) + _block(stiffness, 1, 0)) / 2
            both, apart = own + other, own - other
            return {"symmetric": (both, both), "antisymmetric": (apart, apart)}
        (of,) = sources
        read = wrench_response(stiffness, of, self.source)
        if len(self.source) == 2:
            return {"symmetric": (read, read)}
        (by,) = self.source
        return {"single": (_block(stiffness, by, by), read)}

    def loops(self, stiffness: Vector) -> dict[ModeName, Vector]:
        """Return by mode the loop (2, 2) from δx, δα to the reading, closed through (6, 6)."""
        return {
            mode: self._to_reading(response)
            for mode, (_, response) in self.modes(stiffness).items()
        }

    @property
    def moves_its_sensor(self) -> bool:
        """A sensing arm moves: it reads the inertia of its own tool."""
        return any(of == by for by, of in self.source.items())

    def tool(self, inertia: Vector) -> Vector:
        """Return the tool's inertia (2, 2) in the reading; none where the sensing arm is led."""
        return self._to_reading(inertia * float(self.moves_its_sensor))

    def _to_reading(self, response: Vector) -> Vector:
        return np.asarray(self.reading @ response @ self.deviation_jacobian)

    def admittance_compliance(self, per_load: Vector) -> Vector:
        """Return how far the admittance yields at rest (6, 6), from δ per load read (2, 2)."""
        compliance = np.zeros((6, 6))
        for by, of in self.source.items():
            _block(compliance, by, of)[:] = self.deviation_jacobian @ per_load @ self.reading
        return compliance

    def arm_compliance(self, arm: Vector, grasp: Vector) -> Vector:
        """Return how far arms and grasps yield (6, 6) at the small amplitude of an oscillation.

        Dry friction holds an arm that nothing commands: only its grasp yields.
        """
        return np.asarray(
            block_diag(*(arm * float(i in self.source) + grasp for i in range(len(SIDES))))
        )
