"""The sampled admittance loop at one bending angle, as the state space of one 28 ms cycle.

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
from numpy.typing import ArrayLike, NDArray

from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.control.compliance.admittance import DEG_PER_RAD, MM_PER_M, Admittance, AdmittanceAxis
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.delay import TransportDelay
from dualbend.control.filters import LowPass
from dualbend.control.response import CommandResponse
from dualbend.errors import InputError
from dualbend.run.known_sheet import make_admittance
from dualbend.scenario.scenario import Scenario
from dualbend.stability.controller import controller_blocks, plain_admittance
from dualbend.stability.mode import Mode, describe_mode
from dualbend.stability.plant.arm import YieldingArm
from dualbend.stability.state_space import Blocks, parallel, rational, realised
from dualbend.types import Vector

ComplexVector = NDArray[np.complex128]
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
    admittance: Admittance
    age_steps: int

    def __post_init__(self) -> None:
        """Refuse a reading from the future."""
        if self.age_steps < 0:
            raise InputError(f"age_steps = {self.age_steps}: a reading cannot be younger than now")

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> LoopElements:
        """Build the elements from the configurations that the run builds them from."""
        step_s = scenario.physics.step_s
        return cls(
            response=CommandResponse(
                scenario.response,
                1,
                steps_per_cycle(step_s, COMMAND_PERIOD_S),
                period_s=COMMAND_PERIOD_S,
            ),
            low_pass=LowPass(scenario.filter, 1, period_s=COMMAND_PERIOD_S),
            delay=TransportDelay(scenario.alter.delay_cycles, 1),
            admittance=make_admittance(scenario),
            # As in scene.simulation: the force that acts during a step is known when it is done.
            age_steps=max(scenario.sensor.latency_steps(step_s), 1),
        )

    def acting(self, axis: AxisName, alpha_rad: float = math.inf) -> tuple[bool, bool]:
        """Say whether x and rotation take part: chosen, switched on, and acting at the angle."""
        chosen = (axis != "rotation", axis != "x")
        given = (self.admittance.x, self.admittance.rotation)
        x, rotation = (
            wanted and part is not None and part.from_alpha_rad <= alpha_rad
            for wanted, part in zip(chosen, given, strict=True)
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
        return self.age_steps * COMMAND_PERIOD_S / self.response.steps

    def axis(self, name: Literal["x", "rotation"]) -> AdmittanceAxis:
        """Return the filter of an axis; InputError where it is off."""
        part = self.admittance.x if name == "x" else self.admittance.rotation
        if part is None:
            raise InputError(f"compliance.{name} is off: nothing to analyse")
        return part

    def damping_and_stiffness(self, name: Literal["x", "rotation"]) -> tuple[float, float]:
        """Return b [N s/m] or [N m s/rad] and k [N/m] or [N m/rad] that were configured."""
        self.axis(name)
        config = self.admittance.config
        given = config.x if name == "x" else config.rotation
        assert given is not None
        factor = si_per_unit(config.units, name)
        return given.b * factor, given.k * factor

    def shared_gain(self, z_inverse: ComplexVector) -> ComplexVector:
        """Return what both axes share (n, 2): deviation sent → position, acceleration, filtered."""
        chain = _actuator(self)
        identity = np.eye(chain.a.shape[0])
        solved = np.linalg.solve(identity / z_inverse[:, None, None] - chain.a, chain.b[None])
        filtered = rational(self.low_pass.transfer_function(), z_inverse)
        return np.asarray((chain.c @ solved)[:, :, 0] * filtered[:, np.newaxis])


def si_per_unit(units: str, name: Literal["x", "rotation"]) -> float:
    """Return what takes a configured b or k to SI: 1000 for mm, 180/π for degrees, 1 for SI."""
    if units != "paper":
        return 1.0
    return MM_PER_M if name == "x" else DEG_PER_RAD


def _actuator(elements: LoopElements) -> Blocks:
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
    robot = realised(elements.delay.transfer_function()).then(Blocks(a=a, b=b, c=c, d=d))
    return robot.then(parallel([realised(TransportDelay(cycles, 1).transfer_function())] * 2))


class SampledLoop:
    """The closed loop of one arm, or of both moving alike, at one bending angle.

    Parameters
    ----------
    elements
        What runs.
    stiffness : (2, 2)
        K: horizontal force and moment about y that the sensing arm loses per δx and δα, positive
        where the sheet pushes back [[N/m, N/rad], [N, N m/rad]].
    acting
        Whether x and rotation take part.
    inertia : (2, 2)
        M of the tool beyond the sensor, which the reading cannot tell from the sheet: the wrench
        read is −K q − M q̈ [[kg, kg m], [kg m, kg m²]]. None: no tool.
    arm
        The arm that moves, with its own stiffness and inertia, which then count instead of K and
        M. None: the arm does exactly what the robot's response says.
    alpha_rad
        Bending angle at which an admittance with a model is; not asked for without one.

    Raises
    ------
    InputError
        No axis takes part, or K is not a finite (2, 2) matrix.
    """

    def __init__(
        self,
        elements: LoopElements,
        stiffness: ArrayLike,
        acting: tuple[bool, bool] = (True, True),
        inertia: ArrayLike | None = None,
        arm: YieldingArm | None = None,
        alpha_rad: float | None = None,
    ) -> None:
        matrix = np.asarray(stiffness, dtype=np.float64)
        if matrix.shape != (2, 2) or not np.isfinite(matrix).all():
            raise InputError(f"stiffness must be a finite (2, 2) matrix, got {matrix!r}")
        axes = [
            part
            for part, wanted in zip(
                (elements.admittance.x, elements.admittance.rotation), acting, strict=True
            )
            if wanted
        ]
        self.filters = [part for part in axes if part is not None]
        if not self.filters or len(self.filters) != len(axes):
            raise InputError("no admittance axis takes part in the loop")
        model = elements.admittance
        self._model: Blocks | None = None
        self.elements, self.acting = elements, acting
        if isinstance(model, ModelAdmittance):
            if alpha_rad is None:
                raise InputError("an admittance with a model needs alpha_rad")
            low_pass = elements.low_pass
            self._model = controller_blocks(model, alpha_rad, acting, _actuator(elements), low_pass)
            # It reads both loads whatever complies; the deviation of an axis at rest is 0.
            acting = (True, True)
        self._size = sum(acting)
        self.stiffness = matrix[np.ix_(acting, acting)]
        mass = np.zeros((2, 2)) if inertia is None else np.asarray(inertia, dtype=np.float64)
        self.inertia = mass[np.ix_(acting, acting)]
        self._arm = arm
        if arm:
            # At least one step, as in the simulation, which has no reading of this very instant.
            age = max(elements.age_steps, 1)
            self._cycle, self._cycles_of_age = arm.cycle(elements.response, age, acting)
        self._robot = self._yielding() if arm else self._rigid()
        low_passes = parallel([realised(elements.low_pass.transfer_function())] * self._size)
        self._controller = (
            low_passes.then(self._model)
            if self._model
            else parallel(
                realised(elements.low_pass.transfer_function()).then(
                    realised(part.transfer_function())
                )
                for part in self.filters
            )
        )
        self._close()

    def _rigid(self) -> Blocks:
        size = self._size
        read = np.stack([self.stiffness, self.inertia], axis=-1).reshape(size, 2 * size)
        return parallel([_actuator(self.elements)] * size).scaled(-read)

    def _yielding(self) -> Blocks:
        """Return delay, robot under load and age, from deviations to the wrench read."""
        elements, size = self.elements, self._size
        delay = realised(elements.delay.transfer_function())
        age = realised(TransportDelay(self._cycles_of_age, 1).transfer_function())
        return parallel([delay] * size).then(self._cycle).then(parallel([age] * size))

    def _close(self) -> None:
        p, q = self._robot, self._controller
        # The robot's output never depends on this cycle's input: a reading is older than that.
        assert not p.d.any()
        self.a = np.block([[p.a + p.b @ q.d @ p.c, p.b @ q.c], [q.b @ p.c, q.a]])
        self.b = np.vstack([p.b @ q.d, q.b])
        self.c = np.hstack([q.d @ p.c, q.c])
        self.d = q.d

    def response(self, disturbance: Vector) -> Vector:
        """Return the deviations (n, axes) that a wrench (n, axes) added to the readings makes."""
        state, out = np.zeros(self.a.shape[0]), np.empty_like(disturbance)
        for cycle, wrench in enumerate(disturbance):
            out[cycle] = self.c @ state + self.d @ wrench
            state = self.a @ state + self.b @ wrench
        return out

    def mode(self) -> Mode:
        """Return the dominant mode of the cycle."""
        values = np.linalg.eigvals(self.a)
        z = values[np.argmax(np.abs(values))]
        return describe_mode(complex(z))

    def open_loop(
        self, z_inverse: ComplexVector, shared: ComplexVector | None = None
    ) -> ComplexVector:
        """Return L (n, axes, axes), broken at the admittance's output; det(I + L) = 0 closes it."""
        if self._arm:
            wrench = self.felt(z_inverse)
        else:
            common = self.elements.shared_gain(z_inverse) if shared is None else shared
            read = np.stack([self.stiffness.ravel(), self.inertia.ravel()])
            wrench = (common @ read).reshape(-1, *self.stiffness.shape)
        if self._model:
            return np.asarray(self._model.at(z_inverse) @ wrench)
        gains = np.stack(
            [rational(f.transfer_function(), z_inverse) for f in self.filters], axis=-1
        )
        return np.asarray(gains[:, :, None] * wrench)

    @property
    def controller_stable(self) -> bool:
        """The controller by itself is stable, as the margins take for granted."""
        if self._model is None:
            return True
        return bool(np.abs(np.linalg.eigvals(self._model.a)).max(initial=0.0) < 1.0)

    def felt(self, z_inverse: ComplexVector) -> ComplexVector:
        """Return the filtered wrench (n, axes, axes) that is lost per deviation sent."""
        filtered = rational(self.elements.low_pass.transfer_function(), z_inverse)
        late = z_inverse ** (self.elements.delay.cycles + self._cycles_of_age)
        return np.asarray(-self._cycle.at(z_inverse) * (filtered * late)[:, None, None])
