"""What keeps a tuned compliance from doing more: margin, noise, delay, force, reach of the arms.

Each answer is an experiment. An axis is made more compliant than the search made it; if its margins
forbid that, they are the limit. If they do not, the same step is simulated without noise of the
sensor, then also without delay: what has to go before the step pays is the limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import msgspec
import numpy as np

from dualbend.control.compliance.admittance import ComplianceConfig, NoComplianceConfig
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.run.record import whole
from dualbend.scenario.scenario import Scenario
from dualbend.stability.plant.environment import scenario_coupling
from dualbend.stability.plant.pose import PosedArm
from dualbend.study.tuning.gains import Gains, Knob, softened, turned
from dualbend.study.tuning.search import (
    Margin,
    min_margin,
    places,
    simulate,
    with_compliance,
)
from dualbend.types import Vector

MORE = 1.6
"""How many times as compliant an axis is made, to see what that costs."""

_NOTICEABLE = 1e-3

_REACH_PLACES, _REACH_M = 21, 5e-5


def limit(
    scenario: Scenario,
    found: ComplianceConfig,
    axis: Literal["x", "rotation"] | None,
    required: Margin,
    seeds: Sequence[int],
) -> str:
    """Return what keeps an axis from being more compliant than it was found, as a sentence.

    None: both, of a class of the user's.
    """
    assert not isinstance(found, NoComplianceConfig)
    more = (
        softened(found, MORE)
        if axis is None
        else turned(found, Knob(axis, "compliance"), MORE, scenario.period_s)
    )
    assert more is not None
    softer = with_compliance(scenario, more)
    margin = min_margin(softer, places(softer))
    if not margin.fulfils(required):
        return f"the margin: {MORE:g} times as compliant it is {said(margin)}"
    changed = _changed(scenario, found, more, seeds)
    rms, peak = 100.0 * changed.mean(axis=0)
    if not math.isfinite(rms):
        return f"the arms: {MORE:g} times as compliant a run does not end as it should"
    if abs(rms) < 100.0 * _NOTICEABLE:
        return f"nothing: {MORE:g} times as compliant the moment is the same"
    if (changed[:, 0] < 0.0).all():
        what = "the peak" if peak > 0.0 else "the steps of the search alone"
        return (
            f"{what}: {MORE:g} times as compliant the rms is {rms:+.2g} %, the peak {peak:+.2g} %"
        )
    quiet = _without_noise(scenario)
    for where, words in (
        (quiet, "the noise of the sensor: without it"),
        (_without_delay(quiet), "the delay: without it (and without noise)"),
    ):
        by = 100.0 * float(_changed(where, found, more, seeds[:1])[0, 0])
        if by < 0.0:
            return f"{words} {MORE:g} times the compliance would lower the rms by {-by:.2g} %"
    yields = axis == "x" and not scenario.compliance.reference
    what = "the end force of the right path, to which it yields" if yields else "the robot's lag"
    return f"{what}: even without noise and delay more compliance raises the rms"


def _changed(scenario: Scenario, before: Gains, after: Gains, seeds: Sequence[int]) -> Vector:
    """Return by which part rms and peak change (seeds, 2) from one compliance to another."""
    each = [with_compliance(scenario, gains) for gains in (before, after)]
    moments = [found for found, _ in simulate([(one, seed) for one in each for seed in seeds])]
    old, new = np.array(moments).reshape(2, len(seeds), -1)
    # Where runs of both stop, ∞/∞ says that nothing can be said.
    with np.errstate(invalid="ignore"):
        return np.asarray(new / old - 1.0)


def said(margin: Margin) -> str:
    """Return margins as a person says them."""
    if margin.gain_db == -np.inf:
        return "unstable"
    return f"{margin.gain_db:.1f} dB, {margin.phase_deg:.0f} deg"


def beginning(scenario: Scenario, compliance: Gains) -> Iterator[str]:
    """Yield what of the moment is over before the compliance begins, if it does not act at once."""
    axes = [axis for axis in (compliance.x, compliance.rotation) if axis is not None]
    if not axes:
        return
    first = min(axis.from_alpha_rad for axis in axes)
    nothing = NoComplianceConfig(sensing=compliance.sensing)
    run = whole(make_run(with_compliance(scenario, nothing)).run())
    side = run.sensing_side
    alpha, moment = run.trace["nominal_alpha"], run.trace[f"{side}_true_moment_y"]
    bending = run.trace["phase"] == run.phases.index("bend")
    early = bending & (alpha < first)
    if first <= scenario.path.start_rad or not early.any():
        return
    share = float((moment[early] ** 2).sum() / (moment[bending] ** 2).sum())
    at = float(alpha[bending][np.argmax(np.abs(moment[bending]))])
    peak = f", and so is the peak, at {at:.2f} rad" if at < first else ""
    yield (
        f"{100.0 * share:.0f} % of the mean square of the moment are over when the compliance "
        f"begins, at {first:g} rad{peak}"
    )


def reach(scenario: Scenario, compliance: Gains) -> Iterator[str]:
    """Yield where the arms cannot follow x as far as it may deviate, if there is such a place."""
    if compliance.x is None:
        return
    path = scenario.path.make(scenario.sheet.length_m)
    start, end = scenario.path.start_rad, scenario.path.end_rad
    arm: PosedArm | None = None
    found: list[tuple[float, str, float]] = []
    for alpha in np.linspace(start, end, _REACH_PLACES).tolist():
        half_distance, rise = path.at(alpha)
        pose = np.array([-half_distance, scenario.cell.sheet_height_m + rise, alpha])
        arm = arm or PosedArm(scenario, pose)
        along = scenario_coupling(scenario, alpha).deviation_jacobian[:, 0]
        for way, sign in (("inward", 1.0), ("outward", -1.0)):
            found.append((_room(arm, pose, sign * along, compliance.limit_x_m), way, alpha))
    room, way, alpha = min(found)
    if room < compliance.limit_x_m:
        yield (
            f"the reach of the arms: at {alpha:.2f} rad they can go {1e3 * room:.1f} mm {way} of "
            f"the path, and x may deviate by {1e3 * compliance.limit_x_m:g} mm; a run that asks "
            "for more stops"
        )


def _room(arm: PosedArm, pose: Vector, along: Vector, most: float) -> float:
    """Return how far an arm can go from a pose along a direction, at most ``most`` [m]."""
    low, high = 0.0, most
    by = most
    while high - low > _REACH_M:
        try:
            arm.move(pose + by * along)
            low = by
        except InputError:
            high = by
        by = (low + high) / 2.0
    arm.move(pose)
    return low


def _without_noise(scenario: Scenario) -> Scenario:
    sensor = msgspec.structs.replace(scenario.sensor, force_noise_n=0.0, torque_noise_nm=0.0)
    return msgspec.structs.replace(scenario, sensor=sensor)


def _without_delay(scenario: Scenario) -> Scenario:
    return msgspec.structs.replace(
        scenario,
        robot=scenario.robot.with_delay(0),
        sensor=msgspec.structs.replace(scenario.sensor, latency_ms=0.0),
    )
