"""Gains with the lowest predicted moment at required margins, verified by simulation."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomli_w

from dualbend.control.compliance.admittance import AxisConfig, ModelAdmittanceConfig
from dualbend.control.compliance.predictor import PredictorConfig
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.control.compliance.schedule import FusionConfig, ScheduleConfig
from dualbend.errors import InputError, writing
from dualbend.evaluation.metrics import peak_by_piece
from dualbend.files import write_whole
from dualbend.run.known_sheet import make_admittance
from dualbend.run.make import make_run
from dualbend.scenario.scenario import Scenario, without_none
from dualbend.stability.margins import loop_margins
from dualbend.stability.path_prediction import PathPrediction
from dualbend.stability.plant.environment import Environment, environments
from dualbend.stability.prediction import predict
from dualbend.stability.sampled import LoopElements, environment_loops

BEYOND_THE_PAPER = ModelAdmittanceConfig(
    units="sheet",
    x=AxisConfig(b=0.025, k=0.01, form="static"),
    rotation=AxisConfig(b=0.2, k=0.01, form="static"),
    schedule=ScheduleConfig(from_rad=0.016, curve=True),
    reference=ReferenceConfig(),
    fusion=FusionConfig(moment_error_nm=0.01),
    predictor=PredictorConfig(lead_x_s=0.021, lead_until_rad=0.6),
)
"""Where the search starts for a scenario without a schedule."""

_STEPS = (1.6, 1.25, 1.1)
"""Factors by which the gains are changed, one after the other."""

_SMALLEST_S, _LARGEST_S = 2e-3, 2.0
_ANGLE_STEP_RAD = 0.1


class Margin(msgspec.Struct, frozen=True, kw_only=True):
    """The smallest margins along the path: gain [dB], phase [degrees]; both −inf where unstable."""

    gain_db: float
    phase_deg: float

    def fulfils(self, required: Margin) -> bool:
        """Neither is below what is required."""
        return self.gain_db >= required.gain_db and self.phase_deg >= required.phase_deg


_UNSTABLE = Margin(gain_db=-math.inf, phase_deg=-math.inf)


class Candidate(msgspec.Struct, frozen=True, kw_only=True):
    """Gains, their margins and the predicted peaks of the pieces [N m], means over the seeds."""

    compliance: ModelAdmittanceConfig
    margin: Margin
    peaks: tuple[float, ...]

    @property
    def cost(self) -> float:
        """Sum of the pieces' peaks [N m]: a single piece cannot hide the others."""
        return sum(self.peaks)


