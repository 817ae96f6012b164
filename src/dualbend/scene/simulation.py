"""Simulation of a cell by command cycles; the only module that steps the physics."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from dualbend.arm import mjcf as arm
from dualbend.arm.pair import arm_joints
from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.scene.cell import PAD_SITE, PAD_WIDTH_M, GraspConfig, harden_holds
from dualbend.scene.contacts import UnintendedContacts
from dualbend.scene.sheet.model import SheetModel, StripModel
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, StripConfig
from dualbend.scene.slip import SlidingGrips
from dualbend.types import SIDES, Vector, matvec

# A turn by π about z takes the left arm's bending frame to the right arm's: x and y change sign.
BENDING_TO_WORLD = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])

PLANAR = np.array([0, 2, 3])
"""Which of x, y, z, α of a grip make its planar pose."""


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The cell at the start of a command cycle; row 0 the left arm, row 1 the right one.

    Attributes
    ----------
    q, speed, torque : (n,) measured joint angles [rad], speeds [rad/s], servo torques [N m]
    grip, edge : (2, 4) x, y, z [m] and end slope α [rad] of the gripper and of the sheet's edge,
        each in its arm's bending frame, whose origin is on the floor in the mid-plane
    wrench : (2, 6) force [N] and moment [N m] of the sheet on the arm, about the gripper centre,
        in the bending frame
    sag : height of the two edges' mean above the sheet's middle [m]
    """

    q: Vector
    speed: Vector
    torque: Vector
    grip: Vector
    edge: Vector
    wrench: Vector
    sag: float


@dataclass(frozen=True, kw_only=True)
class SensorSample:
    """True wrench on the arms at the wrist sensors, in their frames, delayed by the latency.

    ``wrench`` (2, 6) [N, N m]; ``rotation`` (2, 3, 3) takes sensor axes to the world. ``new``: not
    the sample that was told a command before.
    """

    wrench: Vector
    rotation: Vector
    new: bool = True


