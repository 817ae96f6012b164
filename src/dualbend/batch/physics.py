"""The physics of n cells of one structure, on all cores: :class:`mujoco.batch.Batch`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, Self

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from dualbend.imperfection.robot import Stribeck
from dualbend.run.cell import RobotCell
from dualbend.scene.mjcf import about_zyx
from dualbend.scene.observation import Drives, Observation, Observer, SensorSample, Source
from dualbend.scene.posed import differing
from dualbend.scene.simulation import Simulation
from dualbend.types import Mask, Vector

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Start(NamedTuple):
    """Where a cell has begun: MuJoCo's state and the oldest sample, wrench and axes."""

    state: Vector
    sample: tuple[Vector, Vector]

    @classmethod
    def of(cls, simulation: Simulation) -> Self:
        """Return where a simulation is."""
        state = np.empty(mujoco.mj_stateSize(simulation.model, _STATE))
        mujoco.mj_getState(simulation.model, simulation.data, state, _STATE)
        return cls(state, simulation.samples.taken)


class Physics(Protocol):
    """The physics of n cells, one command cycle after the other; :class:`CpuPhysics` says how.

    Attributes
    ----------
    fed_forward : torques (n, joints) [N m] that the drives add, of joint angles and speeds; None:
        what they would in :class:`dualbend.scene.simulation.Simulation`
    """

    observer: Observer
    data: Source
    fed_forward: Callable[[Vector, Vector], Vector] | None

    @property
    def failed(self) -> Mask:
        """Worlds (n,) that are no longer valid, or in which anything has touched."""

    @property
    def time_s(self) -> Vector:
        """Time of each world (n,) [s]."""

    def start(self, starts: Sequence[Start]) -> SensorSample:
        """Begin where the cells began; return the first samples."""

    def observe(self, active: Mask) -> Observation:
        """Return what is observed at the start of a cycle, of the active worlds (n,)."""

    def displace(self, worlds: NDArray[np.int_], errors: Vector) -> None:
        """Let the sheet edges of worlds lie off their grippers, (k, 2, 6), before they are seen."""

    def advance(self, setpoints: Vector, active: Mask) -> SensorSample:
        """Run one command cycle on set-points (n, steps, joints) [rad]."""


