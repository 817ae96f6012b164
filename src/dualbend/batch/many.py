"""Runs of any kind to their ends: those of one structure as a batch, the others one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dualbend.batch.group import grouped
from dualbend.batch.loop import BatchLoop
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.task.bending.run import BendingRun

BATCH = 32
"""Runs of one batch at most, by default: beyond it the control of a world hardly gets cheaper."""


def run_many(
    runs: Sequence[Run], *, batch: int = BATCH, threads: int = 1
) -> Iterator[tuple[int, RunRecord]]:
    """Run all, each to the bit as if it were alone; yield the number and record of each as it ends.

    ``batch``: runs of one batch at most; ``threads`` for their physics.
    """
    for group in grouped(runs, batch):
        worlds = [run for run in (runs[i] for i in group) if isinstance(run, BendingRun)]
        loop = BatchLoop(worlds, threads) if len(worlds) > 1 else None
        if loop is not None:
            for world, record in loop.run():
                yield group[world], record
        for world, i in enumerate(group):
            if loop is None or loop.left[world]:
                yield i, runs[i].run()
