"""What keeps a tuned compliance from doing more: margin, noise, delay, or the force itself.

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
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario
from dualbend.stability.gains import Gains, Knob, turned
from dualbend.stability.search import (
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


def limit(
    scenario: Scenario,
    found: ComplianceConfig,
    axis: Literal["x", "rotation"],
    required: Margin,
    seeds: Sequence[int],
) -> str:
    """Return what keeps an axis from being more compliant than it was found, as a sentence."""
    assert not isinstance(found, NoComplianceConfig)
    more = turned(found, Knob(axis, "compliance"), MORE)
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
    old, new = (
        np.array([simulate(with_compliance(scenario, gains), seed)[0] for seed in seeds])
        for gains in (before, after)
    )
    return np.asarray(new / old - 1.0)


def said(margin: Margin) -> str:
    """Return margins as a person says them."""
    if margin.gain_db == -np.inf:
        return "unstable"
    return f"{margin.gain_db:.1f} dB, {margin.phase_deg:.0f} deg"


def beginning(scenario: Scenario, compliance: Gains) -> Iterator[str]:
    """Yield what of the moment is over before the compliance begins, if it does not act at once."""
    axes = [axis for axis in (compliance.x, compliance.rotation) if axis is not None]
    first = min(axis.from_alpha_rad for axis in axes)
    nothing = NoComplianceConfig(sensing=compliance.sensing)
    run = make_run(with_compliance(scenario, nothing)).run()
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


def _without_noise(scenario: Scenario) -> Scenario:
    sensor = msgspec.structs.replace(scenario.sensor, force_noise_n=0.0, torque_noise_nm=0.0)
    return msgspec.structs.replace(scenario, sensor=sensor)


def _without_delay(scenario: Scenario) -> Scenario:
    alter = msgspec.structs.replace(scenario.robot.alter, delay_cycles=0)
    return msgspec.structs.replace(
        scenario,
        robot=msgspec.structs.replace(scenario.robot, alter=alter),
        sensor=msgspec.structs.replace(scenario.sensor, latency_ms=0.0),
    )
