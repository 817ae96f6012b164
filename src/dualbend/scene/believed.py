"""The arms as their controller believes them to be, at measured joint angles."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from dualbend.arm.mjcf import FT_SITE, GRIP_SITE
from dualbend.scene.simulation import grip_poses
from dualbend.types import SIDES, Vector


class BelievedArms:
    """Forward kinematics and Coriolis torques of the arms that the controller believes in.

    Parameters
    ----------
    robots
        Of the robots alone, :func:`dualbend.scene.cell.robots_only`.
    """

    def __init__(self, robots: mujoco.MjModel) -> None:
        self._model = copy.copy(robots)
        self._model.opt.gravity[:] = 0.0
        self._data = mujoco.MjData(self._model)
        self._grips = [robots.site(f"{side}_{GRIP_SITE}").id for side in SIDES]
        self._sensors = [robots.site(f"{side}_{FT_SITE}").id for side in SIDES]
        self._placed = b""

    def grips(self, q: Vector) -> Vector:
        """Return x, y, z [m] and α [rad] of both grips (2, 4), each in its bending frame."""
        self._place(q)
        return grip_poses(self._data.site_xpos[self._grips], self._data.site_xmat[self._grips])

    def grip_axes(self, q: Vector) -> Vector:
        """Return the axes of both grips in the world (2, 3, 3)."""
        self._place(q)
        return np.asarray(self._data.site_xmat[self._grips].reshape(2, 3, 3))

    def sensor_axes(self, q: Vector) -> Vector:
        """Return the axes of both wrist sensors in the world (2, 3, 3)."""
        self._place(q)
        return np.asarray(self._data.site_xmat[self._sensors].reshape(2, 3, 3))

    def coriolis(self, q: Vector, speed: Vector) -> Vector:
        """Return the torques (n,) [N m] of Coriolis and centrifugal forces."""
        torque = np.empty(self._model.nv)
        self._place(q)
        self._data.qvel[:] = speed
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)
        mujoco.mj_rne(self._model, self._data, 0, torque)
        return torque

    def _place(self, q: Vector) -> None:
        """Place the arms; a cycle asks three times at the same angles."""
        if (at := q.tobytes()) != self._placed:
            self._data.qpos[:], self._placed = q, at
            mujoco.mj_kinematics(self._model, self._data)
