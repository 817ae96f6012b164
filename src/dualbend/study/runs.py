"""A study's run in three steps, so that many of them can be one batch."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, TypeVarTuple

from dualbend.batch.many import BATCH, run_many
from dualbend.errors import InputError, refuse_below_one
from dualbend.resources import usable_cores
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.study.ending import record_of
from dualbend.study.engine import Key, Lost, Place
from dualbend.study.processes import in_processes

Row = TypeVar("Row")
Arguments = TypeVarTuple("Arguments")


@dataclass(frozen=True, kw_only=True)
class RunEach(Generic[*Arguments, Row]):
    """What a study does with the arguments of a run: make it, run it, tell what became of it.

    ``make`` returns the run, ``row`` is told its record, ``failed`` the exception that ended either
    of both; all are importable in another process. Called, it makes one run; many of them are one
    batch where they can be, each with the row that it has alone.

    Raises KeyboardInterrupt where the user ended a run: half a run is no result.
    """

    make: Callable[[*Arguments], Run]
    row: Callable[[RunRecord, *Arguments], Row]
    failed: Callable[[Exception, *Arguments], Row]

    def __call__(self, *arguments: *Arguments) -> Row:
        """Return the row of one run."""
        return self.many([arguments])[0]

    def many(self, tasks: Sequence[tuple[*Arguments]], **how: Any) -> list[Row]:  # noqa: ANN401
        """Return the rows of many runs, in their order; ``how`` as :func:`run_many` has it."""
        rows: dict[int, Row] = {}
        made: list[int] = []

        def ready() -> Generator[Run]:
            for i, arguments in enumerate(tasks):
                try:
                    run = self.make(*arguments)
                except Exception as error:  # one bad run must not end the study
                    rows[i] = self.failed(error, *arguments)
                else:
                    made.append(i)
                    yield run

        for at, record in run_many(ready(), **how):
            i = made[at]
            try:
                rows[i] = self.row(record_of(record), *tasks[i])
            except Exception as error:
                rows[i] = self.failed(error, *tasks[i])
        return [rows[i] for i in range(len(tasks))]


def on_device(device: str, batch: int, on_note: Callable[[str], None] = lambda _: None) -> Place:
    """Return a place that makes batches of runs here, their physics on a device.

    Raises InputError, when runs are made, where the study's runs can be no batch or there is no
    such device.
    """

    def ended(
        tasks: Mapping[Key, tuple[*Arguments]], run_one: Callable[[*Arguments], Row]
    ) -> Generator[tuple[Key, Row | Lost]]:
        if not isinstance(run_one, RunEach):
            raise InputError(f"--device {device}: this study's runs are made one by one")
        every = list(tasks)
        for first in range(0, len(every), batch):
            keys = every[first : first + batch]
            many = [tasks[key] for key in keys]
            rows = run_one.many(many, batch=batch, device=device, on_note=on_note)
            yield from zip(keys, rows, strict=True)

    return ended


def in_batches(
    workers: int | None = None, batch: int = BATCH, *, cluster: Place | None = None
) -> Place:
    """Return a place whose workers make batches of runs, where the study's can be one.

    ``workers`` processes at most, by default one for each core, each of which has a batch of at
    most ``batch`` runs at a time; with a ``cluster`` its workers are meant. Where one dies, each
    run of its batch is made by itself. Raises InputError for less than one.
    """
    refuse_below_one(batch=batch)
    place = in_processes(workers) if cluster is None else cluster
    at_once = 1 if cluster is not None else workers or usable_cores()

    def ended(
        tasks: Mapping[Key, tuple[*Arguments]], run_one: Callable[[*Arguments], Row]
    ) -> Generator[tuple[Key, Row | Lost]]:
        alone, size = run_one, min(batch, math.ceil(len(tasks) / at_once))
        if not isinstance(run_one, RunEach) or size < 2:
            yield from place(tasks, run_one)
            return
        every = list(tasks)
        batches = [tuple(every[first : first + size]) for first in range(0, len(every), size)]
        many = {keys: ([tasks[key] for key in keys],) for keys in batches}
        for keys, rows in place(many, run_one.many):
            if isinstance(rows, Lost):
                yield from place({key: tasks[key] for key in keys}, alone)
            else:
                yield from zip(keys, rows, strict=True)

    return ended
