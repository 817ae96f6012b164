"""Checks of the paper's discrete admittance (13)-(15), its gains, its clock and its filter."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import (
    Admittance,
    AdmittanceAxis,
    AdmittanceConfig,
)
from dualbend.control.compliance.base import AdmittanceForm, AxisConfig
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import FirConfig, IirConfig, LowPass, LowPassConfig, NoFilterConfig
from dualbend.control.response import CommandResponse, CommandResponseConfig
from dualbend.errors import InputError
from dualbend.stability.margins import loop_margins
from dualbend.stability.sampled import LoopElements, SampledLoop

Kind = Literal["fir", "iir"]
STEPS = 16
"""Physics steps in a cycle of the checked loop."""


def axis(b: float, k: float, form: AdmittanceForm = "printed") -> AdmittanceAxis:
    """Return one admittance filter as the simulation runs it, b and k in units of the user's."""
    part = admittance(b, k, form).x
    assert part is not None
    return part


def admittance(b: float, k: float, form: AdmittanceForm = "printed") -> Admittance:
    """Return the admittance along x alone, without a bound, b and k in units of the user's."""
    config = AdmittanceConfig(x=AxisConfig(b=b, k=k, form=form), units="si", limit_x_m=math.inf)
    return Admittance(config, period_s=COMMAND_PERIOD_S)


def impulse_error(b: float, k: float) -> float:
    """Return the largest difference of (13) from the impulse response of (8), times b."""
    times = np.linspace(0.0, 5.0 * b / k, 201)
    _, response = signal.impulse(([1.0], [b, k]), T=times)
    return float(np.abs(b * response - np.exp(-k / b * times)).max())


def recursion_error(b: float, k: float, period_s: float) -> float:
    """Return the largest difference of (15) from the impulse response of (14), times b."""
    pole, samples = math.exp(-k / b * period_s), 20
    unit = np.zeros(samples)
    unit[0] = 1.0
    transfer = signal.lfilter([1.0 / b], [1.0, -pole], unit)
    runs = admittance(b, k)
    streamed = [runs.update(np.array([f, 0.0]))[0] for f in unit]
    return float(np.abs(b * (transfer - streamed)).max())


def static_ratio(b: float, k: float, form: AdmittanceForm = "printed") -> float:
    """Return the deviation under a steady load over that of the spring k."""
    return k * axis(b, k, form).static_compliance


def missing_factor(b: float, k: float) -> float:
    """Return by which factor (14) falls short of impulse invariance: 1 over the factor [1/s]."""
    return axis(b, k).static_compliance / axis(b, k, "impulse-invariant").static_compliance


def pole(b: float, k: float) -> float:
    """Return e^(−kT/b) of (14)."""
    return axis(b, k).pole


def static_stiffness(b: float, k: float) -> float:
    """Return the stiffness that (15) really has, in the unit of k."""
    return 1.0 / axis(b, k).static_compliance


def rate_hz(period_s: float) -> float:
    """Return the rate of a period [Hz]."""
    return 1.0 / period_s


def damping_ratio(omega_rad_per_s: float, two_xi_omega: float) -> float:
    """Return ξ of (16)."""
    return two_xi_omega / (2.0 * omega_rad_per_s)


def tracking_lag_s(omega_rad_per_s: float, two_xi_omega: float) -> float:
    """Return how far (16) lags behind a ramp, 2ξ/ω_n [s]."""
    return two_xi_omega / omega_rad_per_s**2


def low_pass(kind: Kind, size: int, cutoff_hz: float) -> LowPass:
    """Return a filter: ``size`` is the number of FIR taps or the Butterworth order."""
    config: LowPassConfig = IirConfig(order=size, cutoff_hz=cutoff_hz)
    if kind == "fir":
        config = FirConfig(taps=size, cutoff_hz=cutoff_hz)
    return LowPass(config, 1, period_s=COMMAND_PERIOD_S)


def nyquist_share(cutoff_hz: float) -> float:
    """Return the cut-off over half the command rate."""
    return 2.0 * COMMAND_PERIOD_S * cutoff_hz


def filter_delay_ms(kind: Kind, size: int, cutoff_hz: float, frequency_hz: float = 2.0) -> float:
    """Return the group delay [ms] of a filter at the command rate, at 2 Hz by default."""
    return 1e3 * low_pass(kind, size, cutoff_hz).group_delay_s(frequency_hz)


def noise_left(kind: Kind, size: int, cutoff_hz: float) -> float:
    """Return which part of white noise (rms) a filter lets through."""
    numerator, denominator = low_pass(kind, size, cutoff_hz).transfer_function()
    unit = np.zeros(400)
    unit[0] = 1.0
    return float(np.linalg.norm(signal.lfilter(numerator, denominator, unit)))


def longest_quicker_fir(order: int, cutoff_hz: float) -> int:
    """Return how many taps a FIR may have to delay 2 Hz less than a Butterworth of an order."""
    limit = filter_delay_ms("iir", order, cutoff_hz)
    return max(n for n in range(1, 40) if 0.5e3 * (n - 1) * COMMAND_PERIOD_S < limit)


def elements(
    b: float,
    k: float,
    *,
    form: AdmittanceForm = "printed",
    natural_frequency_hz: float = 2.0,
    two_xi_omega: float = 25.0,
    delay_cycles: int = 0,
    filtered: tuple[Kind, int, float] | None = None,
) -> LoopElements:
    """Return the sampled loop of one axis in one consistent unit, read at the cycle's start."""
    ratio = damping_ratio(2.0 * math.pi * natural_frequency_hz, two_xi_omega)
    if not ratio > 0.0:
        raise InputError(f"two_xi_omega = {two_xi_omega!r}: must be positive")
    robot = CommandResponseConfig(natural_frequency_hz=natural_frequency_hz, damping_ratio=ratio)
    none = LowPass(NoFilterConfig(), 1, period_s=COMMAND_PERIOD_S)
    return LoopElements(
        response=CommandResponse(robot, 1, STEPS, period_s=COMMAND_PERIOD_S),
        low_pass=low_pass(*filtered) if filtered else none,
        delay=TransportDelay(delay_cycles, 1),
        admittance=admittance(b, k, form),
        age_steps=0,
    )


def largest_stiffness(parts: LoopElements) -> float:
    """Return the largest k_e, in the unit of k, at which the sampled loop is stable."""
    loop = SampledLoop(parts, np.eye(2), (True, False))
    return loop_margins(loop, stable=True).gain


def sampled_stiffness(
    b: float, k: float, delay_cycles: int = 0, form: AdmittanceForm = "printed"
) -> float:
    """Return the largest stable k_e of the sampled loop of the paper's robot, 28 ms ramps."""
    return largest_stiffness(elements(b, k, form=form, delay_cycles=delay_cycles))


def filtered_stiffness(b: float, k: float, kind: Kind, size: int, cutoff_hz: float) -> float:
    """Return the same with a low-pass filter and two cycles of delay."""
    return largest_stiffness(elements(b, k, delay_cycles=2, filtered=(kind, size, cutoff_hz)))
