"""The full simulation held at one bending angle, and whether a small disturbance grows in it.

The scenario is kept, with both arms, sheet, servos, sensor chain and dry friction. Only the motion
is replaced: settle a little below the angle, a step to it, hold. The axis looked at is switched on
and tared during the step, so that the arms rest at the angle itself whatever the gains.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import msgspec
import mujoco
import numpy as np

from dualbend.batch.many import run_many
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.servo import JointServo
from dualbend.errors import InputError, refusing
from dualbend.run.record import RunRecord
from dualbend.scenario.motion import MotionConfig
from dualbend.scenario.path import ExactPathConfig
from dualbend.scenario.scenario import Scenario
from dualbend.study.ending import record_of
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES, Vector

SingleAxis = Literal["x", "rotation"]

_STEP_RAD, _STEP_PART = 0.02, 0.01
"""The disturbance: small for the sheet, large for what dry friction does about standstill."""

SETTLE_S, HOLD_S, WINDOW_S = 1.0, 6.0, 0.7
_TRANSIENT_S = 0.5
_SLOW_DEGREE = 7
"""Over the whole run, half of it over a half: takes off what is below 0.4 Hz."""
_AT_BOUND = 0.5
"""An oscillation of this part of the bound, rms, is held by it."""


@dataclass(frozen=True, kw_only=True)
class Oscillation:
    """What became of the disturbance.

    ``grows``: the criterion of an onset, see :func:`evaluate`; ``growth_per_s``: of its effective
    value while it is neither cut off by the bound nor lost in what stays; ``frequency_hz``: over
    the second half; ``final``: rms of the deviation in the last 0.7 s [m] or [rad], infinite where
    the run did not end as planned.
    """

    grows: bool
    growth_per_s: float
    frequency_hz: float
    final: float


def disturbance(axis: SingleAxis, alpha_rad: float) -> float:
    """Return the step of the bending angle [rad]: along x a flat sheet is linear for less."""
    return _STEP_RAD if axis == "rotation" else _STEP_PART * alpha_rad


def held(
    scenario: Scenario,
    axis: SingleAxis,
    alpha_rad: float,
    gains: tuple[float, float],
    part: float = 1.0,
) -> Scenario:
    """Return the scenario held at a bending angle with one axis at b and k [its own units].

    ``part`` of the usual disturbance, to have more room for growth.

    Raises InputError for gains that are not positive, an angle without room for the step and an
    axis that the scenario does not have.
    """
    b, k = gains
    for name, value in (("b", b), ("k", k)):
        if not 0.0 < value < math.inf:
            raise InputError(f"compliance.{axis}.{name} = {value!r}: must be positive and finite")
    step = part * disturbance(axis, alpha_rad)
    if not alpha_rad > 2.0 * step:
        raise InputError(f"angle {alpha_rad!r}: must be above {2.0 * step} rad")
    given: AxisConfig | None = getattr(scenario.compliance, axis)
    if given is None:
        raise InputError(f"compliance.{axis} is off: nothing to study")
    moved = msgspec.structs.replace(given, b=b, k=k, from_alpha_rad=alpha_rad - step / 2.0)
    alone = {"x": None, "rotation": None, axis: moved}
    compliance = msgspec.structs.replace(scenario.compliance, **alone, tare=True)
    with refusing(f"angle {alpha_rad!r}"):
        path = ExactPathConfig(start_rad=alpha_rad - step, end_rad=alpha_rad)
    return msgspec.structs.replace(
        scenario,
        path=path,
        # One cycle for the step: the robot's own response makes it smooth.
        motion=MotionConfig(
            speed_rad_per_s=step / scenario.period_s, settle_s=SETTLE_S, hold_s=HOLD_S
        ),
        compliance=compliance,
        sensor=msgspec.structs.replace(
            scenario.sensor,
            force_noise_n=0.0,
            torque_noise_nm=0.0,
            force_resolution_n=0.0,
            torque_resolution_nm=0.0,
        ),
    )


def oscillate(
    scenarios: Sequence[Scenario], axis: SingleAxis, *, friction: bool = True
) -> list[Oscillation]:
    """Run held scenarios, as a batch, and say of each whether the disturbance grows.

    ``friction``: of the joints.
    """
    runs = [BendingRun(each) if friction else without_friction(each) for each in scenarios]
    ended = dict(run_many(runs))
    return [_oscillation(run, ended[i], axis) for i, run in enumerate(runs)]


def _oscillation(ready: BendingRun, record: RunRecord | Exception, axis: SingleAxis) -> Oscillation:
    trace, scenario = record_of(record).trace, ready.scenario
    name = "x" if axis == "x" else "alpha"
    side = next(side for side in SIDES if side in scenario.compliance.complying)
    limit = scenario.compliance.limit_x_m if axis == "x" else scenario.compliance.limit_rotation_rad
    period_s = scenario.period_s
    first = math.ceil((SETTLE_S + _TRANSIENT_S) / period_s)
    cycles = ready.motion.cycles
    deviation = trace[f"{side}_deviation_{name}"][first:]
    return evaluate(deviation[np.isfinite(deviation)], cycles - first, limit, period_s)


def evaluate(deviation: Vector, planned: int, limit: float, period_s: float) -> Oscillation:
    """Evaluate a deviation (n,) [m] or [rad], a sample per period, ``planned`` of them at most.

    What is slow is taken off first, as a polynomial of degree 7 over the whole run: it leaves less
    than 1 % of a decay in 0.3 s or slower, and of an oscillation at 0.8 Hz or faster all but its
    ends. The disturbance grows if the effective value (standard deviation) of the rest
    over the second half of the run exceeds that over the first, the logarithmic decrement between
    the halves being positive:

        σ = ln(rms₂ / rms₁) / (T/2),    for exp(σt) cos(ωt + φ) the rate itself, whatever φ

    but for the parts of a period that a half cuts off. So its sign is that of the growth rate of
    the mode that swings, which is what the prediction says of the loop. Halves, and not windows
    within them: friction and the bound make an oscillation wax and wane over one or two seconds, so
    that a short window says where in a swell it happens to lie.

    It grows, too, where the second half is held by the bound, for an oscillation at the bound
    grows no further; and where the run ended before it was planned to.
    """
    window = round(WINDOW_S / period_s)
    if deviation.size < planned or deviation.size < 4 * window:
        return Oscillation(grows=True, growth_per_s=math.inf, frequency_hz=math.nan, final=math.inf)
    parts = np.lib.stride_tricks.sliding_window_view(deviation, window)
    size = parts.std(axis=1)
    first, final = float(size[0]), float(size[-1])
    cap = _AT_BOUND * limit
    middle = deviation.size // 2
    swing = _less_slow(deviation, _SLOW_DEGREE)
    earlier, later = float(swing[:middle].std()), float(swing[middle:].std())
    grows = later > min(earlier, cap)
    # What the bound holds, and what comes near the remainder that friction keeps, tells no rate.
    telling = size < cap if grows else size > min(3.0 * final, math.sqrt(first * final))
    stop = int(np.argmin(telling)) if not telling.all() else size.size
    times = period_s * np.arange(stop)
    rate = float(np.polyfit(times, np.log(size[:stop]), 1)[0]) if stop >= window else math.nan
    return Oscillation(
        grows=grows,
        growth_per_s=rate,
        frequency_hz=dominant_frequency(deviation[middle:], period_s),
        final=final,
    )


def _less_slow(signal: Vector, degree: int) -> Vector:
    samples = np.arange(signal.size)
    return signal - np.polynomial.Polynomial.fit(samples, signal, degree)(samples)


def dominant_frequency(signal: Vector, period_s: float) -> float:
    """Return the frequency [Hz] of the largest line: a parabola through a padded spectrum."""
    padded = 16 * signal.size
    swing = _less_slow(signal, _SLOW_DEGREE // 2)
    spectrum = np.abs(np.fft.rfft(swing * np.hanning(signal.size), padded))
    peak = int(np.clip(np.argmax(spectrum), 1, spectrum.size - 2))
    below, top, above = np.log(np.maximum(spectrum[peak - 1 : peak + 2], 1e-300))
    bend = below - 2.0 * top + above
    shift = 0.5 * (below - above) / bend if bend else 0.0
    return float((peak + shift) / (padded * period_s))


def without_friction(scenario: Scenario) -> BendingRun:
    """Return a run without dry friction of the joints, and without what is fed forward for it."""
    imperfections = scenario.imperfections
    # Stiction writes the friction anew at every step.
    robot = msgspec.structs.replace(imperfections.robot, stiction_excess=0.0)
    imperfections = msgspec.structs.replace(imperfections, robot=robot)
    ready = BendingRun(msgspec.structs.replace(scenario, imperfections=imperfections))
    model, servo = ready.cell.simulation.model, ready.cell.servo
    for joint in ready.cell.simulation.joints:
        model.dof_frictionloss[model.joint(joint).dofadr] = 0.0
    nothing = np.zeros_like(servo.stiffness)
    robots: mujoco.MjModel = ready.cell.ik.model
    ready.cell.servo = JointServo(
        stiffness=servo.stiffness,
        inertia=servo.setpoint(nothing, nothing, nothing + 1.0) * servo.stiffness,
        viscous_friction=robots.dof_damping.copy().ravel(),
        coulomb_friction=nothing,
        damping_ratio=scenario.robot.servo.damping_ratio,
    )
    return ready
