"""Gains with the least simulated moment at required margins, compared with what there was before.

The search simulates with noise of its own seeds. Then three controllers are simulated with other
seeds: none, the scenario's own and the one found. The found one is returned only if it is better
than both by more than the noise of a run could be.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
import tomli_w

from dualbend.control.compliance.admittance import (
    ComplianceConfig,
    ModelAdmittanceConfig,
    NoComplianceConfig,
)
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.compliance.mass_spring_damper import MassSpringDamperConfig
from dualbend.control.compliance.own import OwnComplianceConfig
from dualbend.control.compliance.predictor import PredictorConfig
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.control.compliance.schedule import FusionConfig, ScheduleConfig
from dualbend.errors import InputError, brief, writing
from dualbend.files import write_whole
from dualbend.run.record import task_of
from dualbend.scenario.scenario import Scenario, without_none
from dualbend.scene.sheet.strips import StripConfig
from dualbend.stability.prediction import predict
from dualbend.study.tuning.gains import Gains, acting_axes, softened
from dualbend.study.tuning.limits import beginning, limit, reach
from dualbend.study.tuning.search import (
    MOST_TRIES,
    UNSTABLE,
    Margin,
    Search,
    Trial,
    simulate,
    with_compliance,
)
from dualbend.types import Vector

BEYOND_THE_PAPER = ModelAdmittanceConfig(
    units="sheet",
    x=AxisConfig(b=0.025, k=0.01, form="static"),
    rotation=AxisConfig(b=0.2, k=0.01, form="static"),
    schedule=ScheduleConfig(from_rad=0.016, curve=True),
    reference=ReferenceConfig(),
    fusion=FusionConfig(moment_error_nm=0.01),
    predictor=PredictorConfig(lead_x_s=0.021, lead_until_rad=0.6),
)
"""Where the search starts for a scenario without a compliance."""

SEARCH_SEEDS = (1_000_001, 1_000_002)
"""Of the search's noise: hardly those with which a result is looked at."""

_LOOKED_AT = 3
_SEARCH = 0.8
"""Its share of the time, about."""

_DEVIATIONS = 3.0
"""Standard deviations between two runs. With five seeds a further run is worse in 3 % of cases."""

_ROUNDING = 1e-9

_STIFFER, _MOST_STIFFENED = 0.5, 10

_STRIPS = "simulated with strips as stiff as a plate: a shell takes 180 times as long"

Name = Literal["none", "own", "tuned"]
SAID = {"none": "no compliance", "own": "the scenario's own", "tuned": "tuned"}


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """A controller, what it simulates with every seed of the comparison, and its margins.

    ``moments`` (seeds, 2): rms and peak of the moment while the sheet is bent [N m]; ``stops``: how
    runs ended that did not complete, whose moments are infinite.
    """

    name: Name
    compliance: ComplianceConfig
    margin: Margin
    moments: Vector
    stops: tuple[str, ...] = ()

    @property
    def rms_nm(self) -> float:
        """Mean rms of the moment [N m]."""
        return float(self.moments[:, 0].mean())

    @property
    def peak_nm(self) -> float:
        """Mean peak of the moment [N m]."""
        return float(self.moments[:, 1].mean())

    @property
    def stopped(self) -> str:
        """How many runs stop, and how the first one does."""
        return f"{len(self.stops)} of {len(self.moments)} runs stop: {self.stops[0]}"


class Tuning(msgspec.Struct, frozen=True, kw_only=True):
    """The result: the scenario with the best controller, and how all of them compare.

    ``outcomes``: none, the scenario's own where it has one, and the best found, which is there also
    where it is not better; ``limits``: what keeps that from doing more, in sentences.
    """

    scenario: Scenario
    required: Margin
    chosen: Outcome
    outcomes: tuple[Outcome, ...]
    limits: tuple[str, ...]
    tried: int

    @property
    def found(self) -> Outcome:
        """The best gains found with the required margins, also where they are not the result."""
        return self.outcomes[-1]

    @property
    def verdict(self) -> str:
        """What the simulation says of the result, in one sentence."""
        if self.chosen is self.found:
            parts = [
                f"{100.0 * (1.0 - self.found.rms_nm / other.rms_nm):.2g} % below {SAID[other.name]}"
                for other in self.outcomes[:-1]
                if not other.stops
            ]
            alone = "the only one whose runs end as they should"
            return f"tuned: the rms is {' and '.join(parts)}" if parts else f"tuned: {alone}"
        why = (
            f"with the best gains found {self.found.stopped}"
            if self.found.stops
            else "no gains with these margins were found that are better by more than the noise of "
            "a run"
        )
        return f"{SAID[self.chosen.name]} stays{self._although}: {why}"

    @property
    def _although(self) -> str:
        """What speaks against one that stays."""
        if not self.chosen.margin.fulfils(self.required):
            return ", although its margins are below the required ones"
        for other in self.outcomes[:-1]:
            if other.rms_nm < self.chosen.rms_nm:
                higher = 100.0 * (other.peak_nm / self.chosen.peak_nm - 1.0)
                return f", since with {SAID[other.name]} the peak is {higher:.2g} % higher"
        return ""