class Simulation:
    """A compiled cell and its state, advanced one command cycle at a time.

    Parameters
    ----------
    model
        From :func:`dualbend.scene.cell.compose_cell`.
    grasp, sheet
        What the model was composed with; the strips, or the sheet's model in the compiled cell.
    latency_steps
        Least age of the sensor sample at the start of the cycle that uses it [physics steps]. The
        youngest is one step old: the force that acts during a step is known when it is done.
    sampling_steps
        Between two samples of sensors that run by their own clock, from the start on [physics
        steps]; None: one for each command, of just the least age.
    width_m
        Of the sheet, for the friction of the grips.
    period_s
        Of the commands.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        grasp: GraspConfig,
        sheet: StripConfig | SheetModel,
        latency_steps: int = 0,
        width_m: float = PAD_WIDTH_M,
        *,
        sampling_steps: int | None = None,
        period_s: float = COMMAND_PERIOD_S,
    ) -> None:
        harden_holds(model)
        self.model, self.data = model, mujoco.MjData(model)
        self.steps = steps_per_cycle(model.opt.timestep, period_s)
        self.joints = arm_joints(model)
        """Names of the arms' joints, in the order of every vector over them."""
        joints = [model.joint(name) for name in self.joints]
        self._q = np.array([joint.qposadr[0] for joint in joints])
        self.dofs = np.array([joint.dofadr[0] for joint in joints])
        self.joint_range = np.array([joint.range for joint in joints])
        self.torque_limit = model.jnt_actfrcrange[[joint.id for joint in joints], 1].copy()
        self._stiffness = -model.actuator_biasprm[: len(joints), 1].copy()
        self.sheet = StripModel(model, sheet) if isinstance(sheet, StripConfig) else sheet
        self.bend_stiffness = self.sheet.bend_stiffness
        """Moment over bending angle [N m/rad]."""
        self._hold_ids(grasp, width_m)
        self.contacts = UnintendedContacts(model, self.data)
        self.on_step: list[Callable[[], None]] = []
        """Called after every physics step, where once per cycle would miss a peak."""
        self.parts: Callable[[], int] = lambda: 1
        """Asked before every physics step into how many, a power of two, it is to be divided."""
        self.fed_forward: Callable[[Vector, Vector], Vector] | None = None
        """Torques (n,) [N m] that the drives add, of joint angles and speeds (n,); None: the
        Coriolis torques of these arms, and any weight that they do not compensate by themselves."""
        # A sample that is taken after step i, counted from 1, is one step old when that step ends.
        self._latency = max(latency_steps, 1) - 1
        self._sampling = sampling_steps or self.steps
        self._first = 0 if sampling_steps else -self._latency
        self._taken: deque[tuple[int, Vector]] = deque()
        self._done = 0

    def _hold_ids(self, grasp: GraspConfig, width_m: float) -> None:
        model = self.model
        self._grips = [model.site(f"{side}_{arm.GRIP_SITE}").id for side in SIDES]
        self._pads = [model.site(f"{side}_{PAD_SITE}").id for side in SIDES]
        edges = [model.site(name).id for name in (LEFT_END, RIGHT_END)]
        self._ends = np.array([self._grips, edges])
        self._ft_sites = [model.site(f"{side}_{arm.FT_SITE}").id for side in SIDES]
        sensors = [model.sensor(f"{side}_{name}") for side in SIDES for name in arm.FT_SENSORS]
        self._ft = np.add.outer([s.adr[0] for s in sensors], np.arange(3)).reshape(2, 6)
        pads = [model.joint(f"{side}_{PAD_SITE}_slide_x") for side in SIDES]
        self._pad_q = np.array([pad.qposadr[0] + np.arange(6) for pad in pads])
        self._pad_dof = np.array([pad.dofadr[0] + np.arange(6) for pad in pads])
        self._pad_stiffness = np.repeat(
            [grasp.translational_stiffness_n_per_m, grasp.rotational_stiffness_n_m_per_rad], 3
        )
        self._pad_damping = grasp.loss_time_s * self._pad_stiffness
        self.sliding = (
            None if grasp.friction is None else SlidingGrips(model, self.data, grasp, width_m)
        )
        self._displaced = np.zeros((2, 6))
        self._drives = slice(0, len(self._q))
        jaws = [model.joint(f"{side}_{jaw}") for side in SIDES for jaw in arm.JAW_JOINTS]
        self._jaw_q = [jaw.qposadr[0] for jaw in jaws]

    def reset(self, positions: Vector) -> SensorSample:
        """Start at rest in positions from :meth:`positions` (nq,) and return the first sample."""
        mujoco.mj_resetData(self.model, self.data)
        if self.sliding is not None:
            moved = self.sliding.offset.any()
            self.sliding.reset()
            if moved:
                self.displace_grasps(np.zeros((2, 6)))
        self.data.qpos[:] = positions
        self.data.ctrl[self._drives] = positions[self._q]
        mujoco.mj_forward(self.model, self.data)
        self.contacts.reset()
        sample = self._sense()
        self._done = 0
        # What was sampled before is as it is now.
        last, older = -(-self._first % self._sampling), self._latency // self._sampling + 1
        self._taken = deque((last - k * self._sampling, sample) for k in range(older, -1, -1))
        self._newest()
        return _unpack(sample, new=True)

    def positions(
        self,
        q: Vector,
        jaw_opening_m: float,
        slopes: Vector,
        middle_m: Vector,
        yaw_rad: float = 0.0,
    ) -> Vector:
        """Return the physics positions (nq,) of arms, jaws and sheet.

        Joint angles (n,) [rad], opening of each jaw, slopes of the sheet's pieces (N + 1,) [rad],
        place of its middle (3,) in the world [m], its turn about the vertical.
        """
        qpos: Vector = self.model.qpos0.copy()
        qpos[self._q] = q
        qpos[self._jaw_q] = jaw_opening_m
        self.sheet.place(qpos, slopes, middle_m, yaw_rad)
        return qpos

    def put_sheet(self, slopes: Vector, middle_m: Vector, yaw_rad: float) -> None:
        """Put the sheet elsewhere, at rest, untwisted; arguments as :meth:`positions` has them."""
        self.sheet.place(self.data.qpos, slopes, middle_m, yaw_rad)
        self.data.qvel[self.sheet.dofs] = 0.0

    @property
    def q(self) -> Vector:
        """Joint angles (n,) [rad]."""
        return np.asarray(self.data.qpos[self._q])

    @property
    def bending_angles(self) -> Vector:
        """Bending angles from the left end [rad]; the stiffness times them is the moment."""
        return self.sheet.bending_angles(self.data)

    def observe(self) -> Observation:
        """Update the positions and return what they are; call :meth:`advance` next."""
        data = self.data
        mujoco.mj_step1(self.model, data)
        grip_axes = data.site_xmat[self._grips].reshape(2, 3, 3)
        load = (
            self._pad_stiffness * data.qpos[self._pad_q]
            + self._pad_damping * data.qvel[self._pad_dof]
        )
        if self.sliding is not None and any(self.sliding.sliding):
            self.sliding.replace(load)
        load = load.reshape(2, 2, 3)
        wrench = (load @ grip_axes.transpose(0, 2, 1)) * BENDING_TO_WORLD[:, np.newaxis]
        grip, edge = self._planar()
        return Observation(
            q=data.qpos[self._q],
            speed=data.qvel[self.dofs],
            torque=data.qfrc_actuator[self.dofs],
            grip=grip,
            edge=edge,
            wrench=wrench.reshape(2, 6),
            sag=float(edge[:, 2].mean()) - self.sheet.middle_height(data),
        )

    def _planar(self) -> Vector:
        """Return (2, 2, 4): gripper and edge, left and right, x, y, z and end slope."""
        return grip_poses(self.data.site_xpos[self._ends], self.data.site_xmat[self._ends])

    @property
    def sensor_axes(self) -> Vector:
        """Axes of both wrist sensors in the world (2, 3, 3)."""
        return np.asarray(self.data.site_xmat[self._ft_sites].reshape(2, 3, 3))

    def sensor_axes_at(self, poses: Vector) -> Vector:
        """Return those axes (k, 2, 3, 3) of the true arms at encoders' angles (k, n)."""
        data, found = mujoco.MjData(self.model), np.empty((len(poses), 2, 9))
        for i, q in enumerate(poses):
            data.qpos[self._q] = q
            mujoco.mj_kinematics(self.model, data)
            found[i] = data.site_xmat[self._ft_sites]
        return found.reshape(-1, 2, 3, 3)

    @property
    def grip_axes(self) -> Vector:
        """Axes of both grips in the world (2, 3, 3)."""
        return np.asarray(self.data.site_xmat[self._grips].reshape(2, 3, 3))

    def roll_and_yaw(self) -> Vector:
        """Return (2, 2, 2): gripper and edge, left and right, roll and yaw [rad].

        With a pitch they make the axes in the arm's bending frame, R_z(yaw) R_y(pitch) R_x(roll);
        the observed end slope α has tan α cos(yaw) = tan(pitch).
        """
        axes = self.data.site_xmat[self._ends]
        turns = np.empty((2, 2, 2))
        turns[..., 0] = np.arctan2(axes[..., 7], axes[..., 8])
        turns[..., 1] = np.arctan2(
            axes[..., 3] * BENDING_TO_WORLD[:, 1], axes[..., 0] * BENDING_TO_WORLD[:, 0]
        )
        return turns

    def grasps(self) -> Vector:
        """Return how each sheet edge lies to its gripper's frame G, (2, 6).

        x, y, z [m], roll, pitch, yaw [rad]: R_GE = R_z(yaw) R_y(pitch) R_x(roll).
        """
        axes = self.data.site_xmat[self._ends].reshape(2, 2, 3, 3)
        grip, edge = self.data.site_xpos[self._ends]
        place = matvec(axes[0].mT, edge - grip)
        turn = axes[0].mT @ axes[1]
        roll = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
        pitch = -np.arcsin(turn[:, 2, 0])
        yaw = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
        return np.column_stack((place, roll, pitch, yaw))

    def displace_grasps(self, errors: Vector) -> None:
        """Let each sheet edge lie off its gripper's frame, (2, 6) as :meth:`grasps` has it.

        The sheet follows within a step, so change it little by little.
        """
        self._displaced = errors
        if self.sliding is not None:
            errors = errors + self.sliding.offset
        # A site that was compiled onto its body's frame would stay there whatever its place says.
        self.model.site_sameframe[self._pads] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        cosines, sines = np.cos(errors[:, 3:] / 2), np.sin(errors[:, 3:] / 2)
        self.model.site_pos[self._pads] = errors[:, :3]
        for pad, (cr, cp, cy), (sr, sp, sy) in zip(self._pads, cosines, sines, strict=True):
            self.model.site_quat[pad] = (
                cr * cp * cy + sr * sp * sy,
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
            )

    def advance(self, setpoints: Vector) -> SensorSample:
        """Run one command cycle on ``setpoints`` (steps, n) [rad], one row a physics step.

        What is fed forward is of the cycle's start.
        """
        model, data = self.model, self.data
        if self.sliding is not None and self.sliding.look():
            self.displace_grasps(self._displaced)
        if self.fed_forward is None:
            feed_forward = data.qfrc_bias[self.dofs] - data.qfrc_gravcomp[self.dofs]
        else:
            feed_forward = self.fed_forward(data.qpos[self._q], data.qvel[self.dofs])
        rows = setpoints + feed_forward / self._stiffness
        whole_s = model.opt.timestep
        for step in range(self.steps):
            data.ctrl[self._drives] = rows[step]
            parts = self.parts()
            model.opt.timestep = whole_s / parts
            for part in range(parts):
                if step or part:
                    mujoco.mj_step(model, data)
                else:
                    mujoco.mj_step2(model, data)
                self._after_step()
            self._done += 1
            if (self._done - self._first) % self._sampling == 0:
                self._taken.append((self._done, self._sense()))
        model.opt.timestep = whole_s
        told, _ = self._taken[0]
        newest, sample = self._newest()
        return _unpack(sample, new=newest != told)

    def _newest(self) -> tuple[int, Vector]:
        """Forget what is older than the newest sample that is as old as it must be; return it."""
        while len(self._taken) > 1 and self._taken[1][0] <= self._done - self._latency:
            self._taken.popleft()
        return self._taken[0]

    def _after_step(self) -> None:
        if self.sliding is not None and self.sliding.near and self.sliding.slide():
            self.displace_grasps(self._displaced)
        self.contacts.on_step()
        for act in self.on_step:
            act()

    def _sense(self) -> Vector:
        data = self.data
        # MuJoCo tells what the arm exerts on the tool: the wrench on the arm is its opposite.
        return np.concatenate(
            (-data.sensordata[self._ft].ravel(), data.site_xmat[self._ft_sites].ravel())
        )


def grip_poses(places: Vector, axes: Vector) -> Vector:
    """Return x, y, z [m] and end slope α [rad] (..., 2, 4) of frames in the world.

    Origins (..., 2, 3) and axes (..., 2, 9) of the left and the right arm, each in its arm's
    bending frame.
    """
    pose = np.empty((*places.shape[:-1], 4))
    pose[..., :3] = places * BENDING_TO_WORLD
    pose[..., 3] = np.arctan2(-axes[..., 6], axes[..., 0] * BENDING_TO_WORLD[:, 0])
    return pose


def _unpack(sample: Vector, *, new: bool) -> SensorSample:
    return SensorSample(
        wrench=sample[:12].reshape(2, 6), rotation=sample[12:].reshape(2, 3, 3), new=new
    )


def tool_mass_and_centre(model: mujoco.MjModel, side: str) -> tuple[float, Vector]:
    """Return mass [kg] and centre of mass (3,) [m] of all beyond the sensor, in its frame."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body(f"{side}_hand").id
    site = data.site(f"{side}_{arm.FT_SITE}")
    offset = data.subtree_com[body] - site.xpos
    return float(model.body_subtreemass[body]), site.xmat.reshape(3, 3).T @ offset
