"""A served cell: the ports of a scenario, opened, and the run that they steer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np

from dualbend.errors import InputError
from dualbend.run.cell import believed_tool
from dualbend.run.loop import Run
from dualbend.run.planar import PlanarRun
from dualbend.scenario.sections import ServeConfig
from dualbend.scene.believed import SITES, BelievedArms
from dualbend.scene.observation import BENDING_TO_WORLD
from dualbend.scene.posed import PosedArms
from dualbend.serve.lockstep import LockStep
from dualbend.serve.port import RobotPort, SensorPort, Served
from dualbend.serve.ports import with_ports
from dualbend.serve.realtime import RealTime
from dualbend.serve.robot.egm import EgmRobot
from dualbend.serve.robot.rsi import RsiRobot
from dualbend.serve.robot.telegram import configuration
from dualbend.serve.robot.ur.robot import UrRobot
from dualbend.serve.sensor.netft import NetFT
from dualbend.types import SIDES, Side, Vector

LOOPBACK = "127.0.0.1"

_ROBOTS: dict[str, type[RsiRobot] | type[EgmRobot] | type[UrRobot]] = {
    "rsi": RsiRobot,
    "egm": EgmRobot,
    "rtde": UrRobot,
}
_FIRST = {
    "left": {"rsi": 49152, "egm": 6510, "rtde": 30004, "netft": 49162, "http": 49172},
    "right": {"rsi": 49153, "egm": 6511, "rtde": 30004, "netft": 49163, "http": 49173},
}
_BESIDE = "127.0.0.2"
"""Of the second UR robot: it has an address of its own, as its clients cannot change its ports."""


class ServedCell:
    """A run whose deviations come from controllers outside; :meth:`open` opens its ports.

    ``address``: where the sensors listen; ``controller``: where the robots send to. ``own_ports``:
    what the scenario leaves open are free ports, not the defaults, for a client that is told them.
    Raises InputError where the scenario has nothing to serve.
    """

    def __init__(
        self,
        run: Run,
        address: str = LOOPBACK,
        controller: str = LOOPBACK,
        *,
        own_ports: bool = False,
    ) -> None:
        scenario = run.scenario
        if scenario.task.kind != "bending":
            raise InputError(
                f"scenario {scenario.name!r}: task.kind = {scenario.task.kind!r}; served is bending"
            )
        assert isinstance(run, PlanarRun)
        for option, given in (("--address", address), ("--controller", controller)):
            if not given:  # which would be every address of the machine
                raise InputError(f'{option} is empty; give an address, "{LOOPBACK}" for example')
        self._ready, self._address, self._controller = run, address, controller
        config = scenario.serve or ServeConfig()
        self.config = with_ports(config) if own_ports else config
        if all(self.config.own(side).robot == "none" for side in SIDES):
            raise InputError("serve.left.robot and serve.right.robot are none: nothing is steered")
        for side in SIDES:
            self._refuse_modes(side)

    def _refuse_modes(self, side: Side) -> None:
        """Refuse what a whole pose cannot mean."""
        robot, scenario = self.config.own(side).robot, self._ready.scenario
        mode, correction = scenario.robot.alter.mode, self.config.correction
        wanted = []
        if robot in ("egm", "rtde") and correction != "absolute":
            wanted.append(f'serve.correction = "absolute", not {correction!r}')
        streamed = self.config.path == "outside" and robot != "none"
        if (robot in ("egm", "rtde") or streamed) and mode != "world":
            wanted.append(f'robot.alter.mode = "world", not {mode!r}')
        if wanted:
            why = 'serve.path = "outside" streams whole poses'
            if not streamed:
                why = f'serve.{side}.robot = "{robot}" answers with a whole pose'
            raise InputError(f"{why} in the bending frame: it needs {' and '.join(wanted)}")

    @contextmanager
    def open(self, *, realtime: bool = False) -> Iterator[LockStep]:
        """Open the ports, for a run in lock step or in real time."""
        period_s = self._ready.scenario.period_s
        with ExitStack() as stack:
            self.robots: list[RobotPort] = []
            self.sensors: list[SensorPort] = []
            for side in SIDES:
                own = self.config.own(side)
                if own.robot != "none":
                    made, port = _ROBOTS[own.robot], self.robot_port(side)
                    robot = made(self._served(side), self.robot_address(side), port)
                    stack.callback(robot.close)
                    self.robots.append(robot)
                if own.sensor == "netft" and side in self._ready.scenario.compliance.sensing:
                    port = _or(own.sensor_port, _FIRST[side]["netft"])
                    http = _or(own.http_port, _FIRST[side]["http"])
                    sensor = NetFT(side, self._address, port, http, period_s)
                    stack.callback(sensor.close)
                    self.sensors.append(sensor)
            loop = RealTime if realtime else LockStep
            yield loop(self._ready, self.config, self.robots, self.sensors)

    def _served(self, side: Side) -> Served:
        """Return what a robot's port knows of its arm."""
        run = self._ready
        scenario, arms, row = run.scenario, run.cell.arms, SIDES.index(side)
        own = arms.joints(side)
        believed, other = BelievedArms(PosedArms(run.cell.ik.model, SITES)), run.cell.home

        def forward(joints: Vector) -> tuple[Vector, Vector]:
            both = other.copy()
            both[own] = joints
            axes = believed.grip_axes(both)[row] * BENDING_TO_WORLD[row][:, np.newaxis]
            return believed.grips(both)[row, :3], axes

        mass_kg, centre_m = believed_tool(scenario, run.cell.simulation.model, side)
        return Served(
            side=side,
            period_s=scenario.period_s,
            joints=len(other[own]),
            slides=any(slides for name, slides in arms.slides.items() if name.startswith(side)),
            sensed=side in scenario.compliance.sensing,
            tool_kg=mass_kg,
            tool_m=centre_m,
            unknown=self.config.unknown,
            forward=forward,
        )

    def robot_address(self, side: Side) -> str:
        """Return where a robot sends to, or listens where it is one that listens."""
        own = self.config.own(side)
        if own.robot != "rtde":
            return self._controller
        beside = _BESIDE if side == "right" and self._address == LOOPBACK else self._address
        return own.robot_address or beside

    def robot_port(self, side: Side) -> int:
        """Return the port on which a side's controller waits for the robot."""
        own = self.config.own(side)
        return _or(own.robot_port, _FIRST[side][own.robot])

    def told(self) -> list[str]:
        """Return what listens where, in which units and frames, a line each; of open ports."""
        scenario, lines = self._ready.scenario, []
        for port in (*self.robots, *self.sensors):
            lines += port.told()
        for side in scenario.compliance.sensing:
            lines.append(self._told_of_tool(side))
        if not scenario.compliance.sensing:
            lines.append("no sensor: no arm senses (compliance.sensing)")
        where_to = (self.robot_address(side) for side in SIDES)
        for where in dict.fromkeys((self._address, self._controller, *where_to)):
            if where != "localhost" and not where.startswith("127."):
                lines.append(f"open to the network: {where} is no loopback address")
        return lines

    def tool(self, side: Side) -> tuple[float, Vector]:
        """Return mass [kg] and centre (3,) [m] in the sensor's axes, as they are believed."""
        run = self._ready
        return believed_tool(run.scenario, run.cell.simulation.model, side)

    def _told_of_tool(self, side: Side) -> str:
        """Return what a controller needs to take the tool's weight off a reading."""
        scenario, (mass_kg, centre_m) = self._ready.scenario, self.tool(side)
        centre = ", ".join(f"{value:.6f}" for value in centre_m)
        age_s = max(scenario.sensor.latency_steps(scenario.step_s), 1) * scenario.step_s
        return (
            f"{side} tool: {mass_kg:.6f} kg, centre at ({centre}) m in the sensor's axes; grip "
            f"centre at x = {scenario.sensor.lever_arm_m:g} m; a reading is {1e3 * age_s:.4g} ms "
            "old"
        )

    def configurations(self) -> dict[str, str]:
        """Return the RSI Ethernet configuration of each served robot, by a file's name."""
        return {
            f"rsi_{side}.xml": configuration(self._controller, self.robot_port(side))
            for side in SIDES
            if self.config.own(side).robot == "rsi"
        }


def _or(given: int | None, otherwise: int) -> int:
    return otherwise if given is None else given
