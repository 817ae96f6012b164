"""How fast the physics of many worlds is on a device, and how far single precision leads it away.

What the drives of a run were sent, recorded with MuJoCo, every world is sent: all do what it did.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from dualbend.batch.gpu.cycle import sampled
from dualbend.batch.gpu.physics import WarpPhysics, find_device
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario
from dualbend.types import Vector

FLAT_RAD = 0.2
"""Up to this end slope of a sheet its tension, not its bending, is most of the force."""


def benchmark_device(
    scenario: Scenario, worlds: int, device: str, on_note: Callable[[str], None] = lambda _: None
) -> dict[str, str | float]:
    """Replay a run in equal worlds; return rates, and deviations of forces [N], moments [N m].

    ``ready_s``: compiling and capturing; ``steps_per_s``: physics steps of all worlds over wall
    time, upload and reading included. Deviations are from MuJoCo, of what the wrist sensors have at
    the ends of cycles, in any world: largest and rms, of the sheet flat (end slopes up to 0.2 rad)
    and bent; of the bent one's largest moment, relative. ``spread``: of forces between worlds.
    Raises InputError where there is no such device, or MuJoCo Warp cannot simulate the cell.
    """
    find_device(device)
    played = Played(make_run(scenario))
    run = make_run(scenario)
    run.begin()
    started = time.perf_counter()
    physics = WarpPhysics([run.cell] * worlds, device, on_note)
    physics.start()
    ready = time.perf_counter()
    none, spread, found = np.zeros((worlds, played.drives.shape[-1])), 0.0, []
    for cycle, drives in enumerate(played.drives):
        if cycle in played.displaced:
            physics.place_sites(slice(None), *played.displaced[cycle])
        physics.observe()
        physics.advance(np.broadcast_to(drives, (worlds, *drives.shape)), none)
        wrench, _ = physics.sample(physics.steps)
        spread = max(spread, float(np.ptp(wrench[..., :3], axis=0).max()))
        far = np.abs(wrench - played.wrench[cycle]).reshape(worlds, -1).max(axis=1).argmax()
        found.append(wrench[far])
    wall_s = time.perf_counter() - ready
    return {
        "scenario": scenario.name,
        "device": physics.device_name,
        "worlds": worlds,
        "failed": int(physics.failed.sum()),
        "ready_s": ready - started,
        "steps_per_s": worlds * physics.steps * len(found) / wall_s,
        "us_per_world_and_cycle": 1e6 * wall_s / (worlds * len(found)),
        "force_spread": spread,
        **deviations(np.array(found), played),
    }


class Played:
    """A run that was played to its end with MuJoCo, in whole cycles.

    Attributes
    ----------
    drives : (cycles, steps, joints) what they were sent [rad], feed-forward included
    displaced : places and quaternions of the sites from a cycle on, where they change
    wrench : (cycles, 2, 6) at the sensors, at the ends of the cycles [N, N m]
    slopes : (cycles,) nominal end slopes [rad]
    """

    def __init__(self, run: Run) -> None:
        simulation = run.cell.simulation
        self._model, self._data, self._steps = simulation.model, simulation.data, simulation.steps
        self._sensors, joints = sampled(simulation.model)["sensordata"], len(simulation.dofs)
        self._rows: list[Vector] = []
        self._ends: list[Vector] = []
        self._sites = b""
        self.displaced: dict[int, tuple[Vector, Vector]] = {}
        simulation.on_step.append(self._record)
        slopes = run.run().trace["nominal_alpha"]
        cycles = len(self._ends)
        self.drives = np.array(self._rows)[: cycles * self._steps, :joints]
        self.drives = self.drives.reshape(cycles, self._steps, joints)
        self.wrench, self.slopes = np.array(self._ends).reshape(cycles, 2, 6), slopes[:cycles]

    def _record(self) -> None:
        model, data = self._model, self._data
        self._rows.append(data.ctrl.copy())
        if len(self._rows) % self._steps:
            return
        sites = model.site_pos.copy(), model.site_quat.copy()
        if (now := sites[0].tobytes() + sites[1].tobytes()) != self._sites:
            self.displaced[len(self._ends)], self._sites = sites, now
        self._ends.append(-data.sensordata[self._sensors])


def deviations(found: Vector, played: Played) -> dict[str, float]:
    """Return how far wrenches (cycles, 2, 6) are from those of the run, flat and bent."""
    deviation, bent = np.abs(found - played.wrench), played.slopes > FLAT_RAD
    told = {}
    for state, cycles in (("flat", ~bent), ("bent", bent)):
        for kind, part in (("force", slice(0, 3)), ("moment", slice(3, 6))):
            values = deviation[cycles][..., part]
            if values.size:
                told[f"{state}_{kind}_deviation"] = float(values.max())
                told[f"{state}_{kind}_deviation_rms"] = float(np.sqrt(np.mean(values**2)))
    if bent.any():
        here, there = (np.abs(each[bent][..., 4]).max() for each in (found, played.wrench))
        told["peak_moment_deviation"] = float(here / there - 1.0)
    return told
