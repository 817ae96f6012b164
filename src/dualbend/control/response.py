"""The robot's positioning response G(s) = ω_n² / (s² + 2ξω_n s + ω_n²), paper (16).

It is driven by joint set-points that are interpolated linearly over each command period, and is
solved exactly: no integration error at any physics step.
"""

import math
from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from dualbend.control.clock import TransferFunction
from dualbend.errors import InputError
from dualbend.types import Config, Vector, said


class CommandResponseConfig(Config):
    """Natural frequency and damping of every joint's response.

    The defaults are the limits that the paper quotes for the PUMA 560: 2 Hz, 2ξω_n = 25 rad/s.
    """

    natural_frequency_hz: Annotated[
        float, said("undamped natural frequency [Hz]", gt=0, le=1e3)
    ] = 2.0
    damping_ratio: Annotated[float, said("ξ, 1 is critical [-]", gt=0, le=100)] = 0.995


class CommandReference(msgspec.Struct, frozen=True, kw_only=True):
    """Reference at the end of each physics step of a cycle, each (..., steps, joints).

    Position [rad], velocity [rad/s] and acceleration [rad/s²]; the last row is the cycle's end.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector


def _ramp_solution(omega: float, ratio: float, times_s: Vector) -> Vector:
    """Return (3, times, 4): y, y', y'' at each time per unit of (y₀, y'₀, u_prev, u_next).

    The last time is the end of the ramp.
    """
    # Van Loan: the ramp's value and slope are states too, so one exponential solves it all.
    augmented = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-(omega**2), -2.0 * ratio * omega, omega**2, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    from_setpoints = np.eye(4)
    from_setpoints[3] = [0.0, 0.0, -1.0 / times_s[-1], 1.0 / times_s[-1]]
    solution = linalg.expm(augmented * times_s[:, np.newaxis, np.newaxis]) @ from_setpoints
    return np.stack([solution[:, 0], solution[:, 1], augmented[1] @ solution])


class CommandResponse:
    """Exact response of n joints to ramps between set-points, at m physics steps per cycle.

    Over a cycle u(t) = u_prev + (u_next − u_prev) t/T; with Z = (y, y', u_prev, u_next) the whole
    cycle is one product, reference = M Z.

    Under-, over- and critically damped alike; set-points are (*shape, joints).

    Raises
    ------
    InputError
        No joint or no step.
    """

    def __init__(
        self,
        config: CommandResponseConfig,
        joints: int,
        steps: int,
        *,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        if joints < 1 or steps < 1:
            raise InputError(f"joints = {joints}, steps = {steps}: need at least 1 of both")
        self.config = config
        self.joints, self.steps, self.period_s = joints, steps, period_s
        times_s = period_s * np.arange(1, steps + 1) / steps
        omega = 2.0 * math.pi * config.natural_frequency_hz
        self._matrix = _ramp_solution(omega, config.damping_ratio, times_s).reshape(3 * steps, 4)
        self._state = np.zeros((*shape, 4, joints))

    @property
    def position(self) -> Vector:
        """Reference position at the end of the last cycle (..., joints) [rad]."""
        position: Vector = self._state[..., 0, :].copy()
        return position

    @property
    def speed(self) -> Vector:
        """Reference speed at the end of the last cycle (..., joints) [rad/s]."""
        speed: Vector = self._state[..., 1, :].copy()
        return speed

    def reset(self, position: ArrayLike) -> None:
        """Rest at a position (..., joints) [rad] that is also the last set-point."""
        self._state[..., 0, :] = self._state[..., 2, :] = position
        self._state[..., 1, :] = 0.0

    def update(self, setpoint: Vector) -> CommandReference:
        """Run one cycle towards a set-point (..., joints) [rad], reached by the ramp at its end."""
        state, steps = self._state, self.steps
        state[..., 3, :] = setpoint
        reference = self._matrix @ state
        state[..., :2, :] = reference[..., steps - 1 : 2 * steps : steps, :]
        state[..., 2, :] = setpoint
        return CommandReference(
            position=reference[..., :steps, :],
            velocity=reference[..., steps : 2 * steps, :],
            acceleration=reference[..., 2 * steps :, :],
        )

    def state_space(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Tell one joint's cycle as (A, B, C, D), state (y, y', u_prev) and input u_next.

        The output is the position at the **start** of the cycle, where the sensor is read and
        before u_next acts; hence D = 0.
        """
        end = self._matrix[[self.steps - 1, 2 * self.steps - 1]]
        a = np.vstack([end[:, :3], np.zeros(3)])
        b = np.vstack([end[:, 3:], np.ones(1)])
        return a, b, np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 1))

    def outputs_at(self, step: int) -> tuple[Vector, Vector]:
        """Tell position and acceleration at the end of a physics step (0, 1, ...) of the cycle.

        They are C x + D u_next with the state x of `state_space`: C (2, 3), D (2, 1), rows of the
        matrix that `update` multiplies with.
        """
        rows = self._matrix[[step, 2 * self.steps + step]]
        return rows[:, :3], rows[:, 3:]

    def transfer_function(self) -> TransferFunction:
        """Tell set-point to position at the start of the cycle, in powers of z⁻¹."""
        from scipy import signal  # noqa: PLC0415 - 1 s to import, and the loop never asks for this

        numerator, denominator = signal.ss2tf(*self.state_space())
        return np.asarray(numerator[0], dtype=np.float64), np.asarray(denominator, dtype=np.float64)


class ArmResponses:
    """Responses of several arms, the joints of one after those of the other in every vector."""

    def __init__(self, responses: Sequence[CommandResponse]) -> None:
        self._responses, self.steps = responses, responses[0].steps
        self._ends = np.cumsum([response.joints for response in responses])[:-1]

    @property
    def position(self) -> Vector:
        """Reference position at the end of the last cycle (..., joints) [rad]."""
        return np.concatenate([response.position for response in self._responses], axis=-1)

    @property
    def speed(self) -> Vector:
        """Reference speed at the end of the last cycle (..., joints) [rad/s]."""
        return np.concatenate([response.speed for response in self._responses], axis=-1)

    def reset(self, position: ArrayLike) -> None:
        """Rest at a position (..., joints) [rad] that is also the last set-point."""
        parts = np.split(np.asarray(position), self._ends, axis=-1)
        for response, part in zip(self._responses, parts, strict=True):
            response.reset(part)

    def update(self, setpoint: Vector) -> CommandReference:
        """Run one cycle towards a set-point (..., joints) [rad], reached by the ramp at its end."""
        parts = np.split(setpoint, self._ends, axis=-1)
        found = [r.update(part) for r, part in zip(self._responses, parts, strict=True)]
        return CommandReference(
            **{
                name: np.concatenate([getattr(one, name) for one in found], axis=-1)
                for name in CommandReference.__struct_fields__
            }
        )
