"""Does learning converge? |Q (1 − L P)| of the loop's model, before anything is applied.

P is what the filtered moments lose per correction, through transport delay, robot response, arm,
sheet, sensor and low-pass. With feedback, A the admittance, it is P S about the rotation, and the
feedback's own turn loses D = A P S, S = (I + A P)⁻¹: where S is small, as of feedback that
integrates, |1 − γ z^m (G P + A P S)| is nearly 1 − γ. Its norm below 1 at every frequency is
sufficient where the sheet does not change along the path; along the path it is asked for at every
bending angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np

from dualbend.control.clock import ComplexVector
from dualbend.control.learning import LearningConfig, LearningLaw
from dualbend.errors import InputError, refusing
from dualbend.mechanics.coupling import ModeName
from dualbend.scenario.motion import nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.stability.plant.environment import Environment, environments
from dualbend.stability.sampled import LoopElements, SampledLoop, compliant_plant
from dualbend.stability.state_space import from_transfer_function, parallel
from dualbend.types import SIDES, Vector

SHORTEST_SETTLE_S = 0.5
"""A correction of 0.1 rad that comes in faster would jerk the arms."""

SHORTEST_HOLD_S = 0.5
"""The arms arrive in its first half."""

_REST_HZ = 1e-4
"""At 0 feedback that integrates has no response."""

_STEP_RAD, _FREQUENCIES, _MOST_LEAD = 0.02, 400, 40

_MODES: dict[ModeName, Vector] = {
    "symmetric": np.array([[0.5, 0.5], [0.5, 0.5]]),
    "antisymmetric": np.array([[0.5, -0.5], [-0.5, 0.5]]),
}
"""The share of a mode in the arms' moments and corrections."""


class LearningPlants(NamedTuple):
    """What a correction changes at bending angles and frequencies, each (angles, n, arms, arms).

    ``open`` and ``closed``: the moments that are lost per correction, P and P S [N m/rad];
    ``deviation``: the feedback's turn that is lost, D [-].
    """

    open: ComplexVector
    closed: ComplexVector
    deviation: ComplexVector


@dataclass(frozen=True, kw_only=True)
class LearningPrediction:
    """The law that a scenario asks for, and by how much it contracts at angles and frequencies.

    ``stiffness`` (arms, arms) [N m/rad]: P at rest without feedback, the mean over the path, whose
    inverse the law learns with. ``contraction`` (angles, frequencies).
    """

    law: LearningLaw
    stiffness: Vector
    alphas_rad: Vector
    frequencies_hz: Vector
    contraction: Vector

    @property
    def worst(self) -> tuple[float, float, float]:
        """The largest contraction, its frequency [Hz] and its bending angle [rad]."""
        angle, frequency = divmod(int(self.contraction.argmax()), self.frequencies_hz.size)
        return (
            float(self.contraction.max()),
            float(self.frequencies_hz[frequency]),
            float(self.alphas_rad[angle]),
        )

    def __str__(self) -> str:
        """Say it in words."""
        worst, frequency, alpha = self.worst
        lead = self.law.lead_cycles
        return (
            f"|Q (1 − L P)| is at most {worst:.2f}, at {frequency:.2f} Hz and {alpha:.2f} rad "
            f"(gain {self.law.config.gain:g}, lead {lead} cycles = "
            f"{1e3 * lead * self.law.period_s:.0f} ms)"
        )

    def refuse_divergence(self) -> None:
        """Raise InputError where corrections would not shrink from sheet to sheet."""
        if not self.worst[0] < 1.0:
            raise InputError(
                f"learning: {self}: corrections would grow from sheet to sheet; it must be below "
                "1: look at learning.gain (0.85), learning.lead_cycles (none), "
                "learning.cutoff_hz (3) and path.start_rad (a sheet that is bent by 0.1 rad builds "
                "up no tension)"
            )


def predict_learning(scenario: Scenario) -> LearningPrediction:
    """Return the law of a scenario, its gain and lead made from the loop's model.

    Raises InputError where it has no section ``learning``, one arm complies alone, a pose is out
    of reach or the sheet's state is not found.
    """
    config = learning_of(scenario)
    path = scenario.path
    count = max(math.ceil((path.end_rad - path.start_rad) / _STEP_RAD - 1e-9), 1)
    alphas = np.linspace(path.start_rad, path.end_rad, count + 1)
    frequencies = np.linspace(0.0, 0.5 / scenario.period_s, _FREQUENCIES)
    frequencies[0] = _REST_HZ
    z_inverse = np.exp(-2j * np.pi * frequencies * scenario.period_s)
    plants = learning_plants(scenario, alphas, z_inverse)
    stiffness = plants.open[:, 0].real.mean(axis=0)
    compliance = np.linalg.inv(stiffness)

    def of(lead_cycles: int) -> LearningPrediction:
        law = LearningLaw(
            config,
            compliance,
            lead_cycles,
            period_s=scenario.period_s,
            ramp_cycles=_settle_cycles(scenario),
        )
        contraction = [
            law.contraction(z_inverse, *plant)
            for plant in zip(plants.closed, plants.deviation, strict=True)
        ]
        return LearningPrediction(
            law=law,
            stiffness=stiffness,
            alphas_rad=alphas,
            frequencies_hz=frequencies,
            contraction=np.array(contraction),
        )

    if config.lead_cycles is not None:
        return of(config.lead_cycles)
    return min(map(of, range(_MOST_LEAD)), key=lambda found: found.worst[0])


