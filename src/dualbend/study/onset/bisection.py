"""Prediction against simulation: the onset of the oscillation, bisected in the full simulation.

On rays in the (b, k) plane, at bending angles that are held, one axis at a time: the b at which a
small disturbance neither grows nor dies out, beside what the three analyses say of it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dualbend.errors import InputError
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


@dataclass(frozen=True, kw_only=True)
class _Task:
    """What one process works on."""

    scenario: Scenario
    axis: SingleAxis
    alpha_rad: float
    ratio_per_s: float
    frictionless: bool

    @property
    def key(self) -> str:
        """A digest of everything that the case depends on."""
        held_at = held(self.scenario, self.axis, self.alpha_rad, (1.0, self.ratio_per_s))
        text = f"{held_at.to_toml()}{self.frictionless}{TOLERANCE}{RATES_AT}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def onset_study(
    scenario: Scenario,
    *,
    rays: Sequence[float] = RAYS_PER_S,
    angles: Sequence[float] = ANGLES_RAD,
    axes: Sequence[SingleAxis] = AXES,
    frictionless: bool = True,
    workers: int | None = None,
    folder: Path | None = None,
    on_run: Callable[[int, int, Case | None], None] = lambda *_: None,
) -> OnsetStudy:
    """Bisect the simulated onset on every ray k/b [1/s], at every angle [rad], for every axis.

    ``frictionless`` also without the joints' dry friction; ``workers`` processes at most, by
    default as many as there are cores. With a ``folder`` every case is kept there as soon as it is
    found, and what is there already of the same scenario is not done again. ``on_run`` as
    :meth:`dualbend.study.engine.Study.run` has it.

    Raises InputError where there is nothing to study, a ray or angle is no positive number, the
    scenario has no such axis, an onset is not found, or the folder cannot be written.
    """
    if scenario.compliance.modelled:
        raise InputError(
            f"--validate: scenario {scenario.name!r} has compliance beyond the paper (schedule, "
            "reference, fusion or predictor): rays in (b, k) say nothing of it"
        )
    if workers is not None and workers < 1:
        raise InputError(f"workers = {workers}: must be at least 1")
    tasks = _tasks(scenario, rays, angles, axes, frictionless=frictionless)
    study = Study(
        design=list(tasks),
        task=lambda key: (tasks[key],),
        run_one=work,
        key=lambda case: case.key,
        summarise=lambda cases: OnsetStudy(scenario=scenario.name, cases=tuple(cases)),
    )
    # Cases of several scenarios and rays may be in one folder: their keys tell them apart.
    kept = None
    if folder is not None:
        kept = StudyFolder(folder=folder, row=Case, study={"kind": "onset"}, row_name="case")
    return study.run(in_processes(workers), kept, on_run)


def _tasks(
    scenario: Scenario,
    rays: Sequence[float],
    angles: Sequence[float],
    axes: Sequence[SingleAxis],
    *,
    frictionless: bool,
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
    tasks = [
        _Task(
            scenario=scenario,
            axis=axis,
            alpha_rad=float(alpha),
            ratio_per_s=float(ray),
            frictionless=frictionless,
        )
        for axis in axes
        for alpha in angles
        for ray in rays
    ]
    # Refuses here, and not in a process, an axis that is off and an angle without room.
    return {task.key: task for task in tasks}


def work(task: _Task) -> Case:
    """Predict and bisect one case."""
    ray = RayLoop(task.scenario, task.axis, task.alpha_rad, task.ratio_per_s)
    predicted = ray.predict()
    found = [
        _bisected(ray, task.axis, predicted.sampled, friction=friction)
        for friction in ((True, False) if task.frictionless else (True,))
    ]
    return Case(
        key=task.key,
        axis=task.axis,
        alpha_rad=task.alpha_rad,
        ratio_per_s=task.ratio_per_s,
        paper_b=predicted.paper,
        delayed_b=predicted.delayed,
        sampled_b=predicted.sampled,
        sampled_hz=predicted.frequency_hz,
        same_gains_hz=ray.mode(found[0].unstable_b).frequency_hz,
        simulated=found[0],
        frictionless=found[1] if task.frictionless else None,
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
            simulated_per_s=_finite(found.growth_per_s),
        )
        for part, found in zip(RATES_AT, after, strict=True)
    )
    return Simulated(
        b=onset,
        unstable_b=low,
        stable_b=high,
        frequency_hz=_finite(seen[low].frequency_hz),
        residual=_finite(after[-1].final),
        rates=rates,
        runs=len(seen) + len(after),
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


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
