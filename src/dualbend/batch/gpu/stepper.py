"""The physics of a batch of runs on a device, as :class:`dualbend.batch.loop.BatchLoop` asks it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dualbend.batch.gpu.physics import WarpPhysics
from dualbend.batch.physics import Start
from dualbend.run.cell import RobotCell
from dualbend.scene.observation import Drives, Observation, SensorSample
from dualbend.types import Mask, Vector


class DevicePhysics:
    """What :class:`dualbend.batch.physics.CpuPhysics` does, in single precision on a device.

    ``device``, ``on_note`` as :class:`WarpPhysics` has them. All worlds are stepped; what the
    inactive ones do is not read.
    """

    def __init__(
        self,
        cells: Sequence[RobotCell],
        device: str,
        on_note: Callable[[str], None] = lambda _: None,
    ) -> None:
        simulation = cells[0].simulation
        self._warp = WarpPhysics(cells, device, on_note)
        self.observer, self._samples = simulation.observer, simulation.samples
        self._steps, self._dofs = simulation.steps, simulation.dofs
        self._step_s, self._done, self._worlds = simulation.model.opt.timestep, 0, len(cells)
        models = [cell.compiled for cell in cells]
        stiffness = -np.array([each.actuator_biasprm[: len(self._dofs), 1] for each in models])
        self._drives = Drives(simulation.torque_limit, stiffness, self._step_s)
        self.fed_forward: Callable[[Vector, Vector], Vector] | None = None
        self.data = self._warp.data

    def start(self, starts: Sequence[Start]) -> SensorSample:
        """Put all at rest in their starts; return the first samples."""
        del starts  # the cells know their positions, at rest
        self._warp.start()
        return self._samples.reset(self._warp.sample(0))

    @property
    def failed(self) -> Mask:
        """Worlds (n,) that are not to be used any more."""
        return self._warp.failed

    @property
    def time_s(self) -> Vector:
        """Time of each world (n,) [s]."""
        return np.full(self._worlds, self._done * self._step_s)

    def observe(self, active: Mask) -> Observation:
        """As :meth:`dualbend.batch.physics.CpuPhysics.observe`."""
        data = self._warp.observe()
        told, speed = (of[:, self._dofs] for of in (data.qfrc_actuator, data.qvel))
        load = self.observer.pad_loads(data)
        return self.observer.observation(data, load, self._drives.torque(told, speed))

    def displace(self, worlds: NDArray[np.int_], errors: Vector) -> None:
        """As :meth:`dualbend.batch.physics.CpuPhysics.displace`."""
        for world, own in zip(worlds.tolist(), errors, strict=True):
            self._warp.displace(world, own)

    def advance(self, setpoints: Vector, active: Mask) -> SensorSample:
        """As :meth:`dualbend.batch.physics.CpuPhysics.advance`."""
        torque = None
        if self.fed_forward is not None:
            q = self.observer.joint_angles(self.data)
            torque = self.fed_forward(q, self.data.qvel[:, self._dofs])
        self._warp.limit_torques(self._drives.range(self.data.qvel[:, self._dofs]))
        self._warp.advance(setpoints, torque)
        self._done += self._steps
        for step in range(1, self._steps + 1):
            if self._samples.passed(1):
                self._samples.take(self._warp.sample(step))
        return self._samples.told()
