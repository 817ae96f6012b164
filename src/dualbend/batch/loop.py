"""The bending loop of n worlds, cycle by cycle; a world that ends before its motion does is left.

What a world does is what :class:`dualbend.task.bending.run.BendingRun` does, by the same objects
with one more axis, to the bit. Whatever would end it early, a protective stop, a contact, a
simulation that is not valid, takes it out of the batch: it is run again alone, and says what it is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualbend.batch.controllers import ActiveOnly, joined, one_by_one
from dualbend.batch.memory import give_back
from dualbend.batch.physics import CpuPhysics, Physics, Start
from dualbend.batch.trace import TraceFile, room
from dualbend.control.controller import IN_PLANE, ControlledPath, Observation
from dualbend.control.servo import FrictionEstimate, JointServo
from dualbend.control.wrist import WristSensors
from dualbend.imperfection.link import CommandLink
from dualbend.run.cell import RobotCell, make_guard, make_integral, make_response, make_sensor_guard
from dualbend.run.planar import has_snapped
from dualbend.run.record import RunRecord
from dualbend.scene.believed import GRIPS, SITES, BelievedArms, Measured
from dualbend.scene.correction import PoseCorrection
from dualbend.scene.observation import PLANAR
from dualbend.scene.posed import PosedWorlds
from dualbend.scene.warnings import warnings_counted_only
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Mask, PlanarPose, Vector

_TIDIED = 8
"""Worlds that begin before memory is given back, at first."""

_NO_AGES: NDArray[np.int_] = np.zeros(0, dtype=np.int_)


class BatchLoop:
    """Closed loops of n bending runs of one structure, see :func:`dualbend.batch.group.structure`.

    ``physics`` makes that of their cells; None: on the CPU, on so many ``threads``.

    Attributes
    ----------
    active, left : (n,) worlds that go on; those that ended before their motion did
    cycles : (n,) of each world's motion
    trace : of all worlds
    """

    def __init__(
        self,
        runs: Sequence[BendingRun],
        threads: int = 1,
        physics: Callable[[Sequence[RobotCell]], Physics] | None = None,
    ) -> None:
        starts = []
        due = _TIDIED
        for i, run in enumerate(runs, 1):
            run.begin()
            starts.append(Start.of(run.cell.simulation))
            run.cell.let_go()  # before the next begins: n worlds would need 0.7 MB each
            del run.trace  # it has rows of the batch's
            if i >= due:  # seldom where there are many: it takes the longer
                give_back()
                due += max(_TIDIED, i // 4)
        self._runs, first, n = runs, runs[0], len(runs)
        scenario, cells = first.scenario, [run.cell for run in runs]
        shape, robots = (n,), [cell.robots for cell in cells]
        self._physics: Physics
        self._physics = CpuPhysics(cells, threads) if physics is None else physics(cells)
        self._sample = self._physics.start(starts)
        self._sensors = WristSensors.stacked([run.sensors for run in runs])
        self._controller = joined([run.path.controller for run in runs])
        self._one_by_one = one_by_one(self._controller)
        self.active: Mask = np.ones(n, dtype=np.bool_)
        only = ActiveOnly(self._controller, self.active)
        self._path = ControlledPath.stacked([run.path for run in runs], only)
        links = [run.link for run in runs if run.link is not None]
        self._link = CommandLink.stacked(links) if links else None
        self._guard = make_guard(scenario, first.cell, shape)
        self._sensor_guard = make_sensor_guard(scenario, first.sensors, shape)
        self._servo = JointServo.stacked([cell.servo for cell in cells])
        self._free, self._friction = (
            first.free,
            FrictionEstimate.stacked([c.friction for c in cells]),
        )
        self._integral = make_integral(scenario, robots[0], shape)
        self._response = make_response(scenario, first.cell.arms, shape)
        self._q = np.stack([cell.home for cell in cells])
        self._response.reset(self._q)
        self._near = PoseCorrection(robots[0], PosedWorlds(robots, GRIPS, threads))
        errors = scenario.imperfections.robot
        believed = BelievedArms(PosedWorlds(robots, SITES, threads))
        self._measured = Measured(
            self._physics.observer, self._physics.data, believed if errors.displaces else None
        )
        if errors.weighs_wrong:
            self._physics.fed_forward = believed.coriolis
        self._motion(runs)
        cycles = int(self.cycles.max())
        self.trace = first.recorder(min(cycles, room(n)), shape)
        self._file = TraceFile(self.trace, cycles)
        self.left: Mask = np.zeros(n, dtype=np.bool_)

    def _motion(self, runs: Sequence[BendingRun]) -> None:
        """Hold what each world is to do (cycles, n, ...), in its last cycle again after its end."""
        self.cycles = np.array([run.motion.cycles for run in runs])
        longest = int(self.cycles.max())

        def table(rows: Iterable[NDArray[Any]]) -> NDArray[Any]:
            more = [(longest - len(row), row) for row in rows]
            whole = [np.concatenate((row, row[-1:].repeat(k, axis=0))) for k, row in more]
            return np.stack(whole, axis=1)

        self._poses = table(run.nominal_poses for run in runs)
        self._drawn = np.stack(
            (self._poses[..., 2], -self._poses[..., 0], self._poses[..., 1]), axis=-1
        )
        self._phases = table(run.motion.phase for run in runs)
        self._grip_errors = [run.grip_errors for run in runs if run.grip_errors is not None]
        self._grips_change = table(run.grips_change for run in runs) if self._grip_errors else None
        self._names = np.array(runs[0].phases)

    def run(self) -> Iterator[tuple[int, RunRecord]]:
        """Run all to their ends; yield each world that came to it, and its record, as it does."""
        started = time.perf_counter()
        with warnings_counted_only(), closing(self._file):
            for n in range(int(self.cycles.max()) + 1):
                ended = np.flatnonzero(self.active & (self.cycles == n))
                self.active[ended] = False
                for world in ended.tolist():
                    yield world, self.record(world, (time.perf_counter() - started) / len(ended))
                if not self.active.any():
                    return
                self.look()
                self.act()

    def look(self) -> Observation:
        """Begin a command cycle: return what the controllers observe, of the active worlds.

        ``aside`` is theirs where they are asked one by one; the others do not read it.
        """
        self._began = time.perf_counter()
        physics, trace = self._physics, self.trace
        n = trace.rows
        self._displace(n)
        seen = physics.observe(self.active)
        pose = self._poses[n]
        period_s = self._runs[0].scenario.period_s
        if physics.fed_forward is not None:
            physics.fed_forward(seen.q, seen.speed)  # asked first: the frames come with it
        bends = physics.observer.sheet.bending_angles(physics.data)
        drawn = self._drawn[n]
        self._file.make_room()
        trace.observe(n * period_s, self._phases[n], drawn, seen, physics.data.qpos, bends)
        reference = self._response.position
        self._leave_if(self._guard.outside(seen.q, seen.speed, seen.torque, reference))
        if not self._free:
            self._leave(has_snapped(seen.sag, pose[:, 2]))
        if self._grip_errors:
            turns = physics.observer.roll_and_yaw(physics.data)
            trace.record_task(turns.reshape(len(self._runs), -1))
        axes = self._measured.sensor_axes(self._sample.rotation, seen)
        reading = self._sensors.read(self._sample.wrench, axes, new=self._sample.new)
        trace.record_reading(reading)
        self._leave_if(self._sensor_guard.outside(reading.clipped, reading.fresh))
        self._seen, self._reference = seen, reference
        self._observed = Observation.of(
            reading,
            time_s=n * period_s,
            phase=self._names[self._phases[n]],
            joints_rad=seen.q,
            measured=PlanarPose(self._measured.grips(seen)[..., PLANAR]),
            nominal=PlanarPose(np.repeat(pose[:, np.newaxis], len(SIDES), axis=1)),
            aside=IN_PLANE if self._one_by_one is None else self._measured.aside(seen),
        )
        return self._observed

    def act(self, action: Vector | None = None) -> None:
        """End the cycle: command what the controllers answer, or deviations (n, 2, 6) instead."""
        physics = self._physics
        command = self._path.command(self._observed, action)
        if self._one_by_one is not None:
            self._leave(self._one_by_one.failed)
        solution = self._near.solve(command.pose.coordinates, command.aside, self._q)
        self._leave(~np.asarray(solution.reached))
        self._q = solution.q
        sent, ages = self._q, _NO_AGES
        if self._link is not None:
            sent, ages = self._link.forward(self._q), self._link.age
            self._leave_if(self._link.starved[np.newaxis])
        error = self._reference - self._seen.q
        offset = self._integral.update(error)
        if self._free:
            self._friction.update(error + offset, self._response.speed)
        now = self._response.update(sent)
        setpoints = self._servo.setpoint(
            now.position, now.velocity, now.acceleration, self._friction.ratio[:, np.newaxis]
        )
        setpoints += offset[:, np.newaxis]
        self._sample = physics.advance(setpoints, self.active)
        self._leave(physics.failed)
        wall_s = (time.perf_counter() - self._began) / len(self._runs)
        self.trace.record_control(self._observed, command, solution, wall_s, ages)

    def _leave(self, worlds: Mask) -> None:
        """Leave worlds to be run alone."""
        if np.count_nonzero(worlds):
            self.left |= worlds & self.active
            self.active &= ~worlds  # in place: others hold it

    def _leave_if(self, met: NDArray[Any]) -> None:
        """Leave worlds in which anything of (kinds, n, parts) is met."""
        if np.count_nonzero(met):
            self._leave(np.any(met, axis=(0, -1)))

    def _displace(self, n: int) -> None:
        """Apply the misalignment of the grips."""
        if self._grips_change is None:
            return
        worlds = np.flatnonzero(self.active & self._grips_change[n])
        if worlds.size:
            errors = np.stack([self._grip_errors[world][n] for world in worlds])
            self._physics.displace(worlds, errors)

    def record(self, world: int, wall_s: float = 0.0) -> RunRecord:
        """Return what a world's run has left, which came to its end."""
        run = self._runs[world]
        run.trace = run.recorder(int(self.cycles[world]))
        self._file.read(world, run.trace)
        run.cell.simulation.data.time = self._physics.time_s[world]
        run.cell.friction.ratio[:] = self._friction.ratio[world]
        record = run.record("completed", wall_time_s=wall_s)
        run.cell.let_go()
        del run.trace  # the record has it, as long as it is wanted
        return record
