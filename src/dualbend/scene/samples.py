"""When the wrist sensors take a sample, and which one a command is told."""

from __future__ import annotations

from collections import deque

from dualbend.scene.observation import SensorSample
from dualbend.types import Vector


class SampleLine:
    """Samples of sensors on their way to the controller; all times in physics steps.

    ``latency``: least age of what a cycle of ``steps`` is told. The youngest sample is one step
    old: the force that acts during a step is known when it is done. ``sampling``: between two
    samples of sensors that run by their own clock, from the start on; None: one for each command,
    of just the least age. A sample is the wrenches and axes of both sensors, of any leading shape.
    """

    def __init__(self, latency: int, sampling: int | None, steps: int) -> None:
        # A sample that is taken after step i, counted from 1, is one step old when that step ends.
        self._latency = max(latency, 1) - 1
        self._sampling = sampling or steps
        self._first = 0 if sampling else -self._latency
        self._taken: deque[tuple[int, tuple[Vector, Vector]]] = deque()
        self._done = 0

    def reset(self, sample: tuple[Vector, Vector]) -> SensorSample:
        """Begin with a sample: what was taken before is as it is now."""
        self._done = 0
        last, older = -(-self._first % self._sampling), self._latency // self._sampling + 1
        self._taken = deque((last - k * self._sampling, sample) for k in range(older, -1, -1))
        self._newest()
        return _sample(sample, new=True)

    @property
    def taken(self) -> tuple[Vector, Vector]:
        """The oldest sample that is kept."""
        return self._taken[0][1]

    @property
    def to_next(self) -> int:
        """Steps from now to the next sample, at least one."""
        return self._sampling - (self._done - self._first) % self._sampling

    def passed(self, steps: int) -> bool:
        """Count steps that are done; tell whether a sample is to be taken now."""
        self._done += steps
        return (self._done - self._first) % self._sampling == 0

    def take(self, sample: tuple[Vector, Vector]) -> None:
        """Take a sample."""
        self._taken.append((self._done, sample))

    def told(self) -> SensorSample:
        """Return what the next command is told."""
        before, _ = self._taken[0]
        newest, sample = self._newest()
        return _sample(sample, new=newest != before)

    def _newest(self) -> tuple[int, tuple[Vector, Vector]]:
        """Forget what is older than the newest sample that is as old as it must be; return it."""
        while len(self._taken) > 1 and self._taken[1][0] <= self._done - self._latency:
            self._taken.popleft()
        return self._taken[0]


def _sample(taken: tuple[Vector, Vector], *, new: bool) -> SensorSample:
    wrench, rotation = taken
    return SensorSample(wrench=wrench, rotation=rotation, new=new)
