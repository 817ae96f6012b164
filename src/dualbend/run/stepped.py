"""A run one command cycle at a time, for scripts and notebooks: the loop is that of every run."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from dualbend.control.controller import Observation
from dualbend.errors import InputError
from dualbend.run.loop import Asking
from dualbend.run.make import make_run
from dualbend.run.outcome import TaskStopped
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace
from dualbend.scenario.load import Settings, load_scenario, resolve_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.toml_text import parse_toml
from dualbend.scene.warnings import warnings_counted_only
from dualbend.types import SIDES, Vector


def open_cell(
    scenario: Scenario | str,
    settings: Settings = (),
    seed: int | None = None,
    *,
    on_cycle: Callable[[Cell], None] | None = None,
) -> Cell:
    """Return the cell of a scenario, of a shipped one by name or of a file, to be stepped.

    ``settings`` and ``seed`` as :func:`load_scenario` takes them; ``on_cycle``: what
    :class:`Cell` calls. Raises InputError where the scenario or a setting is wrong.
    """
    if not isinstance(scenario, Scenario):
        return Cell(load_scenario(scenario, settings, seed), on_cycle)
    if settings:
        raise InputError("settings are laid over a name or a file: give them to load_scenario")
    return Cell(scenario if seed is None else _seeded(scenario, seed), on_cycle)


class Cell:
    """Both arms with the sheet, run from one command cycle to the next.

    Call :meth:`reset`, then :meth:`step` until ``done``. ``with`` closes it.

    Parameters
    ----------
    scenario
        Says everything about the cell; ``scenario`` has the seed of the last :meth:`reset`.
    on_cycle
        Called with this cell after every command cycle, those after a protective stop too:
        ``cell.trace["left_filtered_moment_y"][-1]`` is then the cycle's moment.

    Attributes
    ----------
    observation : what the controller knows in the cycle that :meth:`step` runs next
    """

    observation: Observation

    def __init__(self, scenario: Scenario, on_cycle: Callable[[Cell], None] | None = None) -> None:
        self.scenario, self._on_cycle = scenario, on_cycle
        self._walk: Asking[RunRecord] | None = None
        self._left: RunRecord | None = None

    def reset(self, seed: int | None = None) -> Observation:
        """Begin a run from the start, with another seed where one is given.

        Raises InputError where the scenario cannot be run, or ends before a controller is asked.
        """
        if seed is not None:
            self.scenario = _seeded(self.scenario, seed)
        self.run = make_run(self.scenario)
        self._walk, self._left = self.run.walk(self._tell), None
        self._advance(next)
        if self._left is not None:
            raise InputError(
                f"scenario {self.scenario.name!r} ends before its first cycle: {self._left.reason}"
            )
        return self.observation

    def step(self, action: ArrayLike | None = None) -> Observation:
        """Run one command cycle and return what is observed in the next; the last one at the end.

        ``action`` (2, 6), or (2, 3) in the plane: the deviation of the left and the right arm from
        the nominal path, x, y, z [m], roll, pitch, yaw [rad], or x, z and pitch, each in its arm's
        bending frame, not cumulative. It is executed as a controller's is: after the transport
        delay, within the guard, and an arm that cannot get there stops. None: the scenario's own
        controller acts.

        Raises
        ------
        InputError
            The run has ended or was not begun, or the action is not such finite numbers.
        """
        deviation = None if action is None else _deviation(action)
        self._running()
        self._advance(lambda walk: walk.send(deviation))
        return self.observation

    @property
    def done(self) -> bool:
        """The run has come to its end, whatever ended it."""
        return self._left is not None

    @property
    def trace(self) -> Trace:
        """The trace of the run so far: ``cell.trace["time"]`` is a column."""
        self._begun()
        return self.run.trace

    def record(self) -> RunRecord:
        """Return what the run has left; one that is not at its end is ended here, as aborted."""
        self._begun()
        if self._left is None:
            self._advance(lambda walk: walk.throw(TaskStopped("ended by the script")))
        assert self._left is not None  # nothing goes on after it
        return self._left

    def close(self) -> None:
        """End the run that is not at its end; :meth:`reset` begins another one."""
        if self._walk is not None:
            self.record()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _tell(self, _: int) -> None:
        if self._on_cycle is not None:
            self._on_cycle(self)

    def _begun(self) -> Asking[RunRecord]:
        if self._walk is None:
            raise InputError("the cell has no run yet: cell.reset() begins one")
        return self._walk

    def _running(self) -> None:
        self._begun()
        if self._left is not None:
            raise InputError(
                f"the run has ended ({self._left.outcome}): cell.reset() begins another"
            )

    def _advance(self, move: Callable[[Asking[RunRecord]], Observation]) -> None:
        """Go to where the controller is asked next, or to the end."""
        walk = self._begun()
        with warnings_counted_only():
            try:
                self.observation = move(walk)
            except StopIteration as end:
                self._left = end.value
        if self._left is not None and self._left.signal:
            raise KeyboardInterrupt


def _seeded(scenario: Scenario, seed: int) -> Scenario:
    """Return a scenario with another seed, which is checked."""
    tables = parse_toml(scenario.to_toml(), scenario.name)
    return resolve_scenario(tables, f"scenario {scenario.name!r}", seed=seed)


def _deviation(action: ArrayLike) -> Vector:
    """Return the deviation (2, 6) of an action (2, 3) or (2, 6); InputError where it is none."""
    try:
        given = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"action: no array of numbers: {error}") from error
    if given.ndim != 2 or given.shape[0] != len(SIDES) or given.shape[1] not in (3, 6):
        raise InputError(
            f"action: of shape {given.shape}; need (2, 3): x, z [m] and pitch [rad] of each arm, "
            "or (2, 6): x, y, z, roll, pitch, yaw"
        )
    if not np.isfinite(given).all():
        raise InputError(f"action: not finite: {given.tolist()}")
    if given.shape[1] == 6:
        return given.copy()
    deviation = np.zeros((len(SIDES), 6))
    deviation[:, ::2] = given
    return deviation
