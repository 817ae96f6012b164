"""A run in which both arms follow a planar motion, mirrored, with the sheet between them."""

from __future__ import annotations

import numpy as np

from dualbend.control.controller import Command
from dualbend.errors import InputError
from dualbend.run.arm_load import refuse_overload
from dualbend.run.arms import shown_placements, with_placements
from dualbend.run.cell import RobotCell
from dualbend.run.loop import Asking, Run
from dualbend.run.record import task_of
from dualbend.scenario.motion import NominalMotion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.believed import GRIPS
from dualbend.scene.correction import PoseCorrection
from dualbend.scene.ik import IKSolution, grip_targets
from dualbend.scene.observation import SensorSample
from dualbend.scene.posed import PosedArms
from dualbend.scene.setpoints import OutOfReachError, nominal_setpoints
from dualbend.scene.warnings import SimulationFailed
from dualbend.types import SIDES, Mask, PlanarPose, Reals, Vector

_SNAPPED_SAG_M, _SNAPPED_FROM_RAD = -1e-3, 0.1
"""A sheet bent this far sags by centimetres: a middle this much above its ends is another shape."""

_CHECKED_POSES = 40
"""Poses of the motion that are solved before the run: one in 25 mrad on the shipped paths."""


class PlanarRun(Run):
    """Both arms follow a nominal motion in the bending plane, corrected by the compliance.

    Attributes
    ----------
    nominal_poses : (cycles, 3) x, z [m], α [rad] of both grips in their bending frames
    nominal_q : (cycles, n) their joint angles [rad], by mink; None where it is to stay in the loop
    free : nothing is between the arms: they tell their friction

    Parameters
    ----------
    scenario
        Says everything about the cell and the controller.
    motion
        Phase and nominal pose of the grips at every command cycle.

    Raises
    ------
    InputError
        A pose of the motion is out of reach, or its joint speeds are above the arm's.
    """

    free = False

    def __init__(self, scenario: Scenario, motion: NominalMotion) -> None:
        self.motion = motion
        self.phases = task_of(scenario).phases
        self.scenario = scenario = with_placements(scenario)
        z_m = scenario.cell.sheet_height_m + motion.rise_m
        self.nominal_poses = np.column_stack((-motion.half_distance_m, z_m, motion.alpha_rad))
        self._both = np.repeat(self.nominal_poses[:, np.newaxis], len(SIDES), axis=1)
        self._drawn = np.column_stack((motion.alpha_rad, motion.half_distance_m, z_m))
        try:
            cell = RobotCell(scenario, self.nominal_poses[0])
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
        phase, nominal = int(self.motion.phase[n]), self._both[n].copy()
        self.on_cycle(n)
        seen = self.observe(phase, self._drawn[n])
        if not self.free:
            refuse_snapped(float(seen.sag), float(nominal[0, 2]))
        self.on_observed()
        reading = self.read(seen)
        observed, command = yield from self.control(
            seen, self.phases[phase], PlanarPose(nominal), reading
        )
        self.send(self._setpoint(command), observed, command, free=self.free)
        return True

    def _setpoint(self, command: Command) -> IKSolution:
        """Return the joint angles of a command: from the last ones, or by mink alone."""
        pose, aside = command.pose.coordinates, command.aside
        if self.nominal_q is not None:
            solution = self._near.solve(pose, aside, self._q)
            if solution.reached:
                return solution
        return self.solve(grip_targets(pose, aside))

    def on_cycle(self, cycle: int) -> None:
        """Do what a task does to the cell before a cycle, between two physics steps."""

    def on_observed(self) -> None:
        """Record what a task has besides of a cycle."""

    def _check_path(self) -> None:
        """Follow the nominal motion with the IK alone and refuse what the arms cannot do."""
        # What is held before the motion begins is its first pose.
        first = int(np.count_nonzero(self.motion.phase == 0))
        cycles = np.linspace(first, self.motion.cycles - 1, _CHECKED_POSES).astype(int)
        cycles = np.unique(cycles)
        self.nominal_q = self._nominal_setpoints()
        if self.nominal_q is None:
            self.checked_poses = self._reached(cycles.tolist())
        else:
            self.checked_poses = self.nominal_q[cycles]
        times_s = self.scenario.period_s * np.diff(cycles)
        for speed in np.abs(np.diff(self.checked_poses, axis=0)) / times_s[:, np.newaxis]:
            self._refuse_speed(speed)
        refuse_overload(self.scenario, self.cell.arms, self.cell.ik.model, self.checked_poses)

    def _nominal_setpoints(self) -> Vector | None:
        """Return the joint angles (cycles, n) of the motion; None where mink is to stay in it."""
        ik, period_s = self.cell.ik, self.scenario.period_s
        if not PoseCorrection.suits(ik.model):
            return None
        self._near = PoseCorrection(ik.model, PosedArms(ik.model, GRIPS))
        try:
            return nominal_setpoints(ik, self.nominal_poses, self.cell.home, period_s)
        except OutOfReachError as error:
            raise self._out_of_reach(error.cycle, error) from error

    def _reached(self, cycles: list[int]) -> Vector:
        """Return the joint angles (k, n) of some poses of the motion, one from the other."""
        q, found = self.cell.home, list[Vector]()
        for cycle in cycles:
            try:
                q = self.cell.reach(self.nominal_poses[cycle], q)
            except InputError as error:
                raise self._out_of_reach(cycle, error) from error
            found.append(q)
        return np.array(found)

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


def has_snapped(sag_m: Reals, alpha_rad: Reals) -> Mask:
    """Tell whether the sheet's middle has gone to the other side of its ends (...)."""
    return np.asarray((alpha_rad > _SNAPPED_FROM_RAD) & (sag_m < _SNAPPED_SAG_M))


def refuse_snapped(sag_m: float, alpha_rad: float) -> None:
    """Raise SimulationFailed where the sheet has snapped."""
    if has_snapped(sag_m, alpha_rad):
        raise SimulationFailed(
            "the sheet snapped into another buckled shape: "
            f"its middle is {-1e3 * sag_m:.1f} mm above its ends"
        )
