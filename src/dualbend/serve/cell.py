"""A served cell: the ports of a scenario, opened, and the run that they steer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from dualbend.errors import InputError
from dualbend.run.cell import believed_tool
from dualbend.run.loop import Run
from dualbend.scenario.sections import ServeConfig
from dualbend.serve.lockstep import LockStep
from dualbend.serve.port import RobotPort, SensorPort
from dualbend.serve.ports import with_ports
from dualbend.serve.robot.egm import EgmRobot
from dualbend.serve.robot.rsi import RsiRobot
from dualbend.serve.robot.telegram import configuration
from dualbend.serve.sensor.netft import NetFT
from dualbend.types import SIDES, Side, Vector

LOOPBACK = "127.0.0.1"

_ROBOTS: dict[str, type[RsiRobot] | type[EgmRobot]] = {"rsi": RsiRobot, "egm": EgmRobot}
_FIRST = {
    "left": {"rsi": 49152, "egm": 6510, "netft": 49162, "http": 49172},
    "right": {"rsi": 49153, "egm": 6511, "netft": 49163, "http": 49173},
}


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
        for option, given in (("--address", address), ("--controller", controller)):
            if not given:  # which would be every address of the machine
                raise InputError(f'{option} is empty; give an address, "{LOOPBACK}" for example')
        self._ready, self._address, self._controller = run, address, controller
        config = scenario.serve or ServeConfig()
        self.config = with_ports(config) if own_ports else config
        if all(self.config.own(side).robot == "none" for side in SIDES):
            raise InputError("serve.left.robot and serve.right.robot are none: nothing is steered")
        mode, correction = scenario.robot.alter.mode, self.config.correction
        for side in SIDES:
            if self.config.own(side).robot != "egm":
                continue
            if correction != "absolute" or mode != "world":
                raise InputError(
                    f'serve.{side}.robot = "egm" answers with a whole pose in the bending frame: '
                    f'it needs serve.correction = "absolute", not {correction!r}, and '
                    f'robot.alter.mode = "world", not {mode!r}'
                )

    @contextmanager
    def open(self) -> Iterator[LockStep]:
        """Open the ports, for a run in lock step."""
        period_s = self._ready.scenario.period_s
        with ExitStack() as stack:
            self.robots: list[RobotPort] = []
            self.sensors: list[SensorPort] = []
            for side in SIDES:
                own = self.config.own(side)
                if own.robot != "none":
                    made = _ROBOTS[own.robot]
                    robot = made(side, self._controller, self.robot_port(side), period_s)
                    stack.callback(robot.close)
                    self.robots.append(robot)
                if own.sensor == "netft" and side in self._ready.scenario.compliance.sensing:
                    port = _or(own.sensor_port, _FIRST[side]["netft"])
                    http = _or(own.http_port, _FIRST[side]["http"])
                    sensor = NetFT(side, self._address, port, http, period_s)
                    stack.callback(sensor.close)
                    self.sensors.append(sensor)
            yield LockStep(self._ready, self.config, self.robots, self.sensors)

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
        for where in dict.fromkeys((self._address, self._controller)):
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
