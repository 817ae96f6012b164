"""What a controller knows of its arms: by their encoders, and by where it believes their bases."""

from __future__ import annotations

import numpy as np

from dualbend.arm.mjcf import FT_SITE, GRIP_SITE
from dualbend.control.alter import angles_of
from dualbend.scene.observation import BENDING_TO_WORLD, Observation, Observer, Source, grip_poses
from dualbend.scene.posed import Posed
from dualbend.types import SIDES, Vector

GRIPS = [f"{side}_{GRIP_SITE}" for side in SIDES]
"""The sites of both grips."""

SITES = [*GRIPS, *(f"{side}_{FT_SITE}" for side in SIDES)]
"""The sites of both grips and of both wrist sensors."""

_GRIPS, _SENSORS = slice(0, 2), slice(2, 4)


class BelievedArms:
    """Forward kinematics and Coriolis torques of the arms that the controller believes in.

    ``posed``: these arms with :data:`SITES`, of any leading shape; all that is returned has it.
    """

    def __init__(self, posed: Posed) -> None:
        self._posed = posed

    def grips(self, q: Vector) -> Vector:
        """Return x, y, z [m] and α [rad] of both grips (..., 2, 4), each in its bending frame."""
        places, axes = self._posed.frames(q)
        return grip_poses(places[..., _GRIPS, :], axes[..., _GRIPS, :])

    def grip_axes(self, q: Vector) -> Vector:
        """Return the axes of both grips in the world (..., 2, 3, 3)."""
        return self._axes(q, _GRIPS)

    def sensor_axes(self, q: Vector) -> Vector:
        """Return the axes of both wrist sensors in the world (..., 2, 3, 3)."""
        return self._axes(q, _SENSORS)

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """Return the torques (..., n) [N m] of Coriolis and centrifugal forces."""
        return self._posed.coriolis(q, speed)

    def _axes(self, q: Vector, sites: slice) -> Vector:
        axes = self._posed.frames(q)[1][..., sites, :]
        return np.asarray(axes.reshape(*axes.shape[:-1], 3, 3))


class Measured:
    """Where the grips are as the joints' encoders tell it.

    ``data``: the physics, of any leading shape; ``believed``: None where the controller's arms are
    the true ones.
    """

    def __init__(self, observer: Observer, data: Source, believed: BelievedArms | None) -> None:
        self._observer, self._data, self._believed = observer, data, believed

    def grips(self, seen: Observation) -> Vector:
        """Return x, y, z [m] and α [rad] of both grips (..., 2, 4)."""
        return seen.grip if self._believed is None else self._believed.grips(seen.q)

    def aside(self, seen: Observation) -> Vector:
        """Return y [m], roll and yaw [rad] of both grips (..., 2, 3).

        Each in its bending frame; roll and yaw are those of :func:`dualbend.control.alter.turn`.
        """
        if self._believed is None:
            axes = self._observer.grip_axes(self._data)
        else:
            axes = self._believed.grip_axes(seen.q)
        roll_and_yaw = angles_of(axes * BENDING_TO_WORLD[:, :, np.newaxis])[..., ::2]
        return np.concatenate((self.grips(seen)[..., 1:2], roll_and_yaw), axis=-1)

    def sensor_axes(self, rotation: Vector, seen: Observation) -> Vector:
        """Return true axes (..., 2, 3, 3) of the wrist sensors, a sample's, as they are believed.

        What the controller errs by now is what it erred by when the sample was taken.
        """
        if self._believed is None:
            return rotation
        error = self._observer.sensor_axes(self._data).mT.copy()
        return np.asarray(rotation @ (error @ self._believed.sensor_axes(seen.q)))
