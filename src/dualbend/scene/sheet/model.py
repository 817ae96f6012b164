"""The sheet in a compiled cell, strips or shell: placing it, and measuring how it is bent.

Both models have N places of bending at arc lengths (i + 1/2) L/N and N + 1 flat pieces between
them, the middle one at the sheet's middle; so one set of slopes places either.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.scene.mjcf import about_z
from dualbend.scene.sheet.shell import (
    MEMBRANE,
    ShellConfig,
    end_body,
    row_places,
    row_shares,
    set_elasticity,
    vertex_body,
)
from dualbend.scene.sheet.strips import (
    LEFT_END,
    RIGHT_END,
    StripConfig,
    bend_joint,
    hinge_stiffness,
    strip_body,
)
from dualbend.types import Reals, Vector, indices


class StripModel:
    """The chain of strips in a compiled cell.

    Attributes
    ----------
    bend_stiffness : (N,) moment over bending angle at each place of bending [N m/rad]
    dofs : (n,) the sheet's degrees of freedom
    """

    def __init__(self, model: mujoco.MjModel, strips: StripConfig) -> None:
        bends = [model.joint(bend_joint(i)) for i in range(strips.hinges)]
        self.bend_q = indices([joint.qposadr[0] for joint in bends])
        self.bend_stiffness = np.array([hinge_stiffness(model, i) for i in range(strips.hinges)])
        self._middle = model.body(strip_body(strips.hinges // 2)).id
        self._free_q = model.joint("sheet").qposadr[0]
        own = [i for i in range(model.njnt) if model.joint(i).name.startswith("sheet_")]
        self._own_q = model.jnt_qposadr[own]
        free = model.joint("sheet").dofadr[0] + np.arange(6)
        self.dofs = np.concatenate((free, model.jnt_dofadr[own]))

    def place(self, qpos: Vector, slopes: Vector, middle_m: Vector, yaw_rad: float) -> None:
        """Write positions, untwisted: slopes of the pieces (N + 1,) [rad], middle (3,), turn."""
        qpos[self._own_q] = 0.0
        qpos[self.bend_q] = np.diff(slopes)
        free = self._free_q
        qpos[free : free + 3] = middle_m
        qpos[free + 3 : free + 7] = about_z(yaw_rad)

    def bending_angles(self, data: mujoco.MjData) -> Vector:
        """Return the bending angles from the left end (..., N) [rad]."""
        return np.asarray(data.qpos.take(self.bend_q, axis=-1))

    def middle_height(self, data: mujoco.MjData) -> Reals:
        """Return the height of the sheet's middle (...) [m]."""
        height: Reals = data.xpos[..., self._middle, 2]
        return height


class ShellModel:
    """The plate's grid of vertices, used like the strips; writes its elasticity into the model."""

    def __init__(self, model: mujoco.MjModel, sheet: Sheet, config: ShellConfig) -> None:
        self._sheet, self._config = sheet, config
        set_elasticity(model, sheet, config)
        n, rows = config.cells_along, config.cells_across + 2
        self._spacing = sheet.length_m / n
        stiffness = replace(sheet, rigidity="plate").bending_stiffness_nm2 / self._spacing
        self.bend_stiffness = np.full(config.sections, stiffness)
        bodies = np.array(
            [[model.body(vertex_body(i, j)).id for j in range(rows)] for i in range(2, n)]
        )
        joints = model.body_jntadr[bodies]
        self._home = model.body_pos[bodies]
        self._q = model.jnt_qposadr[joints][..., np.newaxis] + np.arange(3)
        free = model.jnt_dofadr[joints][..., np.newaxis] + np.arange(3)
        flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, MEMBRANE)
        at = int(model.flex_vertadr[flex])
        self._grid = n + 2, rows, 3
        self._vertices = slice(at, at + (n + 2) * rows)
        ends = [model.joint(end_body(end)) for end in (LEFT_END, RIGHT_END)]
        self._shares = row_shares(sheet, config) / sheet.width_m
        self._ends_q = [joint.qposadr[0] for joint in ends]
        self.dofs = np.concatenate([*(end.dofadr[0] + np.arange(6) for end in ends), free.ravel()])

    def columns(self, data: mujoco.MjData) -> Vector:
        """Return the vertices (N + 2, M + 2, 3) in the world [m]."""
        return np.asarray(data.flexvert_xpos[self._vertices].reshape(self._grid))

    def place(self, qpos: Vector, slopes: Vector, middle_m: Vector, yaw_rad: float) -> None:
        """Put the free vertices and both edges on the cylindrical surface of these slopes."""
        h = self._spacing
        steps = h * np.stack((np.cos(slopes), -np.sin(slopes)), axis=1)
        line = np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
        half = len(slopes) // 2
        line -= 0.5 * (line[half] + line[half + 1])
        across = row_places(self._sheet, self._config)
        x, y = line[2:-2, :1], across[np.newaxis]
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        z = np.broadcast_to(line[2:-2, 1:], np.broadcast_shapes(x.shape, y.shape))
        places = np.stack((c * x - s * y, s * x + c * y, z), axis=2) + middle_m
        qpos[self._q] = places - self._home
        ends = (
            (line[0] + line[1], slopes[0], yaw_rad),
            (line[-2] + line[-1], -slopes[-1], yaw_rad + np.pi),
        )
        for at, (twice, alpha, turn) in zip(self._ends_q, ends, strict=True):
            along, up = 0.5 * twice
            qpos[at : at + 3] = middle_m + np.array([c * along, s * along, up])
            (ct, ca), (st, sa) = np.cos([turn / 2, alpha / 2]), np.sin([turn / 2, alpha / 2])
            qpos[at + 3 : at + 7] = ct * ca, -st * sa, ct * sa, st * ca

    def bending_angles(self, data: mujoco.MjData) -> Vector:
        """Return the turn of the mid-line of the columns' means from piece to piece."""
        line = np.einsum("ijk,j->ik", self.columns(data), self._shares)
        steps = np.diff(line, axis=0)
        before, after = steps[:-1], steps[1:]
        axis = np.cross(before, after)
        across = self.columns(data)[1:-1, -1] - self.columns(data)[1:-1, 0]
        sine = np.sum(axis * across, axis=1) / np.linalg.norm(across, axis=1)
        return np.asarray(np.arctan2(sine, np.sum(before * after, axis=1)))

    def middle_height(self, data: mujoco.MjData) -> float:
        """Return the mean height of the two columns beside the middle."""
        half = self._config.cells_along // 2
        return float((self.columns(data)[half : half + 2, :, 2] @ self._shares).mean())


SheetModel = StripModel | ShellModel