class Tuning(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a search, and of the simulation with it.

    ``without``: predicted peaks by piece without compliance; ``simulated``: peaks by piece, one row
    per seed; ``verified``: the margins that `dualbend stability` predicts for the result.
    """

    scenario: Scenario
    found: Candidate
    tried: int
    without: tuple[float, ...]
    simulated: tuple[tuple[float, ...], ...]
    verified: Margin


def tune(scenario: Scenario, *, required: Margin, seeds: Sequence[int] = (1, 2, 3)) -> Tuning:
    """Search the time constants of a scenario's compliance.

    The scenario's own compliance is the start where it has a schedule, else `BEYOND_THE_PAPER`.
    b of both axes and the leads that are given are changed one after the other by factors; gains
    with less than the required margins are not taken.

    Raises InputError where not even slower gains have the required margins.
    """
    given = scenario.compliance
    compliance = msgspec.structs.replace(
        BEYOND_THE_PAPER, sensing=given.sensing, complying=given.complying
    )
    if isinstance(given, ModelAdmittanceConfig) and given.schedule:
        compliance = given
    start = msgspec.structs.replace(scenario, compliance=compliance)
    search = _Search(start, required, seeds)
    found = search.run()
    tuned = msgspec.structs.replace(
        start, name=f"{scenario.name}-tuned", compliance=found.compliance
    )
    rows, verified = predict(tuned).rows, _UNSTABLE
    if all(row.stable for row in rows):
        verified = Margin(
            gain_db=min(row.gain_margin_db for row in rows),
            phase_deg=min(row.phase_margin_deg for row in rows),
        )
    return Tuning(
        scenario=tuned,
        found=found,
        tried=search.tried,
        without=tuple(search.path.peaks(None, search.noises[0]).tolist()),
        simulated=tuple(_simulated(tuned, seed) for seed in seeds),
        verified=verified,
    )


def _simulated(scenario: Scenario, seed: int) -> tuple[float, ...]:
    result = make_run(msgspec.structs.replace(scenario, seed=seed)).run()
    if result.outcome != "completed":
        raise InputError(f"the simulation with the gains found ended as {result.outcome}")
    return tuple(peak_by_piece(result))


class _Search:
    """Coordinate search: change one gain after the other as long as the cost falls."""

    def __init__(self, scenario: Scenario, required: Margin, seeds: Sequence[int]) -> None:
        self.scenario, self.required, self.tried = scenario, required, 0
        self.path = PathPrediction(scenario)
        self.noises = [self.path.noise(seed) for seed in seeds]
        # Of the start's gains: with a force reference the equilibrium hardly depends on them.
        first, last = scenario.path.start_rad, scenario.path.end_rad
        count = math.ceil((last - first) / _ANGLE_STEP_RAD) + 1
        angles = sorted({*np.linspace(first, last, count).tolist(), min(first + 0.05, last)})
        self._places = environments(scenario, angles)

    def run(self) -> Candidate:
        """Return the best candidate."""
        best = self._first()
        for factor in _STEPS:
            better = True
            while better:
                better = False
                for name in _knobs(best.compliance):
                    for by in (1.0 / factor, factor):
                        tried = self._try(_turned(best.compliance, name, by))
                        if tried and tried.margin.fulfils(self.required) and tried.cost < best.cost:
                            best, better = tried, True
                            break
        return best

    def _first(self) -> Candidate:
        """Return the start, slowed down until it has the margins."""
        compliance = self.scenario.compliance
        assert isinstance(compliance, ModelAdmittanceConfig)
        for _ in range(12):
            tried = self._try(compliance)
            if tried is not None and tried.margin.fulfils(self.required):
                return tried
            for name in _knobs(compliance):
                compliance = _turned(compliance, name, _STEPS[0]) or compliance
        raise InputError(
            f"no gains have {self.required.gain_db:g} dB and {self.required.phase_deg:g} degrees "
            "of margin along this path; ask for less or let the compliance begin later"
        )

    def _try(self, compliance: ModelAdmittanceConfig | None) -> Candidate | None:
        if compliance is None:
            return None
        scenario = msgspec.structs.replace(self.scenario, compliance=compliance)
        margin = min_margin(scenario, self._places)
        peaks: tuple[float, ...] = ()
        if margin.fulfils(self.required):
            each = [self.path.peaks(make_admittance(scenario), noise) for noise in self.noises]
            peaks = tuple(np.mean(each, axis=0).tolist())
        self.tried += 1
        return Candidate(compliance=compliance, margin=margin, peaks=peaks)


def min_margin(scenario: Scenario, places: Sequence[Environment]) -> Margin:
    """Return the smallest margins of the sampled loop at places of the path."""
    elements = LoopElements.from_scenario(scenario)
    gain, phase = math.inf, math.inf
    for at in places:
        acting = elements.acting("coupled", at.alpha_rad)
        if not any(acting):
            continue
        for loop in environment_loops(elements, at, acting).values():
            if not (loop.mode().stable and loop.controller_stable):
                return _UNSTABLE
            found = loop_margins(loop, stable=True)
            gain, phase = min(gain, found.gain_db), min(phase, math.degrees(found.phase_rad))
    return Margin(gain_db=gain, phase_deg=phase)


def _knobs(config: ModelAdmittanceConfig) -> dict[str, float]:
    """Return what the search changes of a compliance: times [s] by section and key."""
    found: dict[str, float] = {}
    for knob in ("x.b", "rotation.b", "predictor.lead_x_s", "predictor.lead_rotation_s"):
        section, key = knob.split(".")
        value = getattr(getattr(config, section), key, None)
        if value is not None:
            found[knob] = value
    return found


def _turned(
    config: ModelAdmittanceConfig, knob: str, factor: float
) -> ModelAdmittanceConfig | None:
    """Return a compliance with one time multiplied; None where that leaves the range."""
    section, key = knob.split(".")
    part = getattr(config, section)
    value = float(f"{getattr(part, key) * factor:.3g}")
    if not _SMALLEST_S <= value <= _LARGEST_S:
        return None
    return msgspec.structs.replace(
        config, **{section: msgspec.structs.replace(part, **{key: value})}
    )


def write_scenario(tuning: Tuning, base: str, path: Path) -> None:
    """Write the tuned scenario as a file that extends ``base``, a shipped name or a file."""
    extends = os.path.relpath(base, path.parent) if base.endswith(".toml") else base
    table: dict[str, Any] = {
        "extends": extends,
        "name": tuning.scenario.name,
        "description": f"{base} with gains found by dualbend tune",
        "compliance": without_none(msgspec.to_builtins(tuning.found.compliance)),
    }
    with writing(path, "--out"):
        write_whole(path, tomli_w.dumps(table))
