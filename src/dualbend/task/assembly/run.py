"""The assembly's loop: the robots' program is asked every cycle what it wants, and told what is."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import msgspec
import numpy as np

from dualbend.control.compliance.object import ObjectAdmittance, net_wrench
from dualbend.control.delay import TransportDelay
from dualbend.errors import InputError
from dualbend.imperfection.config import ImperfectionsConfig
from dualbend.imperfection.draws import stream
from dualbend.planning.plan import AssemblyPlan, plan_assembly
from dualbend.run.arm_load import refuse_overload
from dualbend.run.arms import shown_placements, with_placements
from dualbend.run.cell import RobotCell
from dualbend.run.loop import Asking, Run
from dualbend.run.outcome import TaskStopped
from dualbend.run.record import TableRow
from dualbend.scenario.scenario import Scenario
from dualbend.scene.bed.pin_contacts import PinContacts
from dualbend.scene.grippers import Grippers
from dualbend.scene.ik import carried_targets
from dualbend.scene.observation import BENDING_TO_WORLD, SensorSample
from dualbend.scene.warnings import SimulationFailed
from dualbend.task.assembly.config import AssemblyConfig, ErrorsConfig, assembly_of
from dualbend.task.assembly.damage import Resolution, stop_at_damage
from dualbend.task.assembly.metrics import not_seated
from dualbend.task.assembly.program.motions import PHASES, Goal, Posture, Sensed
from dualbend.task.assembly.program.table import AssemblyProgram
from dualbend.task.assembly.stiffness import grip_yields, object_stiffness, stable_rate
from dualbend.task.assembly.workplace import check_workplace
from dualbend.types import SIDES, PlanarPose, Side, Vector

LONGEST_S, ATTEMPT_S = 180.0, 20.0
"""A sheet is laid within the first, and the second for each attempt, or the run is given up."""

BENDS = np.linspace(0.0, 1.0, 6)
"""Bending angles, over that at which the sheet is laid, where its stiffness is computed."""

_PLACE = (("x", "m"), ("y", "m"), ("z", "m"), ("yaw", "rad"))


def columns(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """Return the columns that only an assembly has."""
    holes = assembly_of(scenario).layout.holes.names
    return (
        ("sheet", "1"),
        ("attempt", "1"),
        *((f"place_{name}", unit) for name, unit in _PLACE),
        *((f"object_deviation_{name}", unit) for name, unit in _PLACE if name != "z"),
        *((f"net_force_{name}", "N") for name in "xyz"),
        ("net_moment_z", "N m"),
        *((f"{side}_gap", "m") for side in SIDES),
        *((f"pin_force_{hole}", "N") for hole in holes),
        *((f"edge_force_{hole}", "N") for hole in holes),
        *((f"penetration_{hole}", "m") for hole in holes),
        ("impact_depth", "m"),
        *((f"hole_{hole}_{axis}", "m") for hole in holes for axis in "xyz"),
    )


def cycles(scenario: Scenario) -> int:
    """Return the command cycles after which an assembly is given up."""
    return round(longest_s(assembly_of(scenario)) / scenario.period_s)


def longest_s(config: AssemblyConfig) -> float:
    """Return the time after which an assembly is given up [s]."""
    return config.sheets * (LONGEST_S + config.search.attempts * ATTEMPT_S)


def assembly_plan(scenario: Scenario) -> AssemblyPlan:
    """Return the plan of a scenario's assembly.

    Raises
    ------
    InputError
        There is no assembly in it, no robot could work at its workplace or feel what it does, or
        the holes do not go over the pins at the bending angle.
    """
    config, sheet = assembly_of(scenario), scenario.sheet.sheet()
    source = f"scenario {scenario.name!r}"
    if config.compliance is not None and len(scenario.compliance.sensing) < len(SIDES):
        raise InputError(
            f"{source}: compliance.sensing = {list(scenario.compliance.sensing)}: "
            f"task.compliance needs the net force of both arms, {list(SIDES)}"
        )
    strain = scenario.limit_strain
    try:
        check_workplace(config, sheet)
        plan = plan_assembly(sheet, config.layout.holes, config.layout.pins, yield_strain=strain)
    except InputError as error:
        # The planner speaks of holes and pins; here they have their full names.
        text = re.sub(r"(?<!layout\.)\b(holes|pins)\.", r"task.layout.\1.", str(error))
        raise InputError(f"{source}: {text}") from error
    low, high = plan.range.clear_rad, plan.range.highest_rad
    if not low <= scenario.path.end_rad <= high:
        raise InputError(
            f"{source}: path.end_rad = {scenario.path.end_rad:g}: the holes go over the pins "
            f"between {low:.3f} and {high:.3f} rad, best at {plan.bend_rad:.3f} rad"
        )
    return plan


class AssemblyRun(Run):
    """Two arms lay sheets on the pins.

    Raises
    ------
    InputError
        A posture is out of reach, or the sheet's holes do not fit the pins at any bending angle.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.plan = assembly_plan(scenario)
        self.scenario = scenario
        self.config, sheet = assembly_of(scenario), scenario.sheet.sheet()
        path = scenario.path.make(sheet.length_m)
        # In most cycles the sheet is bent as it was in the last one.
        self._on_path = lru_cache(maxsize=1)(path.at)
        limit = scenario.limit_strain
        assert limit is not None  # an assembly has one
        told = scenario.sensor
        force_n = told.force_noise_n + told.force_resolution_n
        torque_nm = told.torque_noise_nm + told.torque_resolution_nm
        program = partial(
            AssemblyProgram,
            config=self.config,
            sheet=sheet,
            grasp=scenario.grasp,
            path=path,
            touch_rad=self.plan.range.reach_rad,
            uneven_m=self.plan.uneven_m(scenario.path.end_rad),
            bend_speed_rad_per_s=scenario.motion.speed_rad_per_s,
            period_s=scenario.period_s,
            least_force_n=force_n,
            # Of both arms' mean, about the grips: the sensors' distance is the arm of a force.
            least_moment_nm=(torque_nm + told.lever_arm_m * force_n) / math.sqrt(2.0),
            rehearse=scenario.robot.servo.friction_estimate is not None,
        )
        self.program = program()
        start = self.program.start
        scenario = self.scenario = with_placements(scenario, self._targets())
        try:
            cell = RobotCell(scenario, self._pose(start), _place(start))
        except InputError as error:
            raise self._out_of_reach("approach", error) from error
        super().__init__(scenario, cell)
        down = next(at for phase, at in self.program.waypoints() if phase == "lower")
        self.program = program(yields=grip_yields(cell, self._pose(down), _place(down)))
        self._resolution = Resolution(cell.sheet.thickness_m, scenario.step_s)
        self._limit_strain = limit * sheet.young_pa / cell.sheet.young_pa
        self._check_path()
        simulation, layout = cell.simulation, self.config.workplace
        self.grippers = Grippers(simulation.model, simulation.data, cell.sheet.thickness_m)
        self.pins = PinContacts(
            simulation.model, simulation.data, layout, cell.sheet, scenario.sheet.strips
        )
        simulation.on_step += [self.pins.on_step, self.grippers.on_step]
        simulation.parts = self.pins.parts
        simulation.parts_by_contacts = self.pins.parts_by_contacts
        if self.config.compliance is not None:
            self.stiffness = self._stiffness(cell)
            rate = stable_rate(scenario) / self.config.compliance.gain_margin
            self._mobility = rate / self.stiffness

    def _pose(self, posture: Posture) -> Vector:
        half, rise = self._on_path(posture.alpha)
        return np.array([-half - posture.retreat, rise, posture.alpha])

    def _targets(self) -> dict[Side, Vector]:
        """Return both grips' poses (k, 4, 4) along the task, each in its arm's bending frame."""
        postures = [posture for _, posture in self.program.waypoints()]
        targets = [
            carried_targets(np.array([self._pose(posture)] * 2), _place(posture))
            for posture in (self.program.start, *postures)
        ]
        turn = np.diag([-1.0, -1.0, 1.0, 1.0])
        return {
            "left": np.array([left.as_matrix() for left, _ in targets]),
            "right": np.array([turn @ right.as_matrix() for _, right in targets]),
        }

    def _check_path(self) -> None:
        """Refuse postures that the arms cannot reach."""
        q, visited = self.cell.home, []
        for phase, posture in self.program.waypoints():
            try:
                q = self.cell.reach(self._pose(posture), q, _place(posture))
            except InputError as error:
                raise self._out_of_reach(phase, error) from error
            visited.append(q)
            if phase == "lower":
                self._down, self._down_q = posture, q
        self.checked_poses = np.array(visited)
        refuse_overload(self.scenario, self.cell.arms, self.cell.ik.model, self.checked_poses)

    def _out_of_reach(self, phase: str, error: InputError) -> InputError:
        layout = self.config.layout
        return InputError(
            f"scenario {self.scenario.name!r}: {phase}: {error}; look at "
            f"task.layout.stand.y_m = {layout.stand.y_m:g}, "
            f"task.layout.stand.top_m = {layout.stand.top_m:g}, "
            f"task.layout.bed.top_m = {layout.bed.top_m:g}, "
            f"{shown_placements(self.scenario)}"
        )

    @property
    def cycles(self) -> int:
        """Number of command cycles, at most."""
        return cycles(self.scenario)

    @property
    def lessons(self) -> tuple[TableRow, ...]:
        """What was found with each sheet so far."""
        return tuple(lesson.row() for lesson in self._task.state.memory.lessons)

    def start(self) -> SensorSample:
        """Put the arms beside the stand, jaws open, and a sheet upon it."""
        cell, opening = self.cell, self.config.jaw_opening_m
        cell.rest()
        self.laid = []
        flat = np.zeros(self.scenario.sheet.model.sections + 1)
        simulation = cell.simulation
        sample = simulation.reset(
            simulation.positions(cell.home, opening, flat, *self._on_the_stand())
        )
        self.grippers.reset(opening)
        self.pins.peaks()
        return sample

    def _on_the_stand(self) -> tuple[Vector, float]:
        """Return where the next sheet lies; its scatter is of a stream of its own."""
        stand, errors = self.config.layout.stand, self.config.errors
        height = stand.top_m + 0.5 * self.cell.sheet.thickness_m
        drawn = stream(self.scenario.seed, "stand", len(self.laid), repeat=self.scenario.repeat)
        x, y, yaw = drawn.standard_normal(3).tolist()
        x = errors.pickup_x_m + errors.scatter_m * x
        y = errors.pickup_y_m + errors.scatter_m * y
        place = np.array([x, stand.y_m + y, height])
        return place, errors.pickup_yaw_rad + errors.scatter_rad * yaw

    def _supply(self) -> None:
        """Leave the laid sheet where it is and put the next one on the stand."""
        self.pins.lay(len(self.laid) - 1)
        flat = np.zeros(self.scenario.sheet.model.sections + 1)
        self.cell.simulation.put_sheet(flat, *self._on_the_stand())

    def _stiffness(self, cell: RobotCell) -> Vector:
        """Return what the compliance works against along x, y and about z, at each of `BENDS`.

        Of the sheet that the robots believe in: they know of no errors.
        """
        task = msgspec.structs.replace(self.config, errors=ErrorsConfig())
        believed = msgspec.structs.replace(
            self.scenario, task=task, imperfections=ImperfectionsConfig()
        )
        if believed != self.scenario:
            cell = RobotCell(believed, cell.start, cell.place)
        along = self.config.layout.holes.places_of("middle")[:, 0]
        pinned = float(along.min()), float(along.max())
        found = []
        for bend in BENDS:
            posture = replace(self._down, alpha=bend * self._down.alpha)
            q = cell.reach(self._pose(posture), self._down_q, _place(posture))
            found.append(np.diag(object_stiffness(cell, q, posture.alpha, pinned)))
        return np.array(found)

    def begin(self, on_cycle: Callable[[int], None] | None = None) -> None:
        """Start again: the program, the compliance of the held sheet and its delay, too."""
        compliance, period_s = self.config.compliance, self.scenario.period_s
        self._admittance: ObjectAdmittance | None = None
        if compliance is not None:
            mobility = self._mobility
            self._admittance = ObjectAdmittance(compliance, BENDS, mobility, period_s=period_s)
        self._delay = TransportDelay(self.scenario.robot.longest_delay, 3)
        self._task = self.program.begin()
        super().begin(on_cycle)

    def cycle(self) -> Asking[bool]:
        """Run one command cycle of the program; False at its end."""
        laid, goal = self._task.state.laid, self._task.goal
        if goal is None:
            return False
        if self.trace.rows == self.cycles:
            raise TaskStopped(f"{PHASES[goal.phase]}: not done within {longest_s(self.config):g} s")
        if laid > len(self.laid):
            self._lay()
            self._supply()
        x, rise, alpha = self._pose(goal.posture).tolist()
        place = _place(goal.posture)
        seen = self.observe(goal.phase, np.array([alpha, -x, place[2] + rise]))
        reading = self.read(seen)
        bending = reading.filtered.in_bending_frame(np.array([alpha]))
        net = net_wrench(bending, -x, float(place[3]))
        # Of each arm along its bending frame, x from the arm to the sheet; 0 without a sensor.
        felt = np.where(np.isnan(bending.components), 0.0, bending.components)
        deviation = self._comply(goal, net)
        self._note(goal, laid, deviation, net)
        moved = place + self._delay.update(deviation)[[0, 1, 2, 2]] * [1.0, 1.0, 0.0, 1.0]
        nominal = PlanarPose(np.array([[x, rise + up, alpha] for up in goal.levels]))
        told, command = yield from self.control(seen, PHASES[goal.phase], nominal, reading, moved)
        self.grippers.drive(goal.posture.opening)
        targets = carried_targets(command.pose.coordinates, moved, command.aside)
        grip = self.cell.measured.grips(seen)[:, :3] * BENDING_TO_WORLD
        self.send(self.solve(targets), told, command, free=goal.free)
        self.grippers.update()
        sent, place = np.array([target.translation() for target in targets]), _between(grip)
        sensed = Sensed(
            net=net,
            vertical=felt[:, 2],
            moment=felt[:, 4],
            tension=float(felt[:, 0].mean()),
            gap=self.grippers.gap_m,
            error_m=float(np.linalg.norm(grip - sent, axis=1).max()),
            place=place,
            behind=_between(sent) - place,
        )
        if self._task.advance(sensed) is None:
            self._lay()
        return True

    def _lay(self) -> None:
        """Keep where the holes of a sheet lie that was let go, and fail where one is not seated.

        The program believes that all are.
        """
        self.laid.append(self.pins.offsets())
        if why_not := not_seated(self.record("completed"), len(self.laid) - 1):
            raise SimulationFailed(f"{PHASES[-1]}: not seated: {why_not}")

    def _comply(self, goal: Goal, net: Vector) -> Vector:
        """Return the deviation of the held sheet, x, y [m] and yaw [rad] (3,)."""
        admittance = self._admittance
        if admittance is None:
            return np.zeros(3)
        if goal.alpha_ratio is not None:
            wrench = self._task.state.contact_wrench(net)
            admittance.update(wrench, goal.alpha_ratio, goal.seeking)
        elif goal.relax or goal.phase < PHASES.index("lower"):
            admittance.relax(self.config.speeds.travel_m_per_s)
        return admittance.deviation

    def _note(self, goal: Goal, laid: int, deviation: Vector, net: Vector) -> None:
        """Record what is the assembly's own, and stop at what does damage."""
        peaks = self.pins.peaks()
        self.trace.record_task(
            [
                float(laid),
                float(goal.attempt),
                *_place(goal.posture),
                *deviation,
                *net,
                *self.grippers.gap_m,
                *peaks.force_n,
                *peaks.edge_force_n,
                *peaks.penetration_m,
                peaks.impact_m.max(),
                *self.pins.offsets().ravel(),
            ]
        )
        strain = float(self.cell.sheet.surface_strain(self.cell.simulation.bending_angles))
        if strain > self._limit_strain:
            raise SimulationFailed(
                f"{PHASES[goal.phase]}: the sheet's surface strain is {strain:.2e}, above yield, "
                f"{self._limit_strain:.2e}"
            )
        names, limits = self.config.layout.holes.names, self.config.limits
        stop_at_damage(PHASES[goal.phase], names, peaks, limits, self._resolution)


def _place(posture: Posture) -> Vector:
    return np.array([posture.x, posture.y, posture.z, posture.yaw])


def _between(grip: Vector) -> Vector:
    """Return x, y [m] and yaw [rad] (3,) of what two grips (2, 3) hold between them."""
    (x, y, _), (along, across, _) = grip.mean(axis=0), grip[1] - grip[0]
    return np.array([x, y, math.atan2(across, along)])
