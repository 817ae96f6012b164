"""The program on the robot that input registers steer: that of ur_rtde's control script.

The script is not interpreted. Its registers, commands and states are those of ur_rtde 1.6.5,
``scripts/rtde_control.script``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from dualbend.serve.robot.ur.wire import Number
from dualbend.types import Vector

REGISTERS = {"int": range(48), "double": range(48), "bit": range(64, 128)}
"""Numbers of the general purpose registers, input and output."""

_SERVOJ, _SERVOL, _SERVO_STOP, _STOP_SCRIPT, _IDLE = 11, 24, 16, 255, 0
_READY, _DONE = 1, 2
_LARGEST = 1e6
NAMES = {
    1: "moveJ", 2: "moveJ_IK", 3: "moveL", 4: "moveL_FK", 6: "forceMode", 7: "forceModeStop",
    8: "zeroFtSensor", 9: "speedJ", 10: "speedL", 12: "servoC", 15: "speedStop", 17: "setPayload",
    18: "teachMode", 25: "toolContact", 29: "setTcp", 31: "triggerProtectiveStop", 33: "stopL",
    34: "stopJ", 35: "setWatchdog", 41: "jogStart", 45: "movePath", 51: "moveUntilContact",
    52: "freedriveMode", 66: "directTorque",
}  # fmt: skip
"""Commands that are refused, as far as they have a name here."""

_KNOWN_SCRIPT = re.compile(rb"\A\s*def rtde_control\(\):.*NODE_CONTROL_LOOP_ENDS", re.DOTALL)
_OFFSET = re.compile(rb"reg_offset_int\s*=[^\n]*\n?\s*(\d{1,2})")


class Program:
    """Registers, whether the program runs, and what it has last been told to do.

    Attributes
    ----------
    registers : those that were written, by name; a register that was not is 0
    running : input registers are obeyed
    target : pose (6,) that ``servoL`` has last asked for, x, y, z [m], rotation vector [rad];
        or joint angles (6,) [rad] that ``servoJ`` has, then ``of_joints`` is true
    refused : name of a command that is not served; "": none
    """

    def __init__(self) -> None:
        self.registers = dict[str, Number]()
        self.running, self.refused = False, ""
        self.target: Vector | None = None
        self.of_joints = False
        self._first = 0

    def play(self, script: bytes = b"") -> None:
        """Start the program, as it is loaded or as a script has it: which registers it reads."""
        found = _OFFSET.search(script)
        self._first = int(found[1]) if found is not None else 0
        self.running = True
        self._say(_READY)

    def stop(self) -> None:
        """Stop the program: registers are written, and nothing else happens."""
        self.running, self.target = False, None

    def write(self, values: Mapping[str, Number]) -> bool:
        """Write input registers; returns whether they are a new target. ValueError: no numbers."""
        if not all(abs(value) <= _LARGEST for value in values.values()):
            raise ValueError("a number that is none, or too large")
        self.registers |= values
        command = f"input_int_register_{self._first}"
        names = [f"input_double_register_{self._first + i}" for i in range(6)]
        if not self.running or values.keys().isdisjoint((command, *names)):
            return False
        number = int(self.registers.get(command, _IDLE))
        if number in (_SERVOL, _SERVOJ):
            self.of_joints = number == _SERVOJ
            self.target = np.array([self.registers.get(name, 0.0) for name in names])
            self._say(_READY)
            return True
        if command not in values:
            return False
        if number == _STOP_SCRIPT:
            self.stop()
        elif number in (_IDLE, _SERVO_STOP):
            self._say(_DONE if number else _READY)
        else:
            self.refused = f"{NAMES.get(number, 'a command')} ({number})"
            self.stop()
        return False

    def _say(self, state: int) -> None:
        self.registers[f"output_int_register_{self._first}"] = state


def is_known(script: bytes) -> bool:
    """Return whether a script is ur_rtde's own, and whole."""
    return _KNOWN_SCRIPT.search(script) is not None
