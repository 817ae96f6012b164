"""The physics of many worlds on a GPU, by MuJoCo Warp: a command cycle is one captured graph.

Single precision. Nothing is to touch: a world in which two shapes are not seen to be apart is
named, as is one that is no longer valid, and what they do from then on is not to be used. All else
is as in :class:`dualbend.scene.simulation.Simulation`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from dualbend.batch.gpu.cycle import Cycle
from dualbend.errors import InputError
from dualbend.run.cell import RobotCell
from dualbend.scenario.scenario import Scenario
from dualbend.types import Mask, Vector

FAULTS = ("positions", "speeds", "accelerations", "set-points", "rows of constraints")
"""What may be wrong with a world: not finite, or beyond MuJoCo's limit; too many of them."""

_PATIENCE_S = 5.0


class WarpPhysics:
    """The physics of n cells of one structure on a device, from their present start on.

    Parameters
    ----------
    cells
        At rest, put there by :meth:`dualbend.run.cell.RobotCell.reset`; one may stand for many
        worlds that are alike.
    device
        As Warp names it: "cuda", "cuda:1", "cpu".
    on_note
        Called with what the user should know while waiting.

    Attributes
    ----------
    data : fields of an MjData with a leading axis of worlds (n, ...), as a loop reads them after
        ``mj_step1``; what no loop reads is NaN
    fault : (n,) bits of :data:`FAULTS`; a world that has one is put back at rest in its start
    touching : (n,) shapes that must not may have touched

    Raises InputError where there is no such device, or MuJoCo Warp cannot simulate the cells.
    """

    def __init__(
        self,
        cells: Sequence[RobotCell],
        device: str = "cuda",
        on_note: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._device, self._on_note = find_device(device), on_note
        for cell in cells:
            _refuse(cell.scenario)
        self._cells, simulation = cells, cells[0].simulation
        model, n = simulation.model, len(cells)
        self.steps = simulation.steps
        self._positions = np.array([cell.positions for cell in cells])
        self._drives = np.array([cell.home for cell in cells])
        robots = [cell.scenario.imperfections.robot for cell in cells]
        stiction = np.array([(r.stiction_excess, r.stribeck_speed_rad_per_s) for r in robots])
        models = [cell.compiled for cell in cells]
        self._places = np.array([each.site_pos for each in models])
        self._quats = np.array([each.site_quat for each in models])
        self._displaced = False
        with wp.ScopedDevice(self._device):
            self._cycle = Cycle(
                simulation,
                models,
                stiction if stiction[:, 0].any() else None,
            )
        shapes = {
            "qpos": (model.nq,),
            "qvel": (model.nv,),
            "qfrc_actuator": (model.nv,),
            "site_xpos": (model.nsite, 3),
            "site_xmat": (model.nsite, 9),
            "xpos": (model.nbody, 3),
        }
        whole = {name: np.full((n, *shape), np.nan) for name, shape in shapes.items()}
        self.data = SimpleNamespace(**whole)
        self._flat = {name: array.reshape(n, -1) for name, array in whole.items()}
        self.fault, self.touching = np.zeros(n, dtype=np.int32), np.zeros(n, dtype=np.bool_)
        self._graph: Any = None
        self._refresh: Any = None

    def start(self) -> None:
        """Put all worlds at rest in their starts."""
        cycle = self._cycle
        with wp.ScopedDevice(self._device):
            if self._graph is None:
                with self._told_if_slow():
                    cycle.reset(self._positions, self._drives)
                    cycle.run()
                    self._graph, self._refresh = map(captured, (cycle.run, cycle.refresh))
            cycle.reset(self._positions, self._drives)
            self._read()

    def displace(self, world: int, errors: Vector) -> None:
        """Let a world's sheet edges lie off their grippers, before a cycle is observed.

        As :meth:`dualbend.scene.simulation.Simulation.displace_grasps` has it.
        """
        simulation = self._cells[world].simulation
        simulation.displace_grasps(errors)
        self.place_sites(world, simulation.model.site_pos, simulation.model.site_quat)

    def place_sites(self, worlds: int | slice, places: Vector, quats: Vector) -> None:
        """Put the sites of worlds elsewhere in their bodies; :meth:`observe` takes it over."""
        self._places[worlds], self._quats[worlds] = places, quats
        self._displaced = True

    def observe(self) -> SimpleNamespace:
        """Return the data, up to date; call :meth:`advance` next."""
        if self._displaced:
            with wp.ScopedDevice(self._device):
                self._cycle.place_sites(self._places, self._quats)
                wp.capture_launch(self._refresh)
                self._read()
            self._displaced = False
        return self.data

    def limit_torques(self, ranges: Vector) -> None:
        """Say between what the joints' torques are limited, (n, joints, 2) [N m]."""
        with wp.ScopedDevice(self._device):
            self._cycle.limit_torques(ranges)

    def advance(self, setpoints: Vector, feed_forward: Vector | None = None) -> None:
        """Run one command cycle on set-points (n, steps, joints) [rad], one row a physics step.

        ``feed_forward`` (n, joints): torques that the drives add [N m]; None: the Coriolis torques
        of these arms, and any weight that they do not compensate by themselves.
        """
        given = None if feed_forward is None else feed_forward * self._cycle.compliance
        with wp.ScopedDevice(self._device):
            self._cycle.load(setpoints, given)
            wp.capture_launch(self._graph)
            self._read()

    def sample(self, step: int) -> tuple[Vector, Vector]:
        """Return what the wrist sensors had after a step of the last cycle, 0 at its start.

        The wrench on the arms (n, 2, 6) [N, N m], and the axes (n, 2, 3, 3) that take it to the
        world.
        """
        taken = self._cycle.samples.read(step)
        # MuJoCo tells what the arm exerts on the tool: the wrench on the arm is its opposite.
        return (
            -taken["sensordata"].reshape(-1, 2, 6),
            taken["site_xmat"].reshape(-1, 2, 3, 3),
        )

    @property
    def device_name(self) -> str:
        """The device as its maker calls it."""
        return str(self._device.name)

    @property
    def failed(self) -> Mask:
        """Worlds (n,) that are not to be used any more."""
        return np.asarray(self.touching | (self.fault != 0))

    def _read(self) -> None:
        seen = self._cycle.seen
        for name, values in seen.read(0).items():
            self._flat[name][:, seen.columns[name]] = values
        self.fault = self._cycle.fault.numpy().copy()
        self.touching = self._cycle.touching.numpy() != 0

    @contextmanager
    def _told_if_slow(self) -> Iterator[None]:
        where = wp.config.kernel_cache_dir
        note = f"compiling for {self._device.alias}: minutes, once; the kernels are kept in {where}"
        timer = threading.Timer(_PATIENCE_S, self._on_note, [note])
        timer.start()
        try:
            yield
        finally:
            timer.cancel()


def _refuse(scenario: Scenario) -> None:
    """Raise InputError where a cell does what only a simulation by itself can."""
    if scenario.task.workplace is not None:
        raise InputError(f"scenario {scenario.name!r}: its sheet is to touch things; use the CPU")
    if scenario.grasp.friction is not None:
        raise InputError("grasp.friction: a sheet that may slide is simulated on the CPU alone")


def captured(launch: Callable[[], None]) -> object:
    """Return a graph of what a function launches on the present device."""
    with wp.ScopedCapture() as capture:
        launch()
    return capture.graph


def find_device(name: str) -> wp.Device:
    """Return a device by Warp's name; InputError where there is none of it."""
    there = {device.alias: device for device in wp.get_devices()}
    if wp.is_cuda_available():
        there["cuda"] = wp.get_cuda_device()
    if name not in there:
        raise InputError(f"device {name!r}: there is no such device here, only {', '.join(there)}")
    return there[name]
