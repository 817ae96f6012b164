"""The sampled admittance loop at one bending angle, as the state space of one command cycle.

Every element is asked for its own numbers, and they are the elements that the simulation runs:
readings of age a → low-pass → admittance → transport delay → ramp → robot response → sheet.
The sheet is linear: the wrench on the sensing arm is −K q, q = (δx, δα) of the complying arms, and
the wrist sensor reads the inertia of the tool with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dualbend.control.clock import ComplexVector, rational, steps_per_cycle
from dualbend.control.compliance.admittance import Admittance, AdmittanceAxis, si_per_unit
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import LowPass
from dualbend.control.response import CommandResponse
from dualbend.errors import InputError
from dualbend.mechanics.coupling import ModeName
from dualbend.run.known_sheet import reading_age_steps
from dualbend.scenario.scenario import Scenario
from dualbend.stability.controller import (
    LinearController,
    analysed_controller,
    controller_system,
    plain_admittance,
)
from dualbend.stability.mode import Mode, describe_mode
from dualbend.stability.plant.arm import CompliantArm
from dualbend.stability.plant.environment import Environment
from dualbend.stability.state_space import StateSpace, from_transfer_function, parallel

AxisName = Literal["x", "rotation", "coupled"]
AXES: tuple[AxisName, ...] = ("x", "rotation", "coupled")


@dataclass(frozen=True, kw_only=True)
class LoopElements:
    """What all bending angles share: the elements of the loop, and the age of a reading.

    ``age_steps``: age of the reading at the start of the cycle that uses it [physics steps of
    ``response``]; 0 is a reading of this very instant, which the simulation never has.
    """

    response: CommandResponse
    low_pass: LowPass
    delay: TransportDelay
    admittance: Admittance | LinearController
    age_steps: int

    def __post_init__(self) -> None:
        """Refuse a reading from the future."""
        if self.age_steps < 0:
            raise InputError(f"age_steps = {self.age_steps}: a reading cannot be younger than now")

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> LoopElements:
        """Build the elements from the configurations that the run builds them from."""
        period_s = scenario.period_s
        steps = steps_per_cycle(scenario.step_s, period_s)
        return cls(
            response=CommandResponse(
                scenario.robot.response_of("left"), 1, steps, period_s=period_s
            ),
            low_pass=LowPass(scenario.filter, 1, period_s=period_s),
            delay=TransportDelay(scenario.robot.longest_delay, 1),
            admittance=analysed_controller(scenario),
            age_steps=reading_age_steps(scenario),
        )

    def acting(self, axis: AxisName, alpha_rad: float = math.inf) -> tuple[bool, bool]:
        """Say whether x and rotation take part: chosen, switched on, and acting at the angle."""
        chosen = (axis != "rotation", axis != "x")
        given = self.admittance.axes_at(alpha_rad)
        x, rotation = (
            wanted and part is not None for wanted, part in zip(chosen, given, strict=True)
        )
        return x, rotation

    def plain(self, alpha_rad: float) -> LoopElements:
        """Return the elements with the paper's admittance in the gains of one bending angle."""
        if not isinstance(self.admittance, ModelAdmittance):
            return self
        return replace(self, admittance=plain_admittance(self.admittance, alpha_rad))

    @property
    def age_s(self) -> float:
        """Age of a reading [s]."""
        return self.age_steps * self.response.period_s / self.response.steps

    def axis(self, name: Literal["x", "rotation"]) -> AdmittanceAxis:
        """Return the filter of an axis; InputError where it is off."""
        part: AdmittanceAxis | None = getattr(self.admittance, name, None)
        if part is None:
            raise InputError(f"compliance.{name} is off: nothing to analyse")
        return part

    def damping_and_stiffness(self, name: Literal["x", "rotation"]) -> tuple[float, float]:
        """Return b [N s/m] or [N m s/rad] and k [N/m] or [N m/rad] that were configured."""
        self.axis(name)
        assert isinstance(self.admittance, Admittance)
        config = self.admittance.config
        given: AxisConfig = getattr(config, name)
        factor = si_per_unit(config.units, name)
        return given.b * factor, given.k * factor


def _actuator(elements: LoopElements) -> StateSpace:
    """Return one axis from the deviation sent to position and acceleration as old as a reading."""
    response = elements.response
    a, b, c, _ = response.state_space()
    cycles = math.ceil(elements.age_steps / response.steps)
    row = cycles * response.steps - elements.age_steps - 1
    omega = 2.0 * math.pi * response.config.natural_frequency_hz
    damping = 2.0 * response.config.damping_ratio * omega
    c = np.vstack([c, [-(omega**2), -damping, omega**2]])
    d = np.zeros((2, 1))
    if cycles and row >= 0:
        c, d = response.outputs_at(row)
    delay, age = (
        from_transfer_function(part.transfer_function())
        for part in (elements.delay, TransportDelay(cycles, 1))
    )
    return delay.series(StateSpace(a=a, b=b, c=c, d=d)).series(parallel([age] * 2))


