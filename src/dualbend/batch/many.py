"""Runs of any kind to their ends: those of one structure as a batch, the others one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from dualbend.batch.group import grouped
from dualbend.batch.loop import BatchLoop
from dualbend.batch.physics import Physics
from dualbend.run.cell import RobotCell
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.task.bending.run import BendingRun

BATCH = 32
"""Runs of one batch at most, by default: beyond it the control of a world hardly gets cheaper."""


def run_many(
    runs: Sequence[Run],
    *,
    batch: int = BATCH,
    threads: int = 1,
    device: str = "",
    on_note: Callable[[str], None] = lambda _: None,
) -> Iterator[tuple[int, RunRecord]]:
    """Run all, each to the bit as if it were alone; yield the number and record of each as it ends.

    ``batch``: runs of one batch at most; ``threads`` for their physics. With a ``device``, "cuda"
    or "cpu", the physics of batches is MuJoCo Warp's there, in single precision: what ends early is
    run again alone, on the CPU. ``on_note`` is called with what the user should know while waiting.

    Raises InputError where there is no such device, or MuJoCo Warp cannot simulate the cells.
    """
    physics = _on(device, on_note) if device else None
    for group in grouped(runs, batch):
        worlds = [run for run in (runs[i] for i in group) if isinstance(run, BendingRun)]
        loop = BatchLoop(worlds, threads, physics) if len(worlds) > 1 else None
        if loop is not None:
            for world, record in loop.run():
                yield group[world], record
        for world, i in enumerate(group):
            if loop is None or loop.left[world]:
                yield i, runs[i].run()


def _on(device: str, on_note: Callable[[str], None]) -> Callable[[Sequence[RobotCell]], Physics]:
    from dualbend.batch.gpu.stepper import DevicePhysics  # noqa: PLC0415 - an extra

    return lambda cells: DevicePhysics(cells, device, on_note)