def learning_of(scenario: Scenario) -> LearningConfig:
    """Return the section ``learning``; InputError where there is none or the arms cannot learn."""
    if scenario.learning is None:
        raise InputError(
            f"scenario {scenario.name!r}: has no section learning, so that nothing is learned; "
            "dualbend learn learned, or give one: learning.gain = 0.85"
        )
    if len(scenario.compliance.complying) == 1:
        raise InputError(
            f"compliance.complying = {list(scenario.compliance.complying)}: where sheets are "
            "learned both arms comply, or none"
        )
    if scenario.motion.settle_s < SHORTEST_SETTLE_S:
        raise InputError(
            f"motion.settle_s = {scenario.motion.settle_s}: corrections come in over the first "
            f"half of it, which needs at least {SHORTEST_SETTLE_S} s"
        )
    if scenario.motion.hold_s < SHORTEST_HOLD_S:
        raise InputError(
            f"motion.hold_s = {scenario.motion.hold_s}: the force in the hold tells one sheet from "
            f"another, which needs at least {SHORTEST_HOLD_S} s"
        )
    return scenario.learning


def learning_plants(
    scenario: Scenario, alphas_rad: Vector, z_inverse: ComplexVector
) -> LearningPlants:
    """Return what is lost per correction at bending angles, where z⁻¹ (n,) is given.

    Of one sensor both arms follow it: there is one correction, and one reading.
    """
    compliance = msgspec.structs.replace(scenario.compliance, complying=SIDES)
    both = msgspec.structs.replace(scenario, compliance=compliance)
    elements = LoopElements.from_scenario(scenario)
    feedback = bool(scenario.compliance.complying)
    plants = []
    for at in environments(both, alphas_rad.tolist()):
        with refusing(f"path at {at.alpha_rad:.3f} rad"):
            modes = {mode: _plant(elements, at, mode, z_inverse, feedback) for mode in at.arms}
        shares = [_MODES[mode] for mode in modes] if len(modes) > 1 else [np.ones((1, 1))]
        found = np.array(list(modes.values()))
        plants.append(np.einsum("mpn,mij->pnij", found, np.array(shares)))
    return LearningPlants(*np.array(plants).swapaxes(0, 1))


def _plant(
    elements: LoopElements, at: Environment, mode: ModeName, z_inverse: ComplexVector, closed: bool
) -> ComplexVector:
    """Return P, P S and D (3, n) of a mode about the rotation; open where it is not ``closed``."""
    low_pass = parallel([from_transfer_function(elements.low_pass.transfer_function())] * 2)
    arm = compliant_plant(elements, at.arms[mode], (True, True)).series(low_pass)
    plant = -arm.frequency_response(z_inverse)
    admittance = np.zeros_like(plant)
    acting = elements.acting("coupled", at.alpha_rad)
    if closed and any(acting):
        loop = SampledLoop(
            elements, at.loops[mode], acting, arm=at.arms[mode], alpha_rad=at.alpha_rad
        )
        if not loop.mode().stable:
            raise InputError(
                "compliance: the loop is predicted unstable: what does not settle is not the same "
                "from sheet to sheet; look at dualbend stability"
            )
        given = loop.admittance.frequency_response(z_inverse)
        axes = [i for i in range(2) if acting[i]] if given.shape[-1] == sum(acting) else [0, 1]
        admittance[:, np.array(axes)[:, np.newaxis], axes] = given
    lost = plant @ np.linalg.inv(np.eye(2) + admittance @ plant)
    return np.array([each[:, 1, 1] for each in (plant, lost, admittance @ lost)])


def _settle_cycles(scenario: Scenario) -> int:
    """Return the cycles in which a correction comes in: half of those in which the arms settle."""
    motion = nominal_motion(
        scenario.path, scenario.motion, scenario.sheet.length_m, scenario.period_s
    )
    return int(np.count_nonzero(motion.phase == 0)) // 2
