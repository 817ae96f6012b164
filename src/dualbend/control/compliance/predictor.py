"""Delay compensation: what the deviations on their way will do to the wrench (Smith, 1957).

The deviations sent are passed through the known transport delay, ramp, response, sensor latency and
low-pass. Known stiffness and tool inertia turn them into the part of the wrench read that the
loop itself has made. What is left is the path's error; the admittance then sees it with its own
last deviation in place: a loop without delay.
Source: O. J. M. Smith, Closer control of loops with dead time, Chem. Eng. Prog. 53 (1957) 217.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from dualbend.control.clock import TransferFunction
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import LowPass, LowPassConfig
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.types import Config, Reals, Vector, said

_Lead = Annotated[float, said("what is left of the response's lag [s]", ge=0, le=1)]


class PredictorConfig(Config):
    """What the prediction uses.

    ``lead_*_s``: where given, the error is also passed through the inverse of the response and two
    equal lags of this time: it is then known as of the command and not as of the answer to it,
    and noisier. It fades out linearly over the second half of the way to ``lead_until_rad``: the
    soft bent sheet weighs less in the readings than the tool's inertia does. ``inertia``: of the
    known tool, also on the nominal motion.
    """

    lead_x_s: _Lead | None = None
    lead_rotation_s: _Lead | None = None
    lead_until_rad: Annotated[
        float, said("slope from which there is no lead any more [rad]", gt=0, le=1e3)
    ] = 1e3
    inertia: Annotated[bool, said("take off what the known tool's inertia makes")] = True


class ResponseLead:
    """The response's discrete poles as zeros, and twice the pole r = e^(−T/τ) instead.

    H(z) = (1 − p₁ z⁻¹)(1 − p₂ z⁻¹)(1 − r)² / ((1 − p₁)(1 − p₂)(1 − r z⁻¹)²), with p = e^(s T) of
    the poles s of G(s): unit gain at rest. The errors are of ``shape``.
    """

    def __init__(
        self,
        response: CommandResponseConfig,
        lag_s: float,
        *,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        omega = 2.0 * math.pi * response.natural_frequency_hz
        poles = np.roots([1.0, 2.0 * response.damping_ratio * omega, omega**2])
        zeros = np.real(np.poly(np.exp(poles * period_s)))
        r = math.exp(-period_s / lag_s) if lag_s > 0.0 else 0.0
        self._numerator = (zeros / zeros.sum() * (1.0 - r) ** 2).tolist()
        self._denominator = [1.0, -2.0 * r, r * r]
        self._memory = (np.zeros(shape), np.zeros(shape))

    def update(self, value: Reals) -> Vector:
        """Take one error (...) and return it as of the command."""
        b, a = self._numerator, self._denominator
        first, second = self._memory
        out = np.asarray(b[0] * value + first)
        self._memory = (b[1] * value - a[1] * out + second, b[2] * value - a[2] * out)
        return out

    def transfer_function(self, share: Reals = 1.0) -> TransferFunction:
        """Tell share × H(z) + 1 − share in powers of z⁻¹."""
        numerator, denominator = np.array(self._numerator), np.array(self._denominator)
        return share * numerator + (1.0 - share) * denominator, denominator


def lead_share(config: PredictorConfig, alpha_rad: Reals) -> Vector:
    """Return which share (...) of the error passes through the lead."""
    share = 2.0 - 2.0 * np.asarray(alpha_rad) / config.lead_until_rad
    return np.asarray(np.minimum(np.maximum(share, 0.0), 1.0))


class ResponseModel:
    """Set-points of n channels → positions and accelerations as old as a filtered reading.

    Set-points are (*shape, n) and have a transport delay of ``delay_cycles`` command periods. A
    cycle has ``steps`` physics steps; ``age_steps`` >= 1 is the sensor latency at the start of the
    cycle that uses the reading.
    """

    def __init__(
        self,
        *,
        response: CommandResponseConfig,
        low_pass: LowPassConfig,
        delay_cycles: int,
        steps: int,
        age_steps: int,
        channels: int,
        period_s: float,
        shape: tuple[int, ...] = (),
    ) -> None:
        self.channels = channels
        self._response = CommandResponse(response, channels, steps, period_s=period_s, shape=shape)
        self._delay = TransportDelay(delay_cycles, channels, shape)
        self._low_pass = LowPass(low_pass, 2 * channels, period_s=period_s, shape=shape)
        cycles = math.ceil(age_steps / steps)
        self._row = cycles * steps - age_steps - 1
        self._age = TransportDelay(cycles - 1, 2 * channels, shape)
        self.reset(np.zeros((*shape, channels)))

    def reset(self, position: Vector) -> None:
        """Rest at a position (..., n)."""
        self._response.reset(position)
        self._delay.reset(position)
        still = np.concatenate([position, np.zeros_like(position)], axis=-1)
        self._age.reset(still)
        self._low_pass.reset(still)
        self._last = self._aged = still

    def read(self) -> tuple[Vector, Vector]:
        """Return position and acceleration (..., n) in this cycle's reading; once a cycle."""
        seen = self._low_pass.update(self._aged)
        return seen[..., : self.channels], seen[..., self.channels :]

    def send(self, setpoint: Vector) -> None:
        """Send this cycle's set-point (..., n)."""
        reference = self._response.update(self._delay.update(setpoint))
        both = np.concatenate([reference.position, reference.acceleration], axis=-1)
        sensed = both[..., self._row, :] if self._row >= 0 else self._last
        self._aged = self._age.update(sensed)
        self._last = both[..., -1, :]
