"""The path modification of VAL II's ALTER: how a deviation of the nominal path is executed."""

from typing import Annotated, Literal

import numpy as np

from dualbend.mechanics.coupling import deviation_angle
from dualbend.types import Config, PlanarPose, Reals, Vector, said

AlterMode = Literal["world", "tool", "tool-frozen"]


class AlterConfig(Config):
    """How the path modification is executed and how long it takes to get to the servos."""

    mode: Annotated[
        AlterMode,
        said("axes of the deviation: world, the tool's, or the tool's as they first were"),
    ] = "world"
    delay_cycles: Annotated[int, said("transport delay [command periods]", ge=0, le=100)] = 1


class PathModification:
    """Add a deviation to a nominal grip pose (x, z, α) in the bending frame B.

    The deviation is executed in a frame turned by φ about y_B: p' = p + R_y(φ) δp, so that
    x' = x + δx cos φ + δz sin φ, z' = z − δx sin φ + δz cos φ, and y' = δy; and the grip's axes are
    R' = R_y(φ) R(δ) R_y(α − φ), where R(δ) is :func:`turn` of the deviation's angles: in the plane
    α' = α + δα. φ = 0 in mode "world", φ = α in mode "tool" and φ = α at the start of ALTER in mode
    "tool-frozen". The last is what VAL II does: it does not update the tool's rotation matrix while
    moving (Robotics FAQ, section 12). The deviation is not cumulative: it is the whole deviation of
    this cycle. ALTER starts with the first call of `compose`.
    """

    def __init__(self, mode: AlterMode) -> None:
        self.mode: AlterMode = mode
        self._start_alpha_rad: Vector | None = None

    def compose(self, nominal: PlanarPose, deviation: Vector) -> tuple[PlanarPose, Vector]:
        """Return the commanded pose (..., 3) of a nominal one and a deviation (..., 6).

        Beside it what leads out of the bending plane (..., 3): y [m], roll and yaw [rad]. The
        grip's axes are :func:`turn` of roll, the commanded α and yaw.
        """
        planar, aside = deviation[..., ::2], deviation[..., 1::2]
        if self._start_alpha_rad is None:
            self._start_alpha_rad = nominal.alpha_rad
        if self.mode == "world":
            return PlanarPose(nominal.coordinates + planar), aside
        phi = deviation_angle(self.mode, nominal.alpha_rad, self._start_alpha_rad)
        c, s = np.cos(phi), np.sin(phi)
        turned = planar.copy()
        turned[..., 0] = planar[..., 0] * c + planar[..., 1] * s
        turned[..., 1] = planar[..., 1] * c - planar[..., 0] * s
        angles = conjugated(deviation[..., 3:], phi)
        turned[..., 2] = angles[..., 1]
        aside = np.concatenate((aside[..., :1], angles[..., ::2]), axis=-1)
        return PlanarPose(nominal.coordinates + turned), aside


def turn(angles: Vector) -> Vector:
    """Return R = R_z(yaw) R_x(roll) R_y(pitch) (..., 3, 3) of roll, pitch, yaw (..., 3) [rad].

    The pitch comes first, about an axis that stays, so that it adds to the slope of the path.
    """
    pitched = _about(1, angles[..., 1])
    if not np.count_nonzero(angles[..., ::2]):
        return pitched
    return np.asarray(_about(2, angles[..., 2]) @ _about(0, angles[..., 0]) @ pitched)


def angles_of(rotation: Vector) -> Vector:
    """Return roll, pitch, yaw (..., 3) [rad] of R (..., 3, 3): :func:`turn` the other way round."""
    r = rotation
    angles = np.empty(r.shape[:-1])
    np.arcsin(np.minimum(np.maximum(r[..., 2, 1], -1.0), 1.0), out=angles[..., 0])
    np.arctan2(-r[..., 2, 0], r[..., 2, 2], out=angles[..., 1])
    np.arctan2(-r[..., 0, 1], r[..., 1, 1], out=angles[..., 2])
    return angles


def conjugated(angles: Vector, slope_rad: Reals) -> Vector:
    """Return the angles (..., 3) of R_y(φ) R(angles) R_y(−φ) at slopes φ (...) [rad].

    To the bit the same where there is neither roll nor yaw: then nothing depends on the slope.
    """
    if not np.count_nonzero(angles[..., ::2]):
        return angles
    slope = np.asarray(slope_rad)
    found = angles_of(_about(1, slope) @ turn(angles) @ _about(1, -slope))
    return np.where(np.any(angles[..., ::2], axis=-1, keepdims=True), found, angles)


def _about(axis: int, angle: Reals) -> Vector:
    """Return the rotations (..., 3, 3) about a coordinate axis."""
    i, j, sine = (axis + 1) % 3, (axis + 2) % 3, np.sin(angle)
    rotation = np.zeros((*sine.shape, 3, 3))
    rotation[..., axis, axis] = 1.0
    rotation[..., i, i] = rotation[..., j, j] = np.cos(angle)
    rotation[..., j, i], rotation[..., i, j] = sine, -sine
    return rotation
