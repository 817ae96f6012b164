"""The assembly as an environment: a sheet laid on its pins is rewarded, force on them costs."""

from __future__ import annotations

from typing import Any

import numpy as np

from dualbend.control.controller import Observation
from dualbend.env.base import CellEnv, Info
from dualbend.errors import InputError
from dualbend.scenario.load import Settings
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.program.motions import PHASES
from dualbend.task.assembly.run import cycles
from dualbend.types import Vector


class AssembleEnv(CellEnv):
    """Correct the robots' program while it lays sheets on the pins: an action is added to its path.

    Observation (15,): of the left arm, then of the right one: filtered force along x and z [N] and
    moment about y [N m]; x, z [m] and pitch [rad] of the grip as the encoders tell it. Then the
    phase, counted in the order of an assembly, the nominal bending angle [rad] and the time [s].
    All in the arms' bending frames, clipped to the bounds of the space: the sensor's full scale,
    2 m and π.

    Reward of a step: −(F/limit)² of the largest force on a pin since the last cycle but one, over
    ``task.limits.pin_force_n``, and ``laid_reward`` for each sheet that is let go and lies on its
    pins. ``info`` has the forces, ``pin_force_n``, and the number of sheets ``laid``.
    """

    grip_bounds = (2.0, 2.0, np.pi)

    def __init__(
        self,
        scenario: str = "pwb",
        settings: Settings = (),
        *,
        laid_reward: float = 1000.0,
        failure_cost: float = 1000.0,
    ) -> None:
        super().__init__(scenario, settings, failure_cost)
        self.laid_reward, self._laid = laid_reward, 0

    def further(self) -> list[tuple[float, float]]:
        """Return the bounds of phase, bending angle and time."""
        scenario = self.cell.scenario
        if scenario.task.kind != "assembly":
            raise InputError(f"scenario {scenario.name!r}: dualbend/Assemble-v1 needs an assembly")
        self._limit_n = assembly_of(scenario).limits.pin_force_n
        return [(0.0, len(PHASES)), (0.0, np.pi), (0.0, cycles(scenario) * scenario.period_s)]

    def grips(self, observation: Observation) -> Vector:
        """Return the measured poses: the nominal ones are carried with the sheet's place."""
        return observation.measured.coordinates

    def observed(self, observation: Observation) -> list[float]:
        """Return phase, bending angle and time."""
        phase = PHASES.index(str(observation.phase))
        return [float(phase), float(observation.nominal.alpha_rad[0]), observation.time_s]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, Info]:
        """Begin a run, with no sheet laid."""
        self._laid = 0
        return super().reset(seed=seed, options=options)

    def rewarded(self) -> tuple[float, Info]:
        """Return how little force the pins bear, and what is newly laid."""
        trace, laid = self.cell.trace, len(self.cell.run.laid)
        pins = assembly_of(self.cell.scenario).layout.holes.names
        force_n: Vector = np.array([trace[f"pin_force_{pin}"][-1] for pin in pins])
        if self.cell.done and self.cell.record().outcome == "failed":
            laid = self._laid  # the sheet was let go, and does not lie on its pins
        newly, self._laid = laid - self._laid, laid
        reward = self.laid_reward * newly - float((force_n.max() / self._limit_n) ** 2)
        return reward, {"pin_force_n": force_n, "laid": laid}
