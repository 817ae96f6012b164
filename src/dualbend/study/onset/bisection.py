"""Prediction against simulation: the onset of the oscillation, bisected in the full simulation.

On rays in the (b, k) plane, at bending angles that are held, one axis at a time: the b at which a
small disturbance neither grows nor decays, beside what the three analyses say of it.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from dualbend.errors import InputError
from dualbend.evaluation.metrics import finite
from dualbend.scenario.scenario import Scenario
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.onset.held import Oscillation, SingleAxis, held, oscillate
from dualbend.study.onset.prediction import RayLoop
from dualbend.study.onset.results import Case, OnsetStudy, Rate, Simulated
from dualbend.study.processes import in_processes

RAYS_PER_S: tuple[float, ...] = (5.0, 20.0, 80.0, 1600.0)
"""k/b of the default rays [1/s]: the filter's pole is 0.87, 0.57, 0.11 and 0."""

ANGLES_RAD: tuple[float, ...] = (0.2, 0.5, 0.8)
AXES: tuple[SingleAxis, ...] = ("x", "rotation")

TOLERANCE = 0.01
"""How far the ends of a bisected interval are apart, relative."""

RATES_AT = (0.9, 1.1)
"""Where growth rates are compared, as parts of the simulated onset: unstable and stable."""

_BRACKET, _WIDENINGS, _SMALLER = 1.3, 8, 0.05

_Task = tuple[str, Scenario, SingleAxis, float, float]
"""Key, a digest of everything that the case depends on; scenario, axis, angle and ray."""


def onset_study(
    scenario: Scenario,
    *,
    rays: Sequence[float] = RAYS_PER_S,
    angles: Sequence[float] = ANGLES_RAD,
    axes: Sequence[SingleAxis] = AXES,
    workers: int | None = None,
    folder: Path | None = None,
    on_run: Callable[[int, int, Case | None], None] = lambda *_: None,
) -> OnsetStudy:
    """Bisect the simulated onset on every ray k/b [1/s], at every angle [rad], for every axis.

    Each also without the joints' dry friction. ``workers`` processes at most, by default as many
    as there are cores. With a ``folder`` every case is kept there as soon as it is found, and what
    is there already of the same scenario is not done again. ``on_run`` as
    :meth:`dualbend.study.engine.Study.run` has it.

    Raises InputError where there is nothing to study, a ray or angle is no positive number, the
    scenario has no such axis, an onset is not found, or the folder cannot be written.
    """
    if scenario.compliance.modelled:
        raise InputError(
            f"--validate: scenario {scenario.name!r} has compliance beyond the paper (schedule, "
            "reference, fusion or predictor): rays in (b, k) say nothing of it"
        )
    tasks = _tasks(scenario, rays, angles, axes)
    study = Study(
        design=list(tasks), task=tasks.__getitem__, run_one=work, key=lambda case: case.key
    )
    # Cases of several scenarios and rays may be in one folder: their keys tell them apart.
    kept = None
    if folder is not None:
        check = partial(_refuse_strangers, tasks)
        kept = StudyFolder(folder=folder, row=Case, study={"kind": "onset"}, check=check)
    cases = study.run(in_processes(workers), kept, on_run)
    return OnsetStudy(scenario=scenario.name, cases=tuple(cases))


def _tasks(
    scenario: Scenario,
    rays: Sequence[float],
    angles: Sequence[float],
    axes: Sequence[SingleAxis],
) -> dict[str, _Task]:
    for name, values in (("rays", rays), ("angles", angles), ("axes", axes)):
        if not values:
            raise InputError(f"{name}: none given, nothing to study")
    for name, numbers in (("rays", rays), ("angles", angles)):
        for value in numbers:
            if not 0.0 < value < math.inf:
                raise InputError(f"{name}: {value!r} must be positive and finite")
    if not scenario.compliance.complying:
        raise InputError("compliance.complying = []: no compliance, nothing to study")
    found = {}
    for axis, alpha, ray in itertools.product(axes, map(float, angles), map(float, rays)):
        # Refuses here, and not in a process, an axis that is off and an angle without room.
        held_at = held(scenario, axis, alpha, (1.0, ray))
        # "True": also without friction, which was a choice when the first folders were written.
        text = f"{held_at.to_toml()}True{TOLERANCE}{RATES_AT}"
        key = hashlib.sha256(text.encode()).hexdigest()[:16]
        found[key] = (key, scenario, axis, alpha, ray)
    return found


