"""What is observed of a cell, or of many alike: wherever positions and forces are, it is read here.

Everything reads a source with the fields of :class:`mujoco.MjData`, with or without a leading axis
of cells: an MjData has none, a :class:`mujoco.batch.Batch` has one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from dualbend.arm import mjcf as arm
from dualbend.scene.cell import PAD_SITE, GraspConfig
from dualbend.scene.sheet.model import SheetModel
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END
from dualbend.types import SIDES, Reals, Vector, matvec

Source = Any
"""An MjData, or what has its fields with a leading axis of cells."""

# A turn by π about z takes the left arm's bending frame to the right arm's: x and y change sign.
BENDING_TO_WORLD = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])

PLANAR = np.array([0, 2, 3])
"""Which of x, y, z, α of a grip make its planar pose."""


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class SensorSample:
    """True wrench on the arms at the wrist sensors, in their frames, delayed by the latency.

    ``wrench`` (..., 2, 6) [N, N m]; ``rotation`` (..., 2, 3, 3) takes sensor axes to the world.
    ``new``: not the sample that was told a command before.
    """

    wrench: Vector
    rotation: Vector
    new: bool = True


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
        joints: Vector,
        dofs: Vector,
    ) -> None:
        self.sheet, self._q, self._dofs = sheet, joints, dofs
        self.grips = np.array([model.site(f"{side}_{arm.GRIP_SITE}").id for side in SIDES])
        edges = [model.site(name).id for name in (LEFT_END, RIGHT_END)]
        self._ends = np.array([self.grips, edges])
        self._sensors = np.array([model.site(f"{side}_{arm.FT_SITE}").id for side in SIDES])
        sensors = [model.sensor(f"{side}_{name}") for side in SIDES for name in arm.FT_SENSORS]
        self._readings = np.add.outer([s.adr[0] for s in sensors], np.arange(3)).reshape(2, 6)
        pads = [model.joint(f"{side}_{PAD_SITE}_slide_x") for side in SIDES]
        self._pad_q = np.array([pad.qposadr[0] + np.arange(6) for pad in pads])
        self._pad_dof = np.array([pad.dofadr[0] + np.arange(6) for pad in pads])
        self.pad_stiffness: Vector = np.repeat(
            [grasp.translational_stiffness_n_per_m, grasp.rotational_stiffness_n_m_per_rad], 3
        )
        self.pad_damping: Vector = grasp.loss_time_s * self.pad_stiffness

    def joint_angles(self, data: Source) -> Vector:
        """Return the arms' joint angles (..., n) [rad]."""
        return np.asarray(data.qpos[..., self._q])

    def pad_loads(self, data: Source) -> Vector:
        """Return force [N] and moment [N m] (..., 2, 6) in both grips, in the gripper's frame."""
        return np.asarray(
            self.pad_stiffness * data.qpos[..., self._pad_q]
            + self.pad_damping * data.qvel[..., self._pad_dof]
        )

    def observation(self, data: Source, load: Vector) -> Observation:
        """Return what is observed where the grips bear a load (..., 2, 6)."""
        axes = self.grip_axes(data)
        halves = load.reshape(*load.shape[:-1], 2, 3)
        wrench = (halves @ np.swapaxes(axes, -1, -2)) * BENDING_TO_WORLD[:, np.newaxis]
        ends = grip_poses(data.site_xpos[..., self._ends, :], data.site_xmat[..., self._ends, :])
        edge = ends[..., 1, :, :]
        return Observation(
            q=data.qpos[..., self._q],
            speed=data.qvel[..., self._dofs],
            torque=data.qfrc_actuator[..., self._dofs],
            grip=ends[..., 0, :, :],
            edge=edge,
            wrench=wrench.reshape(load.shape),
            sag=edge[..., 2].mean(axis=-1) - self.sheet.middle_height(data),
        )

    def grip_axes(self, data: Source) -> Vector:
        """Return the axes of both grips in the world (..., 2, 3, 3)."""
        axes = data.site_xmat[..., self.grips, :]
        return np.asarray(axes.reshape(*axes.shape[:-1], 3, 3))

    def sensor_axes(self, data: Source) -> Vector:
        """Return the axes of both wrist sensors in the world (..., 2, 3, 3)."""
        axes = data.site_xmat[..., self._sensors, :]
        return np.asarray(axes.reshape(*axes.shape[:-1], 3, 3))

    def sample(self, data: Source) -> tuple[Vector, Vector]:
        """Return the true wrenches (..., 2, 6) on both arms at their sensors, and their axes."""
        # MuJoCo tells what the arm exerts on the tool: the wrench on the arm is its opposite.
        return -data.sensordata[..., self._readings], self.sensor_axes(data)

    def roll_and_yaw(self, data: Source) -> Vector:
        """Return (..., 2, 2, 2): gripper and edge, left and right, roll and yaw [rad].

        With a pitch they make the axes in the arm's bending frame, R_z(yaw) R_y(pitch) R_x(roll);
        the observed end slope α has tan α cos(yaw) = tan(pitch).
        """
        axes = data.site_xmat[..., self._ends, :]
        along, up = BENDING_TO_WORLD[:, 0], BENDING_TO_WORLD[:, 1]
        roll = np.arctan2(axes[..., 7], axes[..., 8])
        return np.stack((roll, np.arctan2(axes[..., 3] * up, axes[..., 0] * along)), axis=-1)

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


def grip_poses(places: Vector, axes: Vector) -> Vector:
    """Return x, y, z [m] and end slope α [rad] (..., 2, 4) of frames in the world.

    Origins (..., 2, 3) and axes (..., 2, 9) of the left and the right arm, each in its arm's
    bending frame.
    """
    pose = np.empty((*places.shape[:-1], 4))
    pose[..., :3] = places * BENDING_TO_WORLD
    pose[..., 3] = np.arctan2(-axes[..., 6], axes[..., 0] * BENDING_TO_WORLD[:, 0])
    return pose


def tool_mass_and_centre(model: mujoco.MjModel, side: str) -> tuple[float, Vector]:
    """Return mass [kg] and centre of mass (3,) [m] of all beyond the sensor, in its frame."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body(f"{side}_hand").id
    site = data.site(f"{side}_{arm.FT_SITE}")
    offset = data.subtree_com[body] - site.xpos
    return float(model.body_subtreemass[body]), site.xmat.reshape(3, 3).T @ offset
