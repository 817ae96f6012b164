"""A UR robot: RTDE, the port that takes its script, and its dashboard."""

from __future__ import annotations

import math
import selectors
import struct
import time

from dualbend.errors import InputError
from dualbend.run.record import TableRow
from dualbend.serve.port import ArmState, Served
from dualbend.serve.robot.pose import axes_about, deviation_from
from dualbend.serve.robot.ur import wire
from dualbend.serve.robot.ur.dashboard import GREETING, take_lines
from dualbend.serve.robot.ur.program import Program, is_known
from dualbend.serve.robot.ur.variables import (
    CONTROLLER,
    Told,
    output_type,
    register_type,
    values_of,
)
from dualbend.serve.tcp import Client, TcpPort
from dualbend.types import Side, Vector

_SCRIPT, _DASHBOARD = -1, -5
"""From RTDE's port to the others: 30003 and 29999 from 30004, as on the real robot."""

_AGAIN_S = 0.25
_LOWEST_HZ, _HIGHEST_HZ, _JOINTS = 1.0, 500.0, 6
_LONGEST_SCRIPT = 1 << 20


class _Session:
    """What one RTDE client has set up."""

    def __init__(self) -> None:
        self.negotiated = self.started = False
        self.outputs: wire.Recipe | None = None
        self.inputs = dict[int, wire.Recipe]()
        self.every = 1