def _refuse_strangers(tasks: Mapping[str, _Task], cases: Sequence[Case]) -> None:
    """Refuse a case whose key is that of another one, or whose onset is not in its interval."""
    for case in cases:
        at = f"case {case.key}"
        said = (case.axis, case.alpha_rad, case.ratio_per_s)
        if case.key in tasks and said != (asked := tasks[case.key][2:]):
            raise InputError(f"{at}: is of {said}, its key of {asked} (axis, angle, ray)")
        for name, found in (("simulated", case.simulated), ("frictionless", case.frictionless)):
            if not 0.0 < found.unstable_b <= found.b <= found.stable_b:
                raise InputError(
                    f"{at}: {name}.b = {found.b} must be positive and between unstable_b = "
                    f"{found.unstable_b} and stable_b = {found.stable_b}"
                )


def work(
    key: str, scenario: Scenario, axis: SingleAxis, alpha_rad: float, ratio_per_s: float
) -> Case:
    """Predict and bisect one case."""
    ray = RayLoop(scenario, axis, alpha_rad, ratio_per_s)
    predicted = ray.predict()
    simulated, frictionless = (
        _bisected(ray, axis, predicted.sampled, friction=friction) for friction in (True, False)
    )
    return Case(
        key=key,
        axis=axis,
        alpha_rad=alpha_rad,
        ratio_per_s=ratio_per_s,
        paper_b=predicted.paper,
        delayed_b=predicted.delayed,
        sampled_b=predicted.sampled,
        sampled_hz=predicted.frequency_hz,
        same_gains_hz=ray.mode(simulated.unstable_b).frequency_hz,
        simulated=simulated,
        frictionless=frictionless,
    )


def _bisected(ray: RayLoop, axis: SingleAxis, guess: float, *, friction: bool) -> Simulated:
    seen: dict[float, Oscillation] = {}

    def run(b: float) -> Oscillation:
        seen[b] = oscillate(ray.held(b), axis, friction=friction)
        return seen[b]

    low, high = bracketed(lambda b: run(b).grows, guess)
    onset = math.sqrt(low * high)
    # Without friction a small disturbance has more room to grow before the bound.
    small = 1.0 if friction else _SMALLER
    after = [
        oscillate(ray.held(part * onset, small if part < 1.0 else 1.0), axis, friction=friction)
        for part in RATES_AT
    ]
    rates = tuple(
        Rate(
            b=part * onset,
            predicted_per_s=ray.mode(part * onset).growth_per_s,
            simulated_per_s=finite(found.growth_per_s),
        )
        for part, found in zip(RATES_AT, after, strict=True)
    )
    return Simulated(
        b=onset,
        unstable_b=low,
        stable_b=high,
        frequency_hz=finite(seen[low].frequency_hz),
        residual=finite(after[-1].final),
        rates=rates,
        runs=len(seen) + len(after),
    )


def bracketed(
    grows: Callable[[float], bool], guess: float, tolerance: float = TOLERANCE
) -> tuple[float, float]:
    """Return b that grows and, 1 % above, b that does not; the guess is only where to begin.

    Raises InputError where no change is found within a factor of eight.
    """
    oscillates = grows(guess)
    last = guess
    for _ in range(_WIDENINGS):
        beyond = last * _BRACKET if oscillates else last / _BRACKET
        if grows(beyond) != oscillates:
            break
        last = beyond
    else:
        low, high = sorted((guess, beyond))
        found = "all oscillate" if oscillates else "none oscillates"
        raise InputError(f"no onset between b = {low:.3g} and {high:.3g}: {found}")
    low, high = sorted((last, beyond))
    while high > low * (1.0 + tolerance):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if grows(middle) else (low, middle)
    return low, high
