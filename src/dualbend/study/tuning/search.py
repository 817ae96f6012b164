"""Search for the gains whose simulation has the least moment, at required margins.

A run takes less than a second, so that every candidate is simulated: there is no model of a model
to be wrong. Margins come first, because they cost less and no simulation shows them. Candidates go
one by one, since each depends on what became of the one before and most end with their first seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import msgspec
import numpy as np

from dualbend.batch.many import run_many
from dualbend.control.compliance.admittance import ComplianceConfig
from dualbend.errors import InputError
from dualbend.resources import usable_cores
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.stability.margins import loop_margins
from dualbend.stability.plant.environment import Environment, environments
from dualbend.stability.sampled import LoopElements, environment_loops
from dualbend.study.ending import record_of
from dualbend.study.tuning.gains import Gains, Knob, knobs, softened, turned
from dualbend.types import Vector

STEPS = (4.0, 2.0, 1.4)
"""Factors by which the gains are changed, one after the other."""

MOST_TRIES = 90
_SOFTER, _MOST_SOFTENED = 0.6, 80
_ANGLE_STEP_RAD = 0.2


class Margin(msgspec.Struct, frozen=True, kw_only=True):
    """The smallest margins along the path: gain [dB], phase [degrees]; both −inf where unstable."""

    gain_db: float
    phase_deg: float

    def fulfils(self, required: Margin) -> bool:
        """Neither is below what is required."""
        return self.gain_db >= required.gain_db and self.phase_deg >= required.phase_deg


UNSTABLE = Margin(gain_db=-math.inf, phase_deg=-math.inf)


def worst(margins: Iterable[Margin]) -> Margin:
    """Return the smallest gain margin and the smallest phase margin of several loops."""
    each = list(margins)
    return Margin(
        gain_db=min(margin.gain_db for margin in each),
        phase_deg=min(margin.phase_deg for margin in each),
    )


class Trial(msgspec.Struct, frozen=True, kw_only=True):
    """Gains, their margins, and the moments (seeds, 2) that they simulate: rms and peak [N m]."""

    compliance: Gains
    margin: Margin
    moments: Vector


def with_compliance(scenario: Scenario, compliance: ComplianceConfig) -> Scenario:
    """Return the scenario with another compliance."""
    return msgspec.structs.replace(scenario, compliance=compliance)


def simulate(cases: Iterable[tuple[Scenario, int]]) -> list[tuple[Vector, str]]:
    """Simulate scenarios with a seed each; return of each rms and peak of the moment, and "".

    (2,) [N m], while it bends. Runs of one structure are a batch, on all cores. A run that does not
    end as completed has infinite moments, and how it ended.
    """
    runs = [make_run(msgspec.structs.replace(scenario, seed=seed)) for scenario, seed in cases]
    ended = dict(run_many(runs, threads=usable_cores()))
    return [_moments(ended[i]) for i in range(len(runs))]


def _moments(record: RunRecord | Exception) -> tuple[Vector, str]:
    result = record_of(record)
    if result.outcome != "completed":
        return np.full(2, math.inf), f"{result.outcome}: {result.reason}"
    found = (result.metrics[name].value for name in ("rms_moment", "peak_moment"))
    return np.array([value if isinstance(value, float) else math.inf for value in found]), ""


def places(scenario: Scenario) -> list[Environment]:
    """Return what the loop works against along the path, at the compliance's own equilibrium.

    Where a compliance yields to the whole end force, a softer one bends the sheet less, and the
    flatter sheet is stiffer.
    """
    start, end = scenario.path.start_rad, scenario.path.end_rad
    axes = (scenario.compliance.x, scenario.compliance.rotation)
    switches = {max(axis.from_alpha_rad, start) for axis in axes if axis is not None} or {start}
    first = min(switches)
    count = math.ceil((end - first) / _ANGLE_STEP_RAD) + 1
    # The stiffness along x changes most just after the start.
    grid = {*np.linspace(first, end, count).tolist(), first + _ANGLE_STEP_RAD / 4.0, *switches}
    return environments(scenario, sorted(alpha for alpha in grid if alpha <= end))


def min_margin(scenario: Scenario, at_places: Sequence[Environment]) -> Margin:
    """Return the smallest margins of the sampled loop at places of the path."""
    elements = LoopElements.from_scenario(scenario)
    gain, phase = math.inf, math.inf
    for at in at_places:
        acting = elements.acting("coupled", at.alpha_rad)
        for loop in environment_loops(elements, at, acting).values():
            if not (loop.mode().stable and loop.controller_stable):
                return UNSTABLE
            found = loop_margins(loop, stable=True)
            gain, phase = min(gain, found.gain_db), min(phase, math.degrees(found.phase_rad))
    return Margin(gain_db=gain, phase_deg=phase)


class Search:
    """Coordinate search: change one gain after the other as long as the moment falls.

    ``seeds``: of the noise that a candidate is simulated with; it is better where its rms is
    smaller with every one of them and its mean peak is not above ``peak_nm``. ``worlds``: scenarios
    that are simulated in the place of the scenario, which differ from it in what its controller
    does not know, and ``alone_nm`` the rms of each without compliance: a candidate is better where
    the largest of its shares of them is smaller. ``loops``: scenarios beside it in whose loop the
    margins must hold. ``on_try`` is told how many candidates were tried.
    """

    def __init__(
        self,
        scenario: Scenario,
        required: Margin,
        seeds: Sequence[int],
        peak_nm: float,
        on_try: Callable[[int], None],
        worlds: Sequence[Scenario] = (),
        alone_nm: Sequence[float] = (),
        loops: Sequence[Scenario] = (),
    ) -> None:
        self.scenario, self.required = scenario, required
        self.cases = [(world, seed) for world in worlds or [scenario] for seed in seeds]
        self._alone_nm = np.repeat(alone_nm, len(seeds))
        self.peak_nm, self.tried, self._on_try = peak_nm, 0, on_try
        self._loops = (scenario, *loops)
        self._known: set[Gains] = set()
        self._places: list[list[Environment]] = []

    def run(self, start: Gains) -> list[Trial]:
        """Return the candidates that were the best one after the other, the last one first."""
        found = [self._first(start)]
        for factor in STEPS:
            better = True
            while better and self.tried < MOST_TRIES:
                better = False
                for knob in knobs(start, self.scenario.path.end_rad):
                    for by in (1.0 / factor, factor):
                        before = len(found)
                        while tried := self._try(self._turned(found[-1], knob, by), found[-1]):
                            found.append(tried)
                        if len(found) > before:
                            better = True
                            break
        return found[::-1]

    def _turned(self, trial: Trial, knob: Knob, factor: float) -> Gains | None:
        return turned(trial.compliance, knob, factor, self.scenario.period_s)

    def _first(self, compliance: Gains) -> Trial:
        """Return the start, made stiffer until it has the margins.

        The gain of the loop falls with the compliance of its axes and the elements around it are
        stable, so that some compliance has any margins (small gain).
        """
        for _ in range(_MOST_SOFTENED):
            margin = self.margin(compliance)
            if margin.fulfils(self.required):
                return Trial(
                    compliance=compliance, margin=margin, moments=self.simulated(compliance)
                )
            self._count()
            compliance = softened(compliance, _SOFTER)
        raise InputError(
            f"no gains have {self.required.gain_db:g} dB and {self.required.phase_deg:g} degrees "
            "of margin along this path; ask for less"
        )

    def _try(self, compliance: Gains | None, best: Trial) -> Trial | None:
        """Return a candidate if it is better."""
        if compliance is None or compliance in self._known or self.tried >= MOST_TRIES:
            return None
        self._known.add(compliance)
        self._count()
        margin = self.margin(compliance)
        if not margin.fulfils(self.required):
            return None
        rows: list[Vector] = []
        too_high = self._excess(best.moments) > 0.0
        for (world, seed), bound in zip(self.cases, self._bounds(best.moments), strict=True):
            ((moments, _),) = simulate([(with_compliance(world, compliance), seed)])
            rows.append(moments)
            if not (too_high or rows[-1][0] < bound):
                return None
        trial = Trial(compliance=compliance, margin=margin, moments=np.array(rows))
        excess = self._excess(trial.moments)
        return trial if excess < self._excess(best.moments) or excess == 0.0 else None

    def _bounds(self, best: Vector) -> Vector:
        """Return below which rms [N m] (cases,) a candidate is better than moments (cases, 2)."""
        rms = best[:, 0]
        if not self._alone_nm.size:
            return rms
        return np.asarray(self._alone_nm * np.max(rms / self._alone_nm))

    def _excess(self, found: Vector) -> float:
        """Return how far the mean peak is above the bound, relative to it; 0 if it is not."""
        # Runs without noise in the loop have equal peaks to the bit, their means to rounding.
        excess = float(found[:, 1].mean()) / self.peak_nm - 1.0
        return excess if excess > 1e-9 else 0.0

    def margin(self, compliance: Gains) -> Margin:
        """Return the smallest margins of a compliance."""
        loops = [with_compliance(loop, compliance) for loop in self._loops]
        # With a force reference the equilibrium hardly depends on the gains.
        if not (self._places and compliance.reference and compliance.x):
            self._places = [places(loop) for loop in loops]
        return worst(min_margin(*each) for each in zip(loops, self._places, strict=True))

    def simulated(self, compliance: ComplianceConfig) -> Vector:
        """Return the moments (seeds, 2) of a compliance."""
        cases = [(with_compliance(world, compliance), seed) for world, seed in self.cases]
        return np.array([moments for moments, _ in simulate(cases)])

    def _count(self) -> None:
        self.tried += 1
        self._on_try(self.tried)
