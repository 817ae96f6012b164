"""One engine under every study of many runs: what is done is kept, what is left is made somewhere.

A study's runs depend neither on where they are made (:mod:`dualbend.study.processes`,
:mod:`dualbend.study.cluster`), nor on the order in which they end, nor on how often it was
interrupted.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, closing, nullcontext, suppress
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, TypeVarTuple

from dualbend.errors import DualbendError
from dualbend.interrupts import uninterrupted
from dualbend.study.folder import StudyFolder

Key = TypeVar("Key", bound=Hashable)
Row = TypeVar("Row")
Arguments = TypeVarTuple("Arguments")


class WorkerDiedError(DualbendError):
    """A worker process ended before its run did."""

    def __init__(self) -> None:
        super().__init__(
            "a worker process died, out of memory perhaps; the runs that were done are kept, "
            "the same command goes on"
        )


@dataclass(frozen=True)
class Lost:
    """A run that ended the processes that it was tried in, and what is to be said of it."""

    reason: str


class Place(Protocol):
    """Somewhere to make runs: yields each one's row, or that it is lost, as it ends."""

    def __call__(
        self, tasks: Mapping[Key, tuple[*Arguments]], run_one: Callable[[*Arguments], Row]
    ) -> Generator[tuple[Key, Row | Lost]]:
        """Yield key and row; a generator that is closed ends what is being made."""


@dataclass(frozen=True, kw_only=True)
class Study(Generic[Key, *Arguments, Row]):
    """Many runs.

    ``design``: the keys of all runs, in the order of the rows; ``task``: the arguments of a key's
    run, or its row where that is known without a run; ``run_one`` makes a run and is importable in
    another process; ``key``: that of a row; ``lost``: the row of a run whose workers died, by key
    and reason, without which that is an error.
    """

    design: Sequence[Key]
    task: Callable[[Key], tuple[*Arguments] | Row]
    run_one: Callable[[*Arguments], Row]
    key: Callable[[Row], Key]
    lost: Callable[[Key, str], Row] | None = None

    def run(
        self,
        place: Place,
        folder: StudyFolder[Row] | None = None,
        on_run: Callable[[int, int, Row | None], None] = lambda *_: None,
    ) -> list[Row]:
        """Make the runs that the folder does not have yet, each kept there as it ends; return all.

        ``on_run`` is called with the number of runs that are done, that of all, and the last row:
        None at the start.

        Raises InputError where the folder is another study's, is in use or cannot be used;
        WorkerDiedError where a run is lost and there is no row for that; KeyboardInterrupt where it
        is interrupted: what was done is in the folder, and the same call goes on.
        """
        kept: AbstractContextManager[tuple[dict[Hashable, Row], Callable[[Row], None]]]
        kept = nullcontext(({}, lambda _: None)) if folder is None else folder.opened(self.key)
        with kept as (old, keep):
            done = {key: old[key] for key in self.design if key in old}
            on_run(len(done), len(self.design), None)

            def add(key: Key, row: Row) -> None:
                keep(row)
                done[key] = row
                on_run(len(done), len(self.design), row)

            tasks: dict[Key, tuple[*Arguments]] = {}
            for key in self.design:
                if key not in done:
                    task = self.task(key)
                    if isinstance(task, tuple):
                        tasks[key] = task
                    else:
                        add(key, task)
            # Closed also where an interrupt comes between two runs.
            with closing(place(tasks, self.run_one)) as ended:
                for key, row in ended:
                    if not isinstance(row, Lost):
                        add(key, row)
                    elif self.lost is not None:
                        add(key, self.lost(key, row.reason))
                    else:
                        raise WorkerDiedError
            return [done[key] for key in self.design]


def as_they_end(
    executor: Executor,
    tasks: Mapping[Key, tuple[*Arguments]],
    run_one: Callable[[*Arguments], Row],
    at_once: int,
) -> Generator[tuple[Key, Future[Row]]]:
    """Yield each task's future as it ends, ``at_once`` of them submitted ahead.

    Tasks that a broken pool does not take are left out.
    """
    left = iter(list(tasks.items()))
    running: dict[Future[Row], Key] = {}

    def submit(count: int) -> None:
        # A new process must not be interrupted before it can say that it is not to be.
        with uninterrupted(), suppress(BrokenProcessPool):
            for key, task in itertools.islice(left, count):
                running[executor.submit(run_one, *task)] = key

    submit(at_once)
    while running:
        ended = wait(running, return_when=FIRST_COMPLETED).done
        submit(len(ended))
        for future in [future for future in running if future in ended]:
            yield running.pop(future), future
