"""What every environment does: a cell that is stepped, its actions, its ends."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from dualbend.control.controller import Observation
from dualbend.run.record import RunRecord
from dualbend.run.stepped import open_cell
from dualbend.scenario.load import Settings
from dualbend.types import SIDES, Reals, Vector

SENSING = ('compliance.sensing=["left","right"]',)
"""Settings of an environment that is given none: both arms have a sensor."""

LARGEST_M, LARGEST_RAD = 2e-3, 0.1
"""Bounds of an action: deviation of a grip along x and z, and in pitch."""

_SEEDS = 2**31

Info = dict[str, Any]


class CellEnv(gymnasium.Env[Vector, Vector]):
    """A scenario's cell as an environment: a step is one command period.

    Actions (6,): deviation of the left arm along x and z [m] and in pitch [rad] from the nominal
    path, then of the right arm, each in its arm's bending frame, not cumulative. They take the
    place of the scenario's controller.

    An episode is terminated with its run: ``info`` has its ``outcome``, ``reason`` and ``metrics``
    then. A run that is not completed costs ``failure_cost``, else its early end would pay. Nothing
    is truncated. ``reset(seed=...)`` is a run with that seed of noise and imperfections; without
    one, the seed of the next run is drawn.

    Parameters
    ----------
    scenario, settings
        As :func:`dualbend.load_scenario` takes them. Without settings both arms have a sensor.
    failure_cost
        What is taken from the last reward of a run that is not completed.
    """

    action_space: Box[np.float64]
    observation_space: Box[np.float64]
    grip_bounds = (0.1, 0.1, 1.0)
    """Of what :meth:`grips` returns of each arm [m, m, rad]."""

    metadata = {"render_modes": []}  # noqa: RUF012 - as the base class has it

    def __init__(self, scenario: str, settings: Settings, failure_cost: float) -> None:
        self.cell = open_cell(scenario, settings)
        self.failure_cost = failure_cost
        largest = np.array([LARGEST_M, LARGEST_M, LARGEST_RAD] * len(SIDES))
        self.action_space = Box(-largest, largest, dtype=np.float64)
        force_n, torque_nm = self.cell.scenario.sensor.full_scale
        arm = [force_n, force_n, torque_nm, *self.grip_bounds]
        low, high = zip(*self.further(), strict=True)
        self.observation_space = Box(
            np.array([*(-each for each in (*arm, *arm)), *low]),
            np.array([*arm, *arm, *high]),
            dtype=np.float64,
        )

    @abstractmethod
    def further(self) -> list[tuple[float, float]]:
        """Return the bounds of what is observed besides the arms."""

    def grips(self, observation: Observation) -> Vector:
        """Return what is observed of the grips' poses (2, 3): how far they are off."""
        off: Vector = observation.measured.coordinates - observation.nominal.coordinates
        return off

    @abstractmethod
    def observed(self, observation: Observation) -> Sequence[Reals]:
        """Return what is observed besides the arms, of any leading shape."""

    @abstractmethod
    def rewarded(self) -> tuple[float, Info]:
        """Return reward and info of the cycle that the trace ends with."""

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Vector, Info]:
        """Begin a run; ``options`` says nothing here."""
        drawn = self.next_seed(seed)
        return self.begin(drawn), {"seed": drawn}

    def begin(self, seed: int) -> Vector:
        """Begin the run of a seed, which those that are drawn do not depend on."""
        return self.flat(self.cell.reset(seed))

    def next_seed(self, seed: int | None = None) -> int:
        """Return the seed of the run that is to begin: a given one, else the next that is drawn."""
        super().reset(seed=seed)
        return int(self.np_random.integers(_SEEDS)) if seed is None else seed

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, Info]:
        """Run one command cycle; an action out of its space is brought to the nearest in it."""
        seen = self.flat(self.cell.step(self.inside(action)))
        reward, info = self.rewarded()
        if self.cell.done:
            record = self.cell.record()
            info |= end_of(record)
            reward -= self.failure_cost * (record.outcome != "completed")
        return seen, reward, self.cell.done, False, info

    def inside(self, action: Vector) -> Vector:
        """Return actions (..., 6) brought into their space, of each arm (..., 2, 3)."""
        inside = np.clip(action, self.action_space.low, self.action_space.high)
        return inside.reshape(*inside.shape[:-1], len(SIDES), 3)

    def close(self) -> None:
        """End the run."""
        self.cell.close()

    def flat(self, observation: Observation) -> Vector:
        """Return what is observed (..., k), within the bounds of its space."""
        wrench = np.nan_to_num(observation.filtered.planar)
        arms = np.concatenate((wrench, self.grips(observation)), axis=-1)
        arms = arms.reshape(*arms.shape[:-2], -1)
        more = [np.broadcast_to(each, arms.shape[:-1]) for each in self.observed(observation)]
        flat = np.concatenate((arms, np.stack(more, axis=-1)), axis=-1)
        inside: Vector = np.clip(flat, self.observation_space.low, self.observation_space.high)
        return inside


def end_of(record: RunRecord) -> Info:
    """Return what the info of an episode's last step has of its run."""
    metrics = {name: metric.value for name, metric in record.metrics.items()}
    return {"outcome": record.outcome, "reason": record.reason, "metrics": metrics}
