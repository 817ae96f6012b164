"""Prediction against simulation: where the oscillation sets in, looked for in the full simulation.

On rays in the (b, k) plane, at bending angles that are held, one axis at a time: the b at which a
small disturbance neither grows nor decays, beside what the three analyses say of it. What an onset
is stands in two places: :func:`dualbend.study.onset.held.evaluate` says whether one run grows,
:func:`dualbend.study.onset.threshold.threshold` makes one b of many runs.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from dualbend.errors import InputError
from dualbend.evaluation.metrics import finite
from dualbend.scenario.scenario import Scenario
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.onset.design import Point
from dualbend.study.onset.held import Oscillation, SingleAxis, held, oscillate
from dualbend.study.onset.prediction import RayLoop
from dualbend.study.onset.results import Case, OnsetStudy, Rate, Simulated
from dualbend.study.onset.threshold import AGREEING, STEP, threshold
from dualbend.study.processes import in_processes

RATES_AT = (0.9, 1.1)
"""Where growth rates are compared, as parts of the simulated onset: unstable and stable."""

_SMALLER = 0.05

CRITERION = (
    f"second half less what is slow, threshold of {AGREEING} runs, step {STEP}, rates at {RATES_AT}"
)
"""In every case's key: what was found by another criterion is not taken for this one's."""

_Task = tuple[str, Scenario, SingleAxis, float, float]
"""Key, a digest of everything that the case depends on; scenario, axis, angle and ray."""


def onset_study(
    scenario: Scenario,
    points: Sequence[Point],
    *,
    workers: int | None = None,
    folder: Path | None = None,
    on_run: Callable[[int, int, Case | None], None] = lambda *_: None,
) -> OnsetStudy:
    """Find the simulated onset of every case, with and without the joints' dry friction.

    ``workers`` processes at most, by default as many as there are cores. With a ``folder`` every
    case is kept there as soon as it is found, and what is there already of the same scenario is not
    done again. ``on_run`` as :meth:`dualbend.study.engine.Study.run` has it.

    Raises InputError where there is nothing to study, a ray or angle is no positive number, the
    scenario has no such axis, an onset is not found, or the folder cannot be written.
    """
    if beyond := scenario.compliance.beyond:
        raise InputError(
            f"--validate: scenario {scenario.name!r}: {beyond}: rays in (b, k) say nothing of it"
        )
    tasks = _tasks(scenario, points)
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


def _tasks(scenario: Scenario, points: Sequence[Point]) -> dict[str, _Task]:
    if not points:
        raise InputError("points: none given, nothing to study")
    if not scenario.compliance.complying:
        raise InputError("compliance.complying = []: no compliance, nothing to study")
    found = {}
    for axis, alpha, ray in points:
        for name, value in (("ray", ray), ("angle", alpha)):
            if not 0.0 < value < math.inf:
                raise InputError(f"{name}: {value!r} must be positive and finite")
        # Refuses here, and not in a process, an axis that is off and an angle without room.
        held_at = held(scenario, axis, alpha, (1.0, ray))
        key = hashlib.sha256(f"{held_at.to_toml()}{CRITERION}".encode()).hexdigest()[:16]
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
    """Predict and simulate one case."""
    ray = RayLoop(scenario, axis, alpha_rad, ratio_per_s)
    predicted = ray.predict()
    simulated, frictionless = (
        _simulated(ray, axis, predicted.sampled, friction=friction) for friction in (True, False)
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
        same_gains_hz=ray.mode(simulated.growing_b).frequency_hz,
        simulated=simulated,
        frictionless=frictionless,
    )


def _simulated(ray: RayLoop, axis: SingleAxis, guess: float, *, friction: bool) -> Simulated:
    seen: dict[float, Oscillation] = {}

    def grow(asked: Sequence[float]) -> list[bool]:
        runs = oscillate([ray.held(b) for b in asked], axis, friction=friction)
        seen.update(zip(asked, runs, strict=True))
        return [run.grows for run in runs]

    found = threshold(grow, guess)
    nearest = min((b for b in seen if seen[b].grows), key=lambda b: abs(math.log(b / found.b)))
    # Without friction a small disturbance has more room to grow before the bound.
    small = 1.0 if friction else _SMALLER
    parts = [(part * found.b, small if part < 1.0 else 1.0) for part in RATES_AT]
    after = oscillate([ray.held(*each) for each in parts], axis, friction=friction)
    rates = tuple(
        Rate(
            b=part * found.b,
            predicted_per_s=ray.mode(part * found.b).growth_per_s,
            simulated_per_s=finite(run.growth_per_s),
        )
        for part, run in zip(RATES_AT, after, strict=True)
    )
    return Simulated(
        b=found.b,
        unstable_b=found.unstable,
        stable_b=found.stable,
        growing_b=nearest,
        frequency_hz=finite(seen[nearest].frequency_hz),
        residual=finite(after[-1].final),
        rates=rates,
        runs=found.runs + len(after),
    )