def _stays(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the scenario's own where it is worse than no compliance in nothing, else the latter.

    A run that stops has infinite moments; equal peaks before the compliance begins differ by
    rounding.
    """
    none, *rest = outcomes
    for own in rest:
        if own.rms_nm <= none.rms_nm and own.peak_nm <= none.peak_nm * (1.0 + _ROUNDING):
            return own
    return none


def surpasses(new: Vector, old: Vector) -> bool:
    """Return whether moments (seeds, 2) are smaller in rms and not larger in peak, for certain.

    The mean of ln(old/new), seed by seed, is at least 3 of its standard deviations above 0; that
    of the peaks may be 0, since a peak before the compliance begins is the same to the bit.
    """
    if not np.isfinite(new).all():
        return False
    if not np.isfinite(old).all():
        return True
    gained = np.log(old / new)
    rms, peak = gained.mean(axis=0) - _DEVIATIONS * gained.std(axis=0, ddof=1)
    return bool(rms > 0.0 and peak >= -_ROUNDING)


def tune(
    scenario: Scenario,
    *,
    required: Margin,
    seeds: int = 5,
    on_progress: Callable[[float], None] = lambda _: None,
) -> Tuning:
    """Search the gains of a scenario's compliance; form, units and everything else stay.

    Where no axis is on the start is `BEYOND_THE_PAPER`. ``seeds``: how many runs, from the
    scenario's seed on, compare the controllers; ``on_progress`` is told the share that is done.

    Raises InputError where nothing complies along the path, or the loop cannot be predicted.
    """
    given, scenario = scenario, _with_strips(scenario)
    own, start = _own(scenario), start_of(scenario)
    outcomes = [_outcome("none", scenario, NoComplianceConfig(sensing=start.sensing), seeds)]
    if own:
        outcomes.append(_outcome("own", scenario, own, seeds))
    search = Search(
        scenario=scenario,
        required=required,
        seeds=SEARCH_SEEDS,
        peak_nm=min(outcome.peak_nm for outcome in outcomes),
        on_try=lambda tried: on_progress(_SEARCH * tried / MOST_TRIES),
    )
    trials = search.run(start)
    found, better, stopped = _compared(scenario, trials, outcomes, required, seeds)
    on_progress(_SEARCH + (1.0 - _SEARCH) / 2.0)
    limits = (
        [
            f"all gains are limited by runs that stop: {_STIFFER**-2:g} times as compliant "
            f"{stopped.stopped}"
        ]
        if stopped
        else [
            f"{axis} is limited by "
            + limit(scenario, found.compliance, axis, required, SEARCH_SEEDS)
            for axis in acting_axes(start, scenario.path.end_rad)
        ]
        or [
            "all gains are limited by "
            + limit(scenario, found.compliance, None, required, SEARCH_SEEDS)
        ]
    )
    on_progress(1.0)
    chosen = found if better else _stays(outcomes)
    return Tuning(
        scenario=msgspec.structs.replace(
            with_compliance(given, chosen.compliance), name=f"{given.name}-tuned"
        ),
        required=required,
        chosen=chosen,
        outcomes=(*outcomes, found),
        limits=(
            *limits,
            *reach(scenario, start),
            *beginning(scenario, start),
            *([_STRIPS] if given != scenario else []),
        ),
        tried=search.tried,
    )


def _with_strips(scenario: Scenario) -> Scenario:
    """Return the scenario with strips, of the stiffness of a plate, in the place of a shell."""
    sheet = scenario.sheet
    if isinstance(sheet.model, StripConfig):
        return scenario
    sheet = msgspec.structs.replace(sheet, model=StripConfig(), rigidity="plate")
    return msgspec.structs.replace(scenario, sheet=sheet)


def _own(scenario: Scenario) -> Gains | None:
    """Return the scenario's own compliance, None where it has no axis."""
    if "rms_moment" not in task_of(scenario).part("tolerances"):
        raise InputError(
            f"task.kind = {scenario.task.kind!r}: its runs have no rms_moment, which tune makes "
            "small; a bending run has"
        )
    config, end = scenario.compliance, scenario.path.end_rad
    if not config.complying:
        raise InputError("compliance.complying = []: no arm complies, so there is nothing to tune")
    if isinstance(config, OwnComplianceConfig):
        if not config.gains:
            raise InputError(
                f"compliance.kind = {brief(config.controller)}: its attribute gains names no "
                "option that tune may change (docs/your-controller.md)"
            )
        return config
    if isinstance(config, MassSpringDamperConfig):
        return config
    if isinstance(config, NoComplianceConfig) or not (config.x or config.rotation):
        return None
    if not acting_axes(config, end):
        first = min(axis.from_alpha_rad for axis in (config.x, config.rotation) if axis)
        raise InputError(
            f"compliance: it begins at {first:g} rad, where the path has ended ({end:g} rad): "
            "nothing to tune; let from_alpha_rad be smaller"
        )
    return config


def start_of(scenario: Scenario) -> Gains:
    """Return the gains that a search starts from: the scenario's own, else `BEYOND_THE_PAPER`."""
    given = scenario.compliance
    return _own(scenario) or msgspec.structs.replace(
        BEYOND_THE_PAPER, sensing=given.sensing, complying=given.complying
    )


def _outcome(name: Name, scenario: Scenario, compliance: ComplianceConfig, seeds: int) -> Outcome:
    """Simulate a controller with every seed of the comparison, and predict its margins."""
    with_it = with_compliance(scenario, compliance)
    rows, margin = predict(with_it).rows, UNSTABLE
    if all(row.stable for row in rows):
        margin = Margin(
            gain_db=min((row.gain_margin_db for row in rows), default=math.inf),
            phase_deg=min((row.phase_margin_deg for row in rows), default=math.inf),
        )
    # What does not listen to the sensor has the same moment with every seed.
    listens = name != "none"
    each = simulate((with_it, scenario.seed + i) for i in range(seeds if listens else 1))
    return Outcome(
        name=name,
        compliance=compliance,
        margin=margin,
        moments=np.array([found for found, _ in (each if listens else each * seeds)]),
        stops=tuple(words for _, words in each if words),
    )


def _compared(
    scenario: Scenario,
    trials: Sequence[Trial],
    outcomes: Sequence[Outcome],
    required: Margin,
    seeds: int,
) -> tuple[Outcome, bool, Outcome | None]:
    """Return the best trial that is better than all outcomes, else the best one, and whether.

    The third is what was too compliant, if runs of the trials stop and stiffer gains had to do.
    """

    def better(found: Outcome) -> bool:
        return found.margin.fulfils(required) and all(
            surpasses(found.moments, other.moments) for other in outcomes
        )

    found = []
    for trial in trials[:_LOOKED_AT]:
        found.append(_outcome("tuned", scenario, trial.compliance, seeds))
        if better(found[-1]):
            return found[-1], True, None
    stiffer, stopped = _stiffened(scenario, found[0], seeds)
    return (stiffer, True, stopped) if stopped and better(stiffer) else (found[0], False, None)


def _stiffened(scenario: Scenario, found: Outcome, seeds: int) -> tuple[Outcome, Outcome | None]:
    """Return gains of which no run stops, and the stiffest tried of which one does.

    Halved until no run stops, and once more, since other noise goes further than that of a few
    runs. Gains of which no run stops stay.
    """
    stopped = None
    for _ in range(_MOST_STIFFENED):
        if not found.stops:
            break
        stopped, found = found, _halved(scenario, found, seeds)
    return (_halved(scenario, found, seeds), stopped) if stopped else (found, None)


def _halved(scenario: Scenario, found: Outcome, seeds: int) -> Outcome:
    assert not isinstance(found.compliance, NoComplianceConfig)
    return _outcome("tuned", scenario, softened(found.compliance, _STIFFER), seeds)


def write_scenario(tuning: Tuning, base: str, path: Path) -> None:
    """Write the tuned scenario as a file that extends ``base``, a shipped name or a file."""
    said = f"{base} as dualbend tune leaves it: {SAID[tuning.chosen.name]}"
    write_compliance(tuning.chosen.compliance, base, tuning.scenario.name, path, said)


def write_compliance(
    compliance: ComplianceConfig, base: str, name: str, path: Path, description: str = ""
) -> None:
    """Write a scenario that extends ``base`` by a compliance."""
    extends = os.path.relpath(base, path.parent) if base.endswith(".toml") else base
    table: dict[str, Any] = {
        "extends": extends,
        "name": name,
        "description": description or f"{base} with gains that dualbend tune found",
        "compliance": without_none(msgspec.to_builtins(compliance)),
    }
    with writing(path, "--out"):
        write_whole(path, tomli_w.dumps(table))