class SampledLoop:
    """The closed loop of one arm, or of both in one mode, at one bending angle.

    ``closed`` is its state space, from a wrench added to the readings to the deviations.

    ``stiffness`` (2, 2), K: horizontal force and moment about y that the sensing arm loses per δx
    and δα, positive where the sheet pushes back [[N/m, N/rad], [N, N m/rad]]. ``acting``: whether
    x and rotation take part. ``inertia`` (2, 2), M of the tool beyond the sensor, which the reading
    cannot tell from the sheet: the wrench read is −K q − M q̈ [[kg, kg m], [kg m, kg m²]]; None: no
    tool. ``arm`` moves with its own stiffness and inertia instead of K and M; None: the arm does
    exactly what the robot's response says. ``alpha_rad``: the bending angle that an admittance with
    a model is asked for.

    Raises InputError where no axis takes part, or K is not a finite (2, 2) matrix.
    """

    def __init__(
        self,
        elements: LoopElements,
        stiffness: ArrayLike,
        acting: tuple[bool, bool] = (True, True),
        inertia: ArrayLike | None = None,
        arm: CompliantArm | None = None,
        alpha_rad: float | None = None,
    ) -> None:
        matrix = np.asarray(stiffness, dtype=np.float64)
        if matrix.shape != (2, 2) or not np.isfinite(matrix).all():
            raise InputError(f"stiffness must be a finite (2, 2) matrix, got {matrix!r}")
        given = elements.admittance
        plain = isinstance(given, Admittance) and not isinstance(given, ModelAdmittance)
        if alpha_rad is None and not plain:
            raise InputError("a controller beyond constant gains needs alpha_rad")
        alpha = math.inf if alpha_rad is None else alpha_rad
        each = given.axes if isinstance(given, Admittance) else given.axes_at(alpha)
        axes = [part for part, wanted in zip(each, acting, strict=True) if wanted]
        filters = [part for part in axes if part is not None]
        if not filters or len(filters) != len(axes):
            raise InputError("no admittance axis takes part in the loop")
        self.period_s = elements.response.period_s
        low_pass = elements.low_pass
        self._low_pass = low_pass.transfer_function()
        if isinstance(given, ModelAdmittance):
            self.admittance = controller_system(given, alpha, acting, _actuator(elements), low_pass)
            # It reads both loads whatever complies; the deviation of an axis at rest is 0.
            acting = (True, True)
        else:
            self.admittance = parallel(
                from_transfer_function(part.transfer_function()) for part in filters
            )
        size = sum(acting)
        if arm:
            self._plant = compliant_plant(elements, arm, acting)
        else:
            mass = np.zeros((2, 2)) if inertia is None else np.asarray(inertia, dtype=np.float64)
            read = np.stack([part[np.ix_(acting, acting)] for part in (matrix, mass)], axis=-1)
            plant = parallel([_actuator(elements)] * size)
            self._plant = plant.scaled(-read.reshape(size, 2 * size))
        filtered = parallel([from_transfer_function(self._low_pass)] * size)
        self.closed = filtered.series(self.admittance).feedback(self._plant)

    def mode(self) -> Mode:
        """Return the dominant mode of the cycle."""
        return describe_mode(self.closed.dominant_pole, self.period_s)

    def open_loop(self, z_inverse: ComplexVector) -> ComplexVector:
        """Return L (n, axes, axes), broken at the admittance's output; det(I + L) = 0 closes it."""
        response = self.wrench_response(z_inverse)
        return np.asarray(self.admittance.frequency_response(z_inverse) @ response)

    def wrench_response(self, z_inverse: ComplexVector) -> ComplexVector:
        """Return the filtered wrench (n, axes, axes) that is lost per deviation commanded."""
        filtered = rational(self._low_pass, z_inverse)
        return np.asarray(-self._plant.frequency_response(z_inverse) * filtered[:, None, None])

    @property
    def controller_stable(self) -> bool:
        """The controller by itself is stable, as the margins take for granted."""
        return abs(self.admittance.dominant_pole) < 1.0


def compliant_plant(
    elements: LoopElements, arm: CompliantArm, acting: tuple[bool, bool]
) -> StateSpace:
    """Return delay, robot under load and age, from deviations to the wrench read."""
    # At least one step, as in the simulation, which has no reading of this very instant.
    cycle, cycles = arm.cycle(elements.response, max(elements.age_steps, 1), acting)
    delay, age = (
        parallel([from_transfer_function(part.transfer_function())] * sum(acting))
        for part in (elements.delay, TransportDelay(cycles, 1))
    )
    return delay.series(cycle).series(age)


def environment_loops(
    elements: LoopElements, at: Environment, acting: tuple[bool, bool]
) -> dict[ModeName, SampledLoop]:
    """Return the sampled loop of each mode in which the arms can move at one bending angle."""
    return {
        mode: SampledLoop(elements, stiffness, acting, arm=at.arms[mode], alpha_rad=at.alpha_rad)
        for mode, stiffness in at.loops.items()
    }
