"""The paper's experiment: bend the sheet along a path between two grips that hold it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.controller import ControlledPath, Controller, Observation
from dualbend.control.wrist import WristSensors
from dualbend.errors import InputError
from dualbend.run.arm_load import refuse_overload
from dualbend.run.arms import shown_placements, with_placements
from dualbend.run.cell import RobotCell
from dualbend.run.known_sheet import make_compliance
from dualbend.run.loop import Cycle, Run
from dualbend.scenario.misalignment import errors_over_time
from dualbend.scenario.motion import PHASES, nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.ik import grip_targets
from dualbend.scene.simulation import SensorSample
from dualbend.scene.warnings import SimulationFailed
from dualbend.types import SIDES, PlanarPose, Vector

_SNAPPED_SAG_M, _SNAPPED_FROM_RAD = -1e-3, 0.1
"""A sheet bent this far sags by centimetres: a middle this much above its ends is another shape."""


SPACE_COLUMNS = tuple(
    (f"{side}_{place}_{turn}", "rad")
    for place in ("grip", "edge")
    for side in SIDES
    for turn in ("roll", "yaw")
)
"""What the trace of a misaligned run has beside a plane one's columns."""


_CHECKED_POSES = 40
"""Poses of the path that are solved before the run: one in 25 mrad on the shipped ones."""


class BendingRun(Run):
    """The paper's experiment: bend the sheet along a path between two grips that hold it.

    Parameters
    ----------
    scenario
        Says everything about the run.
    compliance
        Makes what takes the place of the scenario's ``[compliance]``, once for each run: it may
        have a memory. The result and its summary name it.

    Raises
    ------
    InputError
        A pose of the nominal path is out of reach, or its joint speeds are above the arm's.
    """

    phases = PHASES

    def __init__(
        self,
        scenario: Scenario,
        compliance: Callable[[Scenario], Controller] = make_compliance,
    ) -> None:
        self.compliance = compliance
        scenario = with_placements(scenario)
        self.motion = nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)
        self._z_m = scenario.cell.sheet_height_m + self.motion.rise_m
        self._errors = errors_over_time(scenario.misalignment, self.motion)
        if self._errors is not None:
            self.task_columns = SPACE_COLUMNS
        self.scenario = scenario
        try:
            cell = RobotCell(scenario, self._nominal_pose(0))
        except InputError as error:
            raise self._out_of_reach(0, error) from error
        super().__init__(scenario, cell)
        self._foresee()

    @property
    def cycles(self) -> int:
        """Number of command cycles."""
        return self.motion.cycles

    def start(self) -> SensorSample:
        """Put the cell at rest in its start, the sheet in its zero-moment shape."""
        return self.cell.reset()

    def _nominal_pose(self, cycle: int) -> Vector:
        motion = self.motion
        return np.array([-motion.half_distance_m[cycle], self._z_m[cycle], motion.alpha_rad[cycle]])

    def _foresee(self) -> None:
        """Walk the nominal path with the IK alone and refuse what the arms cannot do."""
        first = int(np.flatnonzero(self.motion.phase == PHASES.index("bend"))[0])
        cycles = np.linspace(first, self.motion.cycles - 1, _CHECKED_POSES).astype(int)
        q, before, poses = self.cell.home, -1, list[Vector]()
        for cycle in np.unique(cycles).tolist():
            try:
                there = self.cell.reach(self._nominal_pose(cycle), q)
            except InputError as error:
                raise self._out_of_reach(cycle, error) from error
            if before >= 0:
                self._refuse_speed(np.abs(there - q) / ((cycle - before) * COMMAND_PERIOD_S))
            q, before = there, cycle
            poses.append(there)
        self.foreseen = np.array(poses)
        refuse_overload(self.scenario, self.cell.arms, self.cell.ik.model, self.foreseen)

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
            raise InputError(
                f"motion.speed_rad_per_s = {self.scenario.motion.speed_rad_per_s}: "
                f"{joints[i]} would turn at {speed[i]:.2f} rad/s, above {limit[i]:.2f}; "
                f"at most {slower:.2f} rad/s of bending here"
            )

    def _loop(self, sensors: WristSensors, path: ControlledPath, cycle: Cycle) -> None:
        for n in range(self.motion.cycles):
            x, z, alpha = self._nominal_pose(n).tolist()
            seen = cycle.observe(int(self.motion.phase[n]), np.array([alpha, -x, z]))
            refuse_snapped(seen.sag, alpha)
            if self._errors is not None:
                self.trace.note(self.cell.simulation.roll_and_yaw().ravel().tolist())
                self.cell.simulation.displace_grasps(self._errors[n])
            sample = cycle.sample
            reading = sensors.read(sample.wrench, sample.rotation)
            observation = Observation.of(
                reading,
                time_s=n * COMMAND_PERIOD_S,
                phase=PHASES[self.motion.phase[n]],
                joints_rad=seen.q,
                measured=PlanarPose(seen.grip[:, [0, 2, 3]]),
                nominal=PlanarPose(np.array([[x, z, alpha]] * 2)),
            )
            command = path.command(observation)
            cycle.send(grip_targets(command.pose.coordinates), reading, observation, command)


def refuse_snapped(sag_m: float, alpha_rad: float) -> None:
    """Raise SimulationFailed where the sheet's middle has gone to the other side of its ends."""
    if alpha_rad > _SNAPPED_FROM_RAD and sag_m < _SNAPPED_SAG_M:
        raise SimulationFailed(
            "the sheet snapped into another buckled shape: "
            f"its middle is {-1e3 * sag_m:.1f} mm above its ends"
        )
