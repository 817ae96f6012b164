"""Simulation of a cell by command cycles; the only module that steps the physics."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from dualbend.arm.mjcf import JAW_JOINTS
from dualbend.arm.pair import arm_joints
from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.scene.cell import PAD_SITE, PAD_WIDTH_M, GraspConfig, harden_holds
from dualbend.scene.contacts import UnintendedContacts
from dualbend.scene.mjcf import about_zyx
from dualbend.scene.observation import Drives, Observation, Observer, SensorSample
from dualbend.scene.samples import SampleLine
from dualbend.scene.sheet.model import SheetModel, StripModel
from dualbend.scene.sheet.strips import StripConfig
from dualbend.scene.slip import SlidingGrips
from dualbend.types import SIDES, Vector, indices


def _undivided() -> int:
    return 1


_AWAY_M = 10.0


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
        self._q = indices([joint.qposadr[0] for joint in joints])
        self.dofs = np.array([joint.dofadr[0] for joint in joints])
        self._dofs = indices(self.dofs)
        self.joint_range = np.array([joint.range for joint in joints])
        self.joint_ids, self._limits = [joint.id for joint in joints], model.jnt_actfrcrange
        self.torque_limit: Vector = self._limits[self.joint_ids, 1]
        self.actuator_stiffness = -model.actuator_biasprm[: len(joints), 1].copy()
        self._drives = Drives(self.torque_limit, self.actuator_stiffness, model.opt.timestep)
        self.sheet = StripModel(model, sheet) if isinstance(sheet, StripConfig) else sheet
        self.bend_stiffness = self.sheet.bend_stiffness
        """Moment over bending angle [N m/rad]."""
        self.observer = Observer(model, grasp, self.sheet, self._q, self.dofs)
        self.pads = [model.site(f"{side}_{PAD_SITE}").id for side in SIDES]
        self.sliding = (
            None if grasp.friction is None else SlidingGrips(model, self.data, grasp, width_m)
        )
        self._displaced = np.zeros((2, 6))
        self._ctrl = self.data.ctrl[: len(self._q)]
        jaws = [model.joint(f"{side}_{jaw}") for side in SIDES for jaw in JAW_JOINTS]
        self._jaw_q = [jaw.qposadr[0] for jaw in jaws]
        self.contacts = UnintendedContacts(model, self.data)
        self.warned = self.data.warning.number
        """How often MuJoCo has counted each of its warnings."""
        self.on_step: list[Callable[[], None]] = []
        """Called after every physics step, where once per cycle would miss a peak."""
        self.parts: Callable[[], int] = _undivided
        """Asked before every physics step into how many, a power of two, it is to be divided.

        0: its contacts are to be found first, and :attr:`parts_by_contacts` to be asked.
        """
        self.parts_by_contacts: Callable[[], int] = _undivided
        self.fed_forward: Callable[[Vector, Vector], Vector] | None = None
        """Torques (n,) [N m] that the drives add, of joint angles and speeds (n,); None: the
        Coriolis torques of these arms, and any weight that they do not compensate by themselves."""
        self.samples = SampleLine(latency_steps, sampling_steps, self.steps)

    def reset(self, positions: Vector) -> SensorSample:
        """Start at rest in positions from :meth:`positions` (nq,) and return the first sample."""
        mujoco.mj_resetData(self.model, self.data)
        self._limit_torques()
        if self.sliding is not None:
            moved = self.sliding.offset.any()
            self.sliding.reset()
            if moved:
                self.displace_grasps(np.zeros((2, 6)))
        self.data.qpos[:] = positions
        self._ctrl[:] = positions[self._q]
        mujoco.mj_forward(self.model, self.data)
        self.contacts.reset()
        return self.samples.reset(self.observer.sample(self.data))

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

    def take_sheet_away(self) -> None:
        """Let go of the sheet, which floats flat and far from the arms from then on."""
        for side in SIDES:
            self.data.eq_active[self.model.equality(f"{side}_hold").id] = 0
        self.model.body_gravcomp[self.model.dof_bodyid[self.sheet.dofs]] = 1.0
        self.put_sheet(np.zeros(len(self.bend_stiffness) + 1), np.array([0.0, _AWAY_M, 1.0]), 0.0)

    @property
    def q(self) -> Vector:
        """Joint angles (n,) [rad]."""
        return self.observer.joint_angles(self.data)

    @property
    def bending_angles(self) -> Vector:
        """Bending angles from the left end [rad]; the stiffness times them is the moment."""
        return self.sheet.bending_angles(self.data)

    def observe(self) -> Observation:
        """Update the positions and return what they are; call :meth:`advance` next."""
        mujoco.mj_step1(self.model, self.data)
        load = self.observer.pad_loads(self.data)
        if self.sliding is not None and any(self.sliding.sliding):
            self.sliding.replace(load)
        data = self.data
        told, speed = data.qfrc_actuator.take(self._dofs), data.qvel.take(self._dofs)
        return self.observer.observation(data, load, self._drives.torque(told, speed))

    def _limit_torques(self) -> None:
        self._limits[self.joint_ids] = self._drives.range(self.data.qvel.take(self._dofs))

    def sensor_axes_at(self, poses: Vector) -> Vector:
        """Return the axes of both sensors (k, 2, 3, 3) of the true arms at encoders' angles."""
        data, found = mujoco.MjData(self.model), []
        for q in poses:
            data.qpos[self._q] = q
            mujoco.mj_kinematics(self.model, data)
            found.append(self.observer.sensor_axes(data))
        return np.array(found)

    def displace_grasps(self, errors: Vector) -> None:
        """Let each sheet edge lie off its gripper's frame, (2, 6) as :meth:`grasps` has it.

        The sheet follows within a step, so change it little by little.
        """
        self._displaced = errors
        if self.sliding is not None:
            errors = errors + self.sliding.offset
        # A site that was compiled onto its body's frame would stay there whatever its place says.
        self.model.site_sameframe[self.pads] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        cosines, sines = np.cos(errors[:, 3:] / 2), np.sin(errors[:, 3:] / 2)
        self.model.site_pos[self.pads] = errors[:, :3]
        for pad, cosine, sine in zip(self.pads, cosines, sines, strict=True):
            self.model.site_quat[pad] = about_zyx(cosine, sine)

    def advance(self, setpoints: Vector) -> SensorSample:
        """Run one command cycle on ``setpoints`` (steps, n) [rad], one row a physics step.

        What is fed forward is of the cycle's start.
        """
        model, data = self.model, self.data
        if self.sliding is not None and self.sliding.look():
            self.displace_grasps(self._displaced)
        if self.fed_forward is None:
            feed_forward = data.qfrc_bias.take(self._dofs) - data.qfrc_gravcomp.take(self._dofs)
        else:
            feed_forward = self.fed_forward(self.q, data.qvel.take(self._dofs))
        rows = setpoints + feed_forward / self.actuator_stiffness
        self._limit_torques()
        after, options, whole_s = self._after_step(), model.opt, model.opt.timestep
        step = mujoco.mj_step2  # what is observed is the first half of this step
        done = 0
        while done < self.steps:
            until = min(done + self.samples.to_next, self.steps)
            for row in rows[done:until]:
                self._ctrl[:] = row
                parts = self.parts()
                if not parts:
                    if step is mujoco.mj_step:
                        mujoco.mj_step1(model, data)
                    parts = self.parts_by_contacts()
                    # Contacts of shorter steps are stiffer, and are found anew.
                    step = mujoco.mj_step if parts > 1 else mujoco.mj_step2
                if parts > 1:
                    options.timestep = whole_s / parts
                for _ in range(parts):
                    step(model, data)
                    step = mujoco.mj_step
                    for act in after:
                        act()
                if parts > 1:
                    options.timestep = whole_s
            if self.samples.passed(until - done):
                self.samples.take(self.observer.sample(data))
            done = until
        return self.samples.told()

    def _after_step(self) -> list[Callable[[], None]]:
        """Return what is to be called after each physics step."""
        first = [] if self.sliding is None else [self._slide]
        return [*first, self.contacts.on_step, *self.on_step]

    def _slide(self) -> None:
        sliding = self.sliding
        if sliding is not None and sliding.near and sliding.slide():
            self.displace_grasps(self._displaced)
