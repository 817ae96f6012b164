"""Controllers of a user's own, as a scenario names them: ``support.controllers:Turn``."""

import functools
import sys
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from dualbend import Observation, Scenario
from dualbend.types import Vector, said


class Still:
    """Complies with nothing."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def __call__(self, observation: Observation) -> Vector:
        return np.zeros((2, 6))


class Turn:
    """Turns the left arm with its moment, M/b, of which only that arm's deviation is returned."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        b: Annotated[float, said("damping [N m/rad]", gt=0)],
        times: int = 1,
    ) -> None:
        self.b, self.times = b, times

    def __call__(self, observation: Observation) -> Vector:
        deviation = np.zeros(6)
        deviation[4] = self.times * observation.filtered.torque_nm[0, 1] / self.b
        return deviation


class Constant:
    """Deviates by the same in every cycle."""

    def __init__(self, scenario: Scenario, deviation: list[float]) -> None:
        self.deviation = deviation

    def __call__(self, observation: Observation) -> Any:
        return self.deviation


class Fails:
    """Does nothing in so many cycles, then returns what it is told to, or raises."""

    def __init__(self, scenario: Scenario, after: int = 4, gives: Any = None) -> None:
        self.after, self.gives, self.cycles = after, gives, 0

    def __call__(self, observation: Observation) -> Any:
        self.cycles += 1
        if self.cycles <= self.after:
            return np.zeros((2, 6))
        if self.gives is None:
            raise KeyError("gain")
        return self.gives


class Typed(Still):
    """Says of which types its options are, some of which no file can hold."""

    def __init__(
        self,
        scenario: Scenario,
        weights: list[float] | None = None,
        table: np.ndarray | None = None,
        either: "float | str" = 1.0,
        later: "Unknown" = 2,  # type: ignore[name-defined]  # noqa: F821
        mode: Literal["a", "b"] = "a",
    ) -> None:
        super().__init__(scenario)
        self.given = (weights, table, either, later, mode)


partly = functools.partial(Turn, b=3.0)
"""A factory without a name."""


class Leaves(Still):
    """Ends the program."""

    def __init__(self, scenario: Scenario) -> None:
        sys.exit("bye")


class Raises:
    """Cannot be made."""

    def __init__(self, scenario: Scenario) -> None:
        raise ValueError("no licence")

    def __call__(self, observation: Observation) -> Vector:
        return np.zeros((2, 6))


class Listener(Still):
    """Keeps what it was told."""

    made: ClassVar[list["Listener"]] = []

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.told: list[Observation] = []
        Listener.made.append(self)

    def __call__(self, observation: Observation) -> Vector:
        self.told.append(observation)
        return super().__call__(observation)
