"""What is observed of a cell, or of many alike: wherever positions and forces are, it is read here.

Everything reads a source with the fields of :class:`mujoco.MjData`, with or without a leading axis
of cells: an MjData has none, a :class:`mujoco.batch.Batch` has one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.arm import mjcf as arm
from dualbend.scene.cell import PAD_SITE, GraspConfig
from dualbend.scene.sheet.model import SheetModel
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END
from dualbend.types import SIDES, Reals, Vector, indices, matvec

Source = Any
"""An MjData, or what has its fields with a leading axis of cells."""

# A turn by π about z takes the left arm's bending frame to the right arm's: x and y change sign.
BENDING_TO_WORLD = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])
_INWARD = BENDING_TO_WORLD[:, 0]

# The same for all that one cell has of both ends: no product in the loop broadcasts.
_OF_HALVES = np.stack((BENDING_TO_WORLD, BENDING_TO_WORLD), axis=1)
_OF_ENDS = np.stack((np.ones((2, 2)), np.tile(BENDING_TO_WORLD[:, 1], (2, 1))), axis=-1)
_OF_TURNS = np.stack((_OF_ENDS, _OF_ENDS))

PLANAR = np.array([0, 2, 3])
"""Which of x, y, z, α of a grip make its planar pose."""


@dataclass(kw_only=True, slots=True)
class Observation:
    """A cell, or each of many, at the start of a command cycle; arms are left and right.

    Attributes
    ----------
    q, speed, torque : (..., n) measured joint angles [rad], speeds [rad/s], servo torques [N m]
    grip, edge : (..., 2, 4) x, y, z [m] and end slope α [rad] of the gripper and of the sheet's
        edge, each in its arm's bending frame, whose origin is on the floor in the mid-plane
    wrench : (..., 2, 6) force [N] and moment [N m] of the sheet on the arm, about the gripper
        centre, in the bending frame
    sag : (...) height of the two edges' mean above the sheet's middle [m]
    """

    q: Vector
    speed: Vector
    torque: Vector
    grip: Vector
    edge: Vector
    wrench: Vector
    sag: Reals


_AT_LIMIT = 1.0 - 1e-9
"""Share of the limit from where on a drive is at it."""


class SensorSample(msgspec.Struct, frozen=True, kw_only=True):
    """True wrench on the arms at the wrist sensors, in their frames, delayed by the latency.

    ``wrench`` (..., 2, 6) [N, N m]; ``rotation`` (..., 2, 3, 3) takes sensor axes to the world.
    ``new``: not the sample that was told a command before.
    """

    wrench: Vector
    rotation: Vector
    new: bool = True


class Drives:
    """Torques of n position-controlled joints, and what limits them, in implicit steps.

    In a step h MuJoCo's discrete integrator moves a joint by k (u − q⁺) − c q̇, with the angle at
    its end, q⁺ = q + h q̇⁺. It tells and limits k (u − q) − c q̇, which is k h q̇ more.
    ``limit`` (..., n) [N m], ``stiffness`` k (..., n) [N m/rad].
    """

    def __init__(self, limit: Vector, stiffness: Vector, step_s: float) -> None:
        self._limit, self._lead = limit, step_s * stiffness
        self._ahead = np.zeros_like(self._lead)

    def range(self, speed: Vector) -> Vector:
        """Return between what MuJoCo is to limit in a cycle that begins at a speed (..., n, 2)."""
        self._ahead = self._lead * speed
        return np.stack((self._ahead - self._limit, self._ahead + self._limit), axis=-1)

    def torque(self, told: Vector, speed: Vector) -> Vector:
        """Return the torque (..., n) of the last step, of which MuJoCo told ``told`` [N m]."""
        beyond = told - self._ahead
        # A drive at its limit is there, however its speed has changed in the cycle.
        within = np.abs(beyond) < self._limit * _AT_LIMIT
        return np.where(within, told - self._lead * speed, np.copysign(self._limit, beyond))


class Observer:
    """Reads a cell's grips, loads and wrist sensors from where the physics has them.

    Parameters
    ----------
    model
        A compiled cell; any other of the same structure has its things in the same places.
    grasp, sheet
        What the model was composed with.
    joints, dofs
        Where the arms' n joints are, in the order of every vector over them.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        grasp: GraspConfig,
        sheet: SheetModel,
        joints: NDArray[np.int_],
        dofs: NDArray[np.int_],
    ) -> None:
        self.sheet = sheet
        self._q, self._dofs = indices(joints), indices(dofs)
        self.grips = indices([model.site(f"{side}_{arm.GRIP_SITE}").id for side in SIDES])
        edges = [model.site(name).id for name in (LEFT_END, RIGHT_END)]
        self._ends = indices(np.stack((self.grips, edges)))
        # Of which two elements of their axes, as nine numbers, roll and yaw of grips and edges are.
        self._turns = indices(np.add.outer(9 * self._ends, [[7, 3], [8, 0]]).transpose(2, 0, 1, 3))
        self._sensors = indices([model.site(f"{side}_{arm.FT_SITE}").id for side in SIDES])
        sensors = [model.sensor(f"{side}_{name}") for side in SIDES for name in arm.FT_SENSORS]
        readings = np.add.outer([s.adr[0] for s in sensors], np.arange(3)).reshape(2, 6)
        self._readings = indices(readings)
        pads = [model.joint(f"{side}_{PAD_SITE}_slide_x") for side in SIDES]
        self._pad_q = indices([pad.qposadr[0] + np.arange(6) for pad in pads])
        self._pad_dof = indices([pad.dofadr[0] + np.arange(6) for pad in pads])
        stiffness = [grasp.translational_stiffness_n_per_m, grasp.rotational_stiffness_n_m_per_rad]
        self.pad_stiffness: Vector = np.tile(np.repeat(stiffness, 3), (2, 1))
        self.pad_damping: Vector = grasp.loss_time_s * self.pad_stiffness

    def joint_angles(self, data: Source) -> Vector:
        """Return the arms' joint angles (..., n) [rad]."""
        return np.asarray(data.qpos.take(self._q, axis=-1))

    def pad_loads(self, data: Source) -> Vector:
        """Return force [N] and moment [N m] (..., 2, 6) in both grips, in the gripper's frame."""
        return np.asarray(
            self.pad_stiffness * data.qpos.take(self._pad_q, axis=-1)
            + self.pad_damping * data.qvel.take(self._pad_dof, axis=-1)
        )

    def observation(self, data: Source, load: Vector, torque: Vector) -> Observation:
        """Return what is observed where the grips bear a load (..., 2, 6), and the drives torques.

        ``torque`` (..., n) [N m].
        """
        halves = load.reshape(*load.shape[:-1], 2, 3)
        wrench = halves @ self.grip_axes(data).mT
        wrench *= _OF_HALVES
        places, axes = (of.take(self._ends, axis=-2) for of in (data.site_xpos, data.site_xmat))
        ends = grip_poses(places, axes)
        edge = ends[..., 1, :, :]
        height = 0.5 * (edge[..., 0, 2] + edge[..., 1, 2])
        return Observation(
            q=data.qpos.take(self._q, axis=-1),
            speed=data.qvel.take(self._dofs, axis=-1),
            torque=torque,
            grip=ends[..., 0, :, :],
            edge=edge,
            wrench=wrench.reshape(load.shape),
            sag=height - self.sheet.middle_height(data),
        )

    def grip_axes(self, data: Source) -> Vector:
        """Return the axes of both grips in the world (..., 2, 3, 3)."""
        axes = data.site_xmat.take(self.grips, axis=-2)
        return np.asarray(axes.reshape(*axes.shape[:-1], 3, 3))

    def sensor_axes(self, data: Source) -> Vector:
        """Return the axes of both wrist sensors in the world (..., 2, 3, 3)."""
        axes = data.site_xmat.take(self._sensors, axis=-2)
        return np.asarray(axes.reshape(*axes.shape[:-1], 3, 3))

    def sample(self, data: Source) -> tuple[Vector, Vector]:
        """Return the true wrenches (..., 2, 6) on both arms at their sensors, and their axes."""
        # MuJoCo tells what the arm exerts on the tool: the wrench on the arm is its opposite.
        return -data.sensordata.take(self._readings, axis=-1), self.sensor_axes(data)

    def roll_and_yaw(self, data: Source) -> Vector:
        """Return (..., 2, 2, 2): gripper and edge, left and right, roll and yaw [rad].

        With a pitch they make the axes in the arm's bending frame, R_z(yaw) R_y(pitch) R_x(roll);
        the observed end slope α has tan α cos(yaw) = tan(pitch).
        """
        of = _elements(data.site_xmat, self._turns)
        of *= _OF_TURNS
        return np.asarray(np.arctan2(of[..., 0, :, :, :], of[..., 1, :, :, :]))

    def grasps(self, data: Source) -> Vector:
        """Return how each sheet edge lies to its gripper's frame G, (2, 6).

        x, y, z [m], roll, pitch, yaw [rad]: R_GE = R_z(yaw) R_y(pitch) R_x(roll).
        """
        axes = data.site_xmat[self._ends].reshape(2, 2, 3, 3)
        grip, edge = data.site_xpos[self._ends]
        place = matvec(axes[0].mT, edge - grip)
        turn = axes[0].mT @ axes[1]
        roll = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
        pitch = -np.arcsin(turn[:, 2, 0])
        yaw = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
        return np.column_stack((place, roll, pitch, yaw))


def _elements(axes: Vector, at: NDArray[np.intp]) -> Vector:
    """Return elements of the axes (..., sites, 9) of all sites, counted from the first one's."""
    return axes.reshape(*axes.shape[:-2], -1).take(at, axis=-1)


def grip_poses(places: Vector, axes: Vector) -> Vector:
    """Return x, y, z [m] and end slope α [rad] (..., 2, 4) of frames in the world.

    Origins (..., 2, 3) and axes (..., 2, 9) of the left and the right arm, each in its arm's
    bending frame.
    """
    pose = np.empty((*places.shape[:-1], 4))
    pose[..., :3] = places * BENDING_TO_WORLD
    pose[..., 3] = np.arctan2(-axes[..., 6], axes[..., 0] * _INWARD)
    return pose


def tool_mass_and_centre(model: mujoco.MjModel, side: str) -> tuple[float, Vector]:
    """Return mass [kg] and centre of mass (3,) [m] of all beyond the sensor, in its frame."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body(f"{side}_hand").id
    site = data.site(f"{side}_{arm.FT_SITE}")
    offset = data.subtree_com[body] - site.xpos
    return float(model.body_subtreemass[body]), site.xmat.reshape(3, 3).T @ offset
