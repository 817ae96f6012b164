"""The outputs of RTDE that a controller of PolyScope 5.11 has, and which of them the cell knows."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from itertools import chain

import msgspec
import numpy as np

from dualbend.control.alter import turn
from dualbend.serve.port import ArmState
from dualbend.serve.robot.pose import rotation_vector_of
from dualbend.serve.robot.ur.program import REGISTERS, Program
from dualbend.serve.robot.ur.wire import NOT_FOUND, Number
from dualbend.types import Vector

CONTROLLER = (5, 11, 0, 0)
"""Version of the controller that the robot says it is: major, minor, bug fix, build."""

_RUNNING, _JOINT_RUNNING, _NORMAL = 7, 253, 1


class Told(msgspec.Struct, frozen=True):
    """What the variables of a cycle are made of.

    Attributes
    ----------
    state, before : of this cycle and of the one before it
    period_s : between both
    payload_kg, payload_m : mass and centre (3,) of what the wrist bears, in the sensor's axes
    """

    state: ArmState
    before: ArmState
    program: Program
    period_s: float
    payload_kg: float
    payload_m: Vector

    def speed(self, part: Callable[[ArmState], Vector]) -> Sequence[Number]:
        """Return the backward difference of a part of the state, by time."""
        rate: list[float] = ((part(self.state) - part(self.before)) / self.period_s).tolist()
        return rate

    def tcp_speed(self, part: Callable[[ArmState], Vector]) -> Sequence[Number]:
        """Return the speed (6,) of a pose [m/s, rad/s] along the base's axes."""
        now, before = part(self.state), part(self.before)
        turned = np.array(rotation_vector_of(turn(now[3:]) @ turn(before[3:]).T))
        rate: list[float] = (
            np.concatenate((now[:3] - before[:3], turned)) / self.period_s
        ).tolist()
        return rate

    @property
    def force(self) -> list[float]:
        """Wrench (6,) of the sheet on the arm, about the grip, along the base's axes."""
        assert self.state.force is not None
        force: list[float] = self.state.force.tolist()
        return force


def pose_of(pose: Vector) -> list[float]:
    """Return x, y, z [m], rotation vector [rad] of a pose (6,)."""
    return [*pose[:3].tolist(), *rotation_vector_of(turn(pose[3:]))]


def _measured(state: ArmState) -> Vector:
    return state.measured


def _nominal(state: ArmState) -> Vector:
    return state.nominal


def _joints(state: ArmState) -> Vector:
    return np.radians(state.joints)


def _setpoint(state: ArmState) -> Vector:
    return np.radians(state.setpoint)


def _wrench(told: Told) -> list[float]:
    assert told.state.wrench is not None
    wrench: list[float] = told.state.wrench.tolist()
    return wrench


_Value = Callable[[Told], Sequence[Number]]
_KNOWN: dict[str, tuple[str, _Value]] = {
    "timestamp": ("DOUBLE", lambda told: [(told.state.cycle + 1) * told.period_s]),
    "target_q": ("VECTOR6D", lambda told: _setpoint(told.state).tolist()),
    "target_qd": ("VECTOR6D", lambda told: told.speed(_setpoint)),
    "actual_q": ("VECTOR6D", lambda told: _joints(told.state).tolist()),
    "actual_qd": ("VECTOR6D", lambda told: told.speed(_joints)),
    "actual_TCP_pose": ("VECTOR6D", lambda told: pose_of(told.state.measured)),
    "actual_TCP_speed": ("VECTOR6D", lambda told: told.tcp_speed(_measured)),
    "target_TCP_pose": ("VECTOR6D", lambda told: pose_of(told.state.nominal)),
    "target_TCP_speed": ("VECTOR6D", lambda told: told.tcp_speed(_nominal)),
    "actual_digital_input_bits": ("UINT64", lambda told: [0]),
    "actual_digital_output_bits": ("UINT64", lambda told: [0]),
    "robot_mode": ("INT32", lambda told: [_RUNNING]),
    "joint_mode": ("VECTOR6INT32", lambda told: [_JOINT_RUNNING] * 6),
    "safety_mode": ("INT32", lambda told: [_NORMAL]),
    "safety_status": ("INT32", lambda told: [_NORMAL]),
    "safety_status_bits": ("UINT32", lambda told: [1]),
    "robot_status_bits": ("UINT32", lambda told: [1 | told.program.running << 1]),
    "runtime_state": ("UINT32", lambda told: [1 + told.program.running]),
    "speed_scaling": ("DOUBLE", lambda told: [1.0]),
    "target_speed_fraction": ("DOUBLE", lambda told: [1.0]),
    "payload": ("DOUBLE", lambda told: [told.payload_kg]),
    "payload_cog": ("VECTOR3D", lambda told: told.payload_m.tolist()),
    "output_bit_registers0_to_31": ("UINT32", lambda told: [0]),
    "output_bit_registers32_to_63": ("UINT32", lambda told: [0]),
}
"""Nothing is wired to the cell's inputs and outputs: their bits are 0."""