class CpuPhysics:
    """The physics of cells that are at their start; each world's numbers are its own.

    ``data``: the fields of an MjData, each with the axis of worlds.
    """

    def __init__(self, cells: Sequence[RobotCell], threads: int) -> None:
        first = cells[0].simulation
        self.observer, self._samples = first.observer, first.samples
        self._steps, self._dofs, self._pads = first.steps, first.dofs, first.pads
        self.data = Batch(first.model, len(cells), threads)
        models = [cell.compiled for cell in cells]
        for name in differing(models):
            field = self.data.expand(name)
            for row, model in zip(field, models, strict=True):
                row[...] = getattr(model, name)[: len(row)] if row.ndim else getattr(model, name)
        for name in ("site_xpos", "site_xmat", "xpos", "sensordata", "qfrc_actuator"):
            self.data.bind(name)
        for name in ("qfrc_bias", "qfrc_gravcomp"):
            self.data.bind(name)
        self._ctrl, self._touching = self.data.bind("ctrl"), self.data.bind("ncon")
        joints = len(self._dofs)
        self._stiffness = -np.array([model.actuator_biasprm[:joints, 1] for model in models])
        self._drives = Drives(first.torque_limit, self._stiffness, first.model.opt.timestep)
        self._limits = self.data.expand("jnt_actfrcrange")
        self._limited = first.joint_ids
        self._friction: Stribeck | None = None
        laws = [cell.friction_law for cell in cells if cell.friction_law is not None]
        if laws:
            self._friction = Stribeck.stacked(laws, self.data.expand("dof_frictionloss"))
            self._speeds = self.data.bind("qvel")[:, self._friction.span]
        self.fed_forward: Callable[[Vector, Vector], Vector] | None = None
        self._failed: Mask = np.zeros(len(cells), dtype=np.bool_)

    def start(self, starts: Sequence[Start]) -> SensorSample:
        """As :class:`Physics` has it."""
        states = self.data.state
        states[:] = [start.state for start in starts]
        # The first observation tells the torques of the start, which no step has computed yet.
        begun = states.copy()
        self.data.forward()
        self._note_torque()
        states[:] = begun
        wrench, rotation = (np.stack([start.sample[i] for start in starts]) for i in range(2))
        return self._samples.reset((wrench, rotation))

    @property
    def failed(self) -> Mask:
        """As :class:`Physics` has it."""
        return self._failed

    @property
    def time_s(self) -> Vector:
        """As :class:`Physics` has it."""
        return np.asarray(self.data.bind("time"))

    def observe(self, active: Mask) -> Observation:
        """As :meth:`dualbend.scene.simulation.Simulation.observe`, of the active worlds."""
        self._guarded(lambda ids: self.data.forward(ids, mujoco.mjtStage.mjSTAGE_VEL), active)
        return self.observer.observation(
            self.data, self.observer.pad_loads(self.data), self._torque
        )

    def displace(self, worlds: NDArray[np.int_], errors: Vector) -> None:
        """As :meth:`dualbend.scene.simulation.Simulation.displace_grasps` does it in one."""
        at, half = np.ix_(worlds, self._pads), errors[..., 3:] / 2
        self.data.expand("site_pos")[at] = errors[..., :3]
        turns = (np.moveaxis(part, -1, 0) for part in (np.cos(half), np.sin(half)))
        self.data.expand("site_quat")[at] = np.stack(about_zyx(*turns), axis=-1)

    def advance(self, setpoints: Vector, active: Mask) -> SensorSample:
        """Run one command cycle on set-points (n, steps, joints) [rad], in the active worlds."""
        data = self.data
        if self.fed_forward is None:
            torque = data.qfrc_bias[:, self._dofs] - data.qfrc_gravcomp[:, self._dofs]
        else:
            torque = self.fed_forward(self.q, data.qvel[:, self._dofs])
        control = np.repeat(data.ctrl[:, np.newaxis], self._steps, axis=1)
        feed_forward = (torque / self._stiffness)[:, np.newaxis]
        control[..., : setpoints.shape[-1]] = setpoints + feed_forward
        self._limits[:, self._limited] = self._drives.range(data.qvel[:, self._dofs])
        done = 0
        while done < self._steps:
            left = self._steps - done
            steps = 1 if self._friction is not None else min(self._samples.to_next, left)
            if self._friction is not None:
                self._step(control[:, done], active & ~self._failed)
            else:
                self._roll(control[:, done : done + steps], active & ~self._failed)
            done += steps
            if self._friction is not None:
                self._friction.on_step(self._speeds)
            if self._samples.passed(steps):
                self._samples.take(self.observer.sample(data))
        # Positions and speeds do not tell what the last step's torques were.
        self._note_torque()
        self._failed |= data.warning.reshape(len(self._failed), -1).any(axis=-1)
        return self._samples.told()

    def _note_torque(self) -> None:
        told, speed = self.data.qfrc_actuator[:, self._dofs], self.data.qvel[:, self._dofs]
        self._torque = self._drives.torque(told, speed)

    @property
    def q(self) -> Vector:
        """Joint angles (n, joints) [rad]."""
        return self.observer.joint_angles(self.data)

    def _step(self, control: Vector, active: Mask) -> None:
        self._ctrl[:] = control
        self._guarded(self.data.step, active)
        self._failed |= self._touching > 0

    def _roll(self, control: Vector, active: Mask) -> None:
        whole = bool(active.all())

        def roll(ids: NDArray[np.int_] | None) -> None:
            found = self.data.rollout(
                control.shape[1], control if whole else control[active], record=("ncon",), ids=ids
            )
            touched = found["ncon"].reshape(-1, control.shape[1]).any(axis=-1)
            self._failed[slice(None) if ids is None else ids] |= touched

        self._guarded(roll, active)

    def _guarded(self, call: Callable[[NDArray[np.int_] | None], None], active: Mask) -> None:
        """Call with the active worlds; those in which MuJoCo raises an error fail alone."""
        ids = None if active.all() else np.flatnonzero(active)
        if ids is not None and not ids.size:
            return
        try:
            call(ids)
        except SimulationError as error:
            self._failed[error.ids] = True
