"""The onset of the oscillation on a ray in (b, k), predicted by the three analyses.

On a ray k/b is constant, and with it the filter's pole; b is then nothing but the inverse of the
loop's gain, so that a gain margin m at b puts the onset at b/m, exactly, in all three.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

from dualbend.control.compliance.admittance import Admittance
from dualbend.mechanics.coupling import ModeName
from dualbend.scenario.scenario import Scenario
from dualbend.stability.continuous import delayed_loop, largest_stiffness, paper_loop
from dualbend.stability.margins import loop_margins
from dualbend.stability.mode import Mode
from dualbend.stability.plant.environment import environments
from dualbend.stability.sampled import LoopElements, SampledLoop, environment_loops
from dualbend.study.onset.held import SingleAxis, held
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class RayPrediction:
    """b below which each analysis calls the loop unstable [the axis's own units], and more.

    ``paper`` (23), ``delayed`` continuous with delay, ``sampled``; ``frequency_hz`` of the sampled
    loop at its onset.
    """

    paper: float
    delayed: float
    sampled: float
    frequency_hz: float


class RayLoop:
    """One axis held at one bending angle, for gains on a ray k = ``ratio_per_s`` b.

    Of two arms that each follow their own sensor it is the symmetric loop: the disturbance is the
    same for both.

    Raises InputError as :func:`dualbend.study.onset.held.held` and the prediction do.
    """

    def __init__(
        self, scenario: Scenario, axis: SingleAxis, alpha_rad: float, ratio_per_s: float
    ) -> None:
        given = scenario.compliance.x if axis == "x" else scenario.compliance.rotation
        self._scenario, self._axis = scenario, axis
        self._alpha, self._ratio = alpha_rad, ratio_per_s
        self.b = given.b if given is not None else 1.0
        # Tared, so that the state does not depend on the gains.
        (at,) = environments(self.held(self.b), [alpha_rad])
        ways: dict[ModeName, Vector] = {
            way: loop for way, loop in at.loops.items() if way != "antisymmetric"
        }
        self._environment = replace(at, loops=ways)
        self._elements = LoopElements.from_scenario(self.held(self.b))

    def on(self, ratio_per_s: float) -> RayLoop:
        """Return the same loop on another ray, without solving for the sheet again."""
        other = copy(self)
        other._ratio = ratio_per_s
        return other

    def held(self, b: float, part: float = 1.0) -> Scenario:
        """Return the scenario of the simulation with this b and part of the disturbance."""
        return held(self._scenario, self._axis, self._alpha, (b, self._ratio * b), part)

    def mode(self, b: float) -> Mode:
        """Return the dominant mode of the sampled loop at this b."""
        modes = [loop.mode() for loop in self._loops(b)]
        return max(modes, key=lambda mode: mode.spectral_radius)

    def predict(self) -> RayPrediction:
        """Return what the analyses say of the ray."""
        b, elements = self.b, self._with(self.b)
        margin = [loop_margins(loop, stable=True).gain for loop in self._loops(b)]
        least = min(margin)
        sampled = b / least
        frequency = self.mode(sampled).frequency_hz
        index = 0 if self._axis == "x" else 1
        stiffness = list(self._environment.loops.values())[margin.index(least)][index, index]
        paper = paper_loop(elements, self._axis, float(stiffness))
        allowed = largest_stiffness(paper.b, paper.k, paper.omega_rad_per_s, paper.two_xi_omega)
        delayed = delayed_loop(elements, self._axis, float(stiffness), max(frequency, 0.1))
        return RayPrediction(
            paper=b * paper.stiffness / float(allowed),
            delayed=b / delayed.margins().gain,
            sampled=sampled,
            frequency_hz=frequency,
        )

    def _with(self, b: float) -> LoopElements:
        admittance = Admittance(self.held(b).compliance, period_s=self._elements.response.period_s)
        return replace(self._elements, admittance=admittance)

    def _loops(self, b: float) -> list[SampledLoop]:
        acting = (self._axis == "x", self._axis == "rotation")
        return list(environment_loops(self._with(b), self._environment, acting).values())
