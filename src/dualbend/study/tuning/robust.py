"""Gains whose worst case over the imperfections of a preset has the least moment.

A case is as bad as its moment over the one without compliance. The search goes on with the worst
cases alone: what it finds is simulated with every imperfection,
and where another one turns out worse than those it was searched with, that one is added and the
search goes on from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Literal

import msgspec
import numpy as np

from dualbend.control.compliance.admittance import ComplianceConfig, NoComplianceConfig
from dualbend.errors import InputError
from dualbend.imperfection.config import PresetName
from dualbend.imperfection.sheet import true_sheet
from dualbend.scenario.scenario import Scenario, variants
from dualbend.scenario.sheet import with_true_numbers
from dualbend.study.tuning.gains import Gains, Knob, acting_axes, softened, turned
from dualbend.study.tuning.limits import MORE, said
from dualbend.study.tuning.search import (
    MOST_TRIES,
    Margin,
    Search,
    simulate,
    with_compliance,
)
from dualbend.study.tuning.tuning import SEARCH_SEEDS, start_of
from dualbend.types import Vector

_ROUNDS = 3
"""Searches at most, each with one more of the worst cases."""


class Case(msgspec.Struct, frozen=True, kw_only=True):
    """What a scenario's run is with one imperfection: mean rms of the moment [N m] over seeds.

    ``none_nm`` without compliance, ``own_nm`` with the scenario's own (NaN where it has none),
    ``found_nm`` with the gains found; infinite where a run does not complete.
    """

    name: str
    none_nm: float
    own_nm: float
    found_nm: float

    @property
    def ratio(self) -> float:
        """Moment with the gains found over that without compliance."""
        return self.found_nm / self.none_nm


class RobustTuning(msgspec.Struct, frozen=True, kw_only=True):
    """The result: gains, margins of their worst loop, all cases, and what limits each axis.

    ``left_out``: imperfections with which a run without compliance does not complete.
    """

    compliance: Gains
    margin: Margin
    cases: tuple[Case, ...]
    searched: tuple[str, ...]
    left_out: tuple[str, ...]
    limits: tuple[str, ...]
    tried: int

    @property
    def worst(self) -> Case:
        """The case with the largest ratio."""
        return max(self.cases, key=lambda case: case.ratio)


def tune_robust(
    scenario: Scenario,
    preset: PresetName,
    *,
    required: Margin,
    seeds: int = 2,
    on_progress: Callable[[float], None] = lambda _: None,
) -> RobustTuning:
    """Search gains that are better in the worst cases of a preset, at margins that hold in all.

    ``seeds``: runs of every case, from the scenario's seed on. Raises InputError where nothing
    complies along the path, the loop cannot be predicted, or a perfect cell without compliance
    does not complete.
    """
    every = variants(scenario, preset)
    start = start_of(scenario)
    looked = [scenario.seed + i for i in range(seeds)]
    nothing = NoComplianceConfig(sensing=start.sensing)
    without = _moments(every, nothing, looked)
    worlds = {name: world for name, world in every.items() if np.isfinite(without[name]).all()}
    if "none" not in worlds:
        raise InputError(
            f"{scenario.name}: without compliance and imperfections its run does not complete, so "
            "there is nothing to compare with"
        )
    own = _moments(worlds, start, looked)
    found, tried = start, 0
    searched = [
        name for name in dict.fromkeys(("none", "all", _worst(own, without))) if name in worlds
    ]
    for round_ in range(_ROUNDS):
        search = Search(
            scenario=scenario,
            required=required,
            seeds=SEARCH_SEEDS[:1],
            peak_nm=float(np.mean([without[name][:, 1].mean() for name in searched])),
            on_try=partial(_told, on_progress, round_),
            worlds=[worlds[name] for name in searched],
            alone_nm=[float(without[name][:, 0].mean()) for name in searched],
            loops=_loops(every, looked),
        )
        found = search.run(found)[0].compliance
        tried += search.tried
        moments = _moments(worlds, found, looked)
        if (worst := _worst(moments, without)) in searched:
            break
        searched.append(worst)
    limits = [
        f"{axis} is limited by {_limit(search, worlds, found, axis, moments, looked)}"
        for axis in acting_axes(start, scenario.path.end_rad)
    ] or [f"all gains are limited by {_limit(search, worlds, found, None, moments, looked)}"]
    on_progress(1.0)
    return RobustTuning(
        compliance=found,
        margin=search.margin(found),
        cases=tuple(
            Case(
                name=name,
                none_nm=float(without[name][:, 0].mean()),
                own_nm=float(own[name][:, 0].mean()),
                found_nm=float(moments[name][:, 0].mean()),
            )
            for name in worlds
        ),
        searched=tuple(searched),
        left_out=tuple(name for name in every if name not in worlds),
        limits=tuple(limits),
        tried=tried,
    )


def _told(on_progress: Callable[[float], None], round_: int, tried: int) -> None:
    """Tell the share that is done."""
    on_progress((round_ + tried / MOST_TRIES) / _ROUNDS)


def _loops(worlds: Mapping[str, Scenario], seeds: Sequence[int]) -> list[Scenario]:
    """Return the loops beside the believed one: with the sheets as drawn, and a cycle late."""
    every, loops = worlds["all"], dict[Scenario, None]()
    believed = every.sheet.sheet()
    for seed in seeds:
        true = true_sheet(believed, every.imperfections.sheet, seed)
        sheet = with_true_numbers(every.sheet, true)
        loops[msgspec.structs.replace(worlds["none"], sheet=sheet)] = None
    if every.imperfections.link.errs:
        later = every.robot.with_delay(every.robot.longest_delay + 1)
        loops.update({msgspec.structs.replace(loop, robot=later): None for loop in list(loops)})
    return list(loops)


def _moments(
    worlds: Mapping[str, Scenario], compliance: ComplianceConfig, seeds: Sequence[int]
) -> dict[str, Vector]:
    """Return rms and peak of the moment (seeds, 2) [N m] of each, infinite where a run stops."""
    with_it = [with_compliance(world, compliance) for world in worlds.values()]
    moments = [found for found, _ in simulate([(one, seed) for one in with_it for seed in seeds])]
    return dict(zip(worlds, np.array(moments).reshape(len(worlds), len(seeds), -1), strict=True))


def _worst(moments: Mapping[str, Vector], without: Mapping[str, Vector]) -> str:
    """Return the case whose mean rms is the largest over that without compliance."""
    return max(moments, key=lambda name: moments[name][:, 0].mean() / without[name][:, 0].mean())


def _limit(
    search: Search,
    worlds: Mapping[str, Scenario],
    found: Gains,
    axis: Literal["x", "rotation"] | None,
    moments: Mapping[str, Vector],
    seeds: Sequence[int],
) -> str:
    """Return which imperfection keeps an axis, or all, from being more compliant, as a sentence."""
    more = (
        softened(found, MORE)
        if axis is None
        else turned(found, Knob(axis, "compliance"), MORE, search.scenario.period_s)
    )
    assert more is not None
    margin = search.margin(more)
    if not margin.fulfils(search.required):
        return f"the margin: {MORE:g} times as compliant it is {said(margin)}"
    changes = {
        name: float((with_more / moments[name])[:, 0].mean() - 1.0)
        for name, with_more in _moments(worlds, more, seeds).items()
    }
    name = max(changes, key=lambda each: changes[each])
    if not math.isfinite(changes[name]):
        return f"{name}: {MORE:g} times as compliant a run with it does not complete"
    return f"{name}: {MORE:g} times as compliant its rms changes by {100.0 * changes[name]:+.2g} %"
