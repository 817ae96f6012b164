"""A run in which both arms follow a planar motion, mirrored, with the sheet between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dualbend.control.controller import Controller
from dualbend.errors import InputError
from dualbend.run.arm_load import refuse_overload
from dualbend.run.arms import shown_placements, with_placements
from dualbend.run.cell import RobotCell
from dualbend.run.known_sheet import make_compliance
from dualbend.run.loop import Asking, Run
from dualbend.run.record import task_of
from dualbend.scenario.motion import NominalMotion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.ik import grip_targets
from dualbend.scene.simulation import Observation, SensorSample
from dualbend.scene.warnings import SimulationFailed
from dualbend.types import SIDES, PlanarPose, Vector

_SNAPPED_SAG_M, _SNAPPED_FROM_RAD = -1e-3, 0.1
"""A sheet bent this far sags by centimetres: a middle this much above its ends is another shape."""

_CHECKED_POSES = 40
"""Poses of the motion that are solved before the run: one in 25 mrad on the shipped paths."""


class PlanarRun(Run):
    """Both arms follow a nominal motion in the bending plane, corrected by the compliance.

    Parameters
    ----------
    scenario
        Says everything about the cell and the controller.
    motion
        Phase and nominal pose of the grips at every command cycle.
    compliance
        Makes what takes the place of the scenario's ``[compliance]``, again for each run: it may
        have a memory. The record and its summary name it.

    Raises
    ------
    InputError
        A pose of the motion is out of reach, or its joint speeds are above the arm's.
    """

    def __init__(
        self,
        scenario: Scenario,
        motion: NominalMotion,
        compliance: Callable[[Scenario], Controller] = make_compliance,
    ) -> None:
        self.compliance, self.motion = compliance, motion
        self.phases = task_of(scenario).phases
        self.scenario = scenario = with_placements(scenario)
        self._z_m = scenario.cell.sheet_height_m + motion.rise_m
        try:
            cell = RobotCell(scenario, self.nominal_pose(0))
        except InputError as error:
            raise self._out_of_reach(0, error) from error
        super().__init__(scenario, cell)
        self._check_path()

    @property
    def cycles(self) -> int:
        """Number of command cycles."""
        return self.motion.cycles

    def start(self) -> SensorSample:
        """Put the cell at rest in its start, the sheet in its zero-moment shape."""
        return self.cell.reset()

    def cycle(self) -> Asking[bool]:
        """Run one command cycle of the motion; False at its end."""
        n = self.trace.rows
        if n == self.motion.cycles:
            return False
        x, z, alpha = self.nominal_pose(n).tolist()
        seen = self.observe(int(self.motion.phase[n]), np.array([alpha, -x, z]))
        refuse_snapped(seen.sag, alpha)
        self.on_observed(n, seen)
        reading = self.read(seen)
        nominal = PlanarPose(np.array([[x, z, alpha]] * len(SIDES)))
        phase = self.phases[self.motion.phase[n]]
        observed, command = yield from self.control(seen, phase, nominal, reading)
        self.send(grip_targets(command.pose.coordinates, command.aside), observed, command)
        return True

    def on_observed(self, cycle: int, seen: Observation) -> None:
        """Do what a task does besides in a cycle, before it is controlled."""

    def nominal_pose(self, cycle: int) -> Vector:
        """Return x, z [m] and α [rad] of both grips in a cycle, each in its bending frame."""
        motion = self.motion
        return np.array([-motion.half_distance_m[cycle], self._z_m[cycle], motion.alpha_rad[cycle]])

    def _check_path(self) -> None:
        """Follow the nominal motion with the IK alone and refuse what the arms cannot do."""
        # What is held before the motion begins is its first pose.
        first = int(np.count_nonzero(self.motion.phase == 0))
        cycles = np.linspace(first, self.motion.cycles - 1, _CHECKED_POSES).astype(int)
        q, before, poses = self.cell.home, -1, list[Vector]()
        for cycle in np.unique(cycles).tolist():
            try:
                there = self.cell.reach(self.nominal_pose(cycle), q)
            except InputError as error:
                raise self._out_of_reach(cycle, error) from error
            if before >= 0:
                self._refuse_speed(np.abs(there - q) / ((cycle - before) * self.scenario.period_s))
            q, before = there, cycle
            poses.append(there)
        self.checked_poses = np.array(poses)
        refuse_overload(self.scenario, self.cell.arms, self.cell.ik.model, self.checked_poses)

    def _out_of_reach(self, cycle: int, error: InputError) -> InputError:
        return InputError(
            f"scenario {self.scenario.name!r}: path at {self.motion.alpha_rad[cycle]:.3f} rad: "
            f"{error}; look at {shown_placements(self.scenario)}, "
            f"cell.sheet_height_m = {self.scenario.cell.sheet_height_m}"
        )

    def _refuse_speed(self, speed: Vector) -> None:
        joints = self.cell.simulation.joints
        limit = self.scenario.guard.speed_fraction * self.cell.arms.speed_limit
        i = int(np.argmax(speed / limit))
        if speed[i] > limit[i]:
            slower = self.scenario.motion.speed_rad_per_s * limit[i] / speed[i]
            slides = self.cell.arms.slides[joints[i]]
            moves, unit = ("move", "m/s") if slides else ("turn", "rad/s")
            raise InputError(
                f"motion.speed_rad_per_s = {self.scenario.motion.speed_rad_per_s}: "
                f"{joints[i]} would {moves} at {speed[i]:.2f} {unit}, above {limit[i]:.2f}; "
                f"at most {slower:.2f} rad/s of bending here"
            )


def refuse_snapped(sag_m: float, alpha_rad: float) -> None:
    """Raise SimulationFailed where the sheet's middle has gone to the other side of its ends."""
    if alpha_rad > _SNAPPED_FROM_RAD and sag_m < _SNAPPED_SAG_M:
        raise SimulationFailed(
            "the sheet snapped into another buckled shape: "
            f"its middle is {-1e3 * sag_m:.1f} mm above its ends"
        )