class UrRobot:
    """A :class:`dualbend.serve.port.RobotPort` whose controllers connect to it.

    Each started client gets a data package a cycle, with the cycle's timestamp. It is said again,
    the same, where the program's state changes and every 0.25 s: ur_rtde gives up after 2.5 s of
    silence. The first target after a cycle's package answers the cycle. Raises InputError where
    the arm has not 6 turning joints, or a port cannot be opened.
    """

    protocol = "rtde"
    faults = ("malformed", "late")

    def __init__(self, served: Served, address: str, port: int) -> None:
        self.side: Side = served.side
        if served.slides or served.joints != _JOINTS:
            raise InputError(
                f'serve.{self.side}.robot = "rtde": a UR robot has {_JOINTS} turning joints, this '
                f"arm has {served.joints}" + (", some of which slide" if served.slides else "")
            )
        key = f"serve.{self.side}.robot_port"
        if port + _DASHBOARD < 1:
            raise InputError(f"{key} = {port}: the dashboard is {-_DASHBOARD} below it; at least 6")
        self._served, self._zero = served, served.unknown == "zero"
        self.program = Program()
        self.answer: Vector | None = None
        self.wrong_in_a_row, self._told_at = 0, 0.0
        self.late: Vector | None = None
        self.missed, self._is_late = True, False
        self._state: ArmState | None = None
        self._before: ArmState | None = None
        self._sessions = dict[Client, _Session]()
        names = ("sent", "answered", "doubled", *self.faults, "not_found", "refused", "scripts")
        self._count = dict.fromkeys(names, 0)
        self._rtde = TcpPort((address, port), key, self._take, left=self._left)
        self.address, self.port = address, self._rtde.port
        self._ports = [self._rtde]
        try:
            for offset, take, greeting in (
                (_SCRIPT, self._take_script, b""),
                (_DASHBOARD, self._take_line, GREETING),
            ):
                at, named = (address, self.port + offset), f"{key} - {-offset}"
                self._ports.append(TcpPort(at, named, take, greeting=greeting))
        except InputError:
            self.close()
            raise

    def watch(self, selector: selectors.BaseSelector) -> None:
        """Register what is waited on."""
        for port in self._ports:
            port.watch(selector)

    @property
    def refused(self) -> bool:
        """Whether the state is to be said again."""
        behind = any(client.behind for client in self._rtde.clients)
        return behind or time.monotonic() - self._told_at >= _AGAIN_S

    @property
    def gone_wrong(self) -> str:
        """What was asked for and is not served; "": nothing."""
        return self.program.refused and f"asks for {self.program.refused}, which is not served"

    @property
    def hint(self) -> str:
        """Why there may be no answer; "": nothing is known."""
        known = "its program does not run: ur_rtde's script, or play at the dashboard, starts it"
        return "" if self.program.running else known

    def ask(self, state: ArmState) -> None:
        """Send the state of a cycle, which makes the last answer old."""
        self.missed = True
        for port in self._ports:
            port.read_all()
        self._before, self._state = self._state or state, state
        self.answer, self.missed = None, False
        self.late = self._deviation() if self._is_late else None
        self._is_late = False
        started = [session for session in self._sessions.values() if session.started]
        if started and not any(map(self._due, started)):
            self.answer = self._deviation()
        self._tell()

    def again(self) -> None:
        """Say the state again."""
        self._tell()

    def _due(self, session: _Session) -> bool:
        assert self._state is not None
        return self._state.cycle % session.every == 0

    def _tell(self) -> None:
        self._told_at = time.monotonic()
        if self._state is None or self._before is None:
            return
        told = Told(
            self._state,
            self._before,
            self.program,
            self._served.period_s,
            self._served.tool_kg,
            self._served.tool_m,
        )
        for client, session in list(self._sessions.items()):
            recipe = session.outputs
            if session.started and recipe is not None and self._due(session):
                client.send(recipe.pack(values_of(recipe.names, told)))
                self._count["sent"] += 1
        self._rtde.tidy()

    def _deviation(self) -> Vector | None:
        """Return the deviation (6,) of the program's target; None: it has none."""
        target = self.program.target
        if target is None or self._state is None:
            return None
        if self.program.of_joints:
            place, axes = self._served.forward(target)
        else:
            place, axes = target[:3], axes_about(target[3:])
        return deviation_from(self._state.origin, place, axes)

    def _take(self, client: Client) -> None:
        """Take all whole packages of an RTDE client."""
        session = self._sessions.setdefault(client, _Session())
        try:
            while (found := wire.taken(client.data)) is not None:
                self._obey(client, session, *found)
        except (ValueError, struct.error):
            self._count["malformed"] += 1
            self.wrong_in_a_row += 1
            client.open = False

    def _left(self, client: Client) -> None:
        self._sessions.pop(client, None)

    def _obey(self, client: Client, session: _Session, kind: bytes, payload: bytes) -> None:
        """Obey one package; ValueError or struct.error where it is none."""
        if kind == wire.DATA:
            self._write(session, payload)
        elif kind == wire.PROTOCOL:
            session.negotiated = struct.unpack(">H", payload)[0] == 2
            client.send(wire.package(kind, bytes([session.negotiated])))
        elif kind == wire.VERSION:
            client.send(wire.package(kind, struct.pack(">4I", *CONTROLLER)))
        elif kind in (wire.OUTPUTS, wire.INPUTS) and session.negotiated:
            setup = self._outputs if kind == wire.OUTPUTS else self._inputs
            number, types = setup(client, session, payload)
            client.send(wire.package(kind, bytes([number]) + ",".join(types).encode()))
        elif kind in (wire.START, wire.PAUSE):
            session.started = kind == wire.START and session.outputs is not None
            accepted = session.started or kind == wire.PAUSE
            client.send(wire.package(kind, bytes([accepted])))
            if session.started:
                self._tell()
        else:
            raise ValueError(f"no package of type {kind!r}")

    def _outputs(self, client: Client, session: _Session, payload: bytes) -> tuple[int, list[str]]:
        """Set up what a client gets; returns number (0: not accepted) and types."""
        (frequency,) = struct.unpack_from(">d", payload)
        if not _LOWEST_HZ <= frequency < math.inf:
            raise ValueError(f"a frequency of {frequency}")
        names = wire.names_of(payload[8:])
        rate = 1.0 / self._served.period_s
        session.every = max(round(rate / min(frequency, _HIGHEST_HZ)), 1)
        types = [output_type(n, sensed=self._served.sensed, zero=self._zero) for n in names]
        session.outputs = None
        if not names or wire.NOT_FOUND in types:
            self._count["not_found"] += types.count(wire.NOT_FOUND)
            return 0, types
        session.outputs = wire.Recipe(1, names, types)
        return 1, types

    def _inputs(self, client: Client, session: _Session, payload: bytes) -> tuple[int, list[str]]:
        """Set up what a client may write, which no other one may then."""
        names = wire.names_of(payload)
        others = {
            name
            for other, theirs in self._sessions.items()
            if other is not client
            for recipe in theirs.inputs.values()
            for name in recipe.names
        }
        types = [
            wire.IN_USE if name in others else register_type(name, "in") or wire.NOT_FOUND
            for name in names
        ]
        number = len(session.inputs) + 1
        if not names or number > 255 or {wire.NOT_FOUND, wire.IN_USE} & set(types):
            self._count["not_found"] += types.count(wire.NOT_FOUND)
            return 0, types
        session.inputs[number] = wire.Recipe(number, names, types)
        return number, types

    def _write(self, session: _Session, payload: bytes) -> None:
        recipe = session.inputs.get(payload[0]) if payload else None
        if recipe is None:
            raise ValueError("no such recipe")
        state = self.program.running, dict(self.program.registers)
        values = dict(zip(recipe.names, recipe.unpack(payload), strict=True))
        is_target = self.program.write(values)
        if self.program.refused:
            self._count["refused"] += 1
            self._say(self.gone_wrong)
        if is_target and not self.missed and self.answer is None:
            self.answer, self.wrong_in_a_row = self._deviation(), 0
            self._count["answered"] += 1
        elif is_target:
            self._is_late |= self.missed
            self._count["late" if self.missed else "doubled"] += 1
        elif state != (self.program.running, self.program.registers):
            self._tell()

    def _say(self, said: str) -> None:
        for client in self._rtde.clients:
            client.send(wire.text(said, 1))

    def _take_script(self, client: Client) -> None:
        """Start the program where ur_rtde's script has come; any other is not run."""
        script = bytes(client.data)
        if is_known(script):
            client.data.clear()
            self.program.play(script)
            self._count["scripts"] += 1
            self._tell()
        elif len(script) > _LONGEST_SCRIPT:
            self._count["malformed"] += 1
            client.open = False

    def _take_line(self, client: Client) -> None:
        before = self.program.running
        take_lines(client, self.program)
        if before != self.program.running:
            self._tell()

    def told(self) -> list[str]:
        """Return where the robot listens, and in which units."""
        return [
            f"{self.side} robot: UR RTDE at TCP {self.address}:{self.port}, ur_rtde's script "
            f"at {self.port + _SCRIPT}, dashboard at {self.port + _DASHBOARD}; servoL and servoJ "
            "by registers; poses in m and rad as rotation vectors, base = the arm's bending frame, "
            "TCP = the grip, target_TCP_pose = the nominal pose"
        ]

    def counted(self) -> TableRow:
        """Return what went out and came in."""
        about = {"port": f"{self.side} robot", "protocol": self.protocol}
        return {**about, "at": f"{self.address}:{self.port}", **self._count}

    def close(self) -> None:
        """Free the ports."""
        for port in self._ports:
            port.close()