_SENSED: dict[str, tuple[str, _Value]] = {
    "actual_TCP_force": ("VECTOR6D", lambda told: told.force),
    "tcp_force_scalar": ("DOUBLE", lambda told: [math.hypot(*told.force[:3])]),
    "ft_raw_wrench": ("VECTOR6D", _wrench),
}
"""Of an arm with a sensor."""

UNKNOWN = {
    name: kind
    for kind, names in {
        "DOUBLE": "actual_execution_time actual_momentum actual_main_voltage actual_robot_voltage "
        "actual_robot_current standard_analog_input0 standard_analog_input1 "
        "standard_analog_output0 standard_analog_output1 io_current euromap67_24V_voltage "
        "euromap67_24V_current tool_analog_input0 tool_analog_input1 tool_output_current "
        "tool_temperature",
        "VECTOR6D": "target_qdd target_current target_moment actual_current joint_control_output "
        "joint_temperatures actual_joint_voltage payload_inertia",
        "VECTOR3D": "actual_tool_accelerometer elbow_position elbow_velocity",
        "UINT32": "analog_io_types euromap67_input_bits euromap67_output_bits tool_mode "
        "tool_analog_input_types script_control_line",
        "INT32": "tool_output_voltage",
        "UINT8": "tool_output_mode tool_digital_output0_mode tool_digital_output1_mode",
    }.items()
    for name in names.split()
}
"""What such a controller has and the cell does not know."""

_REGISTER = re.compile(r"(in|out)put_(int|double|bit)_register_(\d{1,3})", re.ASCII)
_REGISTER_TYPES = {"int": "INT32", "double": "DOUBLE", "bit": "BOOL"}


def register_type(name: str, way: str) -> str | None:
    """Return the type of a general purpose register; None: there is no such one."""
    found = _REGISTER.fullmatch(name)
    if found is None or found[1] != way or int(found[3]) not in REGISTERS[found[2]]:
        return None
    return _REGISTER_TYPES[found[2]]


def output_type(name: str, *, sensed: bool, zero: bool) -> str:
    """Return the type of an output, or NOT_FOUND.

    ``sensed``: the arm has a sensor; ``zero``: what the cell does not know is there, and is 0.
    """
    if name in _KNOWN:
        return _KNOWN[name][0]
    if name in _SENSED and (sensed or zero):
        return _SENSED[name][0]
    if name in UNKNOWN and zero:
        return UNKNOWN[name]
    return register_type(name, "out") or register_type(name, "in") or NOT_FOUND


def values_of(names: Sequence[str], told: Told) -> list[Number]:
    """Return the numbers of outputs that were found, in a row."""
    return list(chain.from_iterable(_value_of(name, told) for name in names))


def _value_of(name: str, told: Told) -> Sequence[Number]:
    if name in _KNOWN:
        return _KNOWN[name][1](told)
    if name in _SENSED:
        if told.state.force is not None:
            return _SENSED[name][1](told)
        return [0.0] * (1 if name == "tcp_force_scalar" else 6)
    if name in UNKNOWN:
        return [0] * {"VECTOR6D": 6, "VECTOR3D": 3}.get(UNKNOWN[name], 1)
    return [told.program.registers.get(name, 0)]
