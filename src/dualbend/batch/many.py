"""Runs of any kind to their ends: those of one structure as a batch, the others one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from dualbend.batch.group import alone, grouped
from dualbend.batch.loop import BatchLoop
from dualbend.batch.physics import Physics
from dualbend.errors import InputError, brief, refuse_below_one
from dualbend.run.cell import RobotCell
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.task.bending.run import BendingRun

BATCH = 32
"""Runs of one batch at most, by default: beyond it the control of a world hardly gets cheaper."""


def run_many(
    runs: Iterable[Run],
    *,
    batch: int = BATCH,
    threads: int = 1,
    device: str = "",
    on_note: Callable[[str], None] = lambda _: None,
) -> Iterator[tuple[int, RunRecord | Exception]]:
    """Run all, each to the bit as if it were alone; yield the number and record of each as it ends.

    Of a run that raises, the exception takes the place of its record. ``runs`` that are made one by
    one, by a generator, need less memory: their states are let go before the next is made.

    ``batch``: runs of one batch at most; ``threads`` for their physics. With a ``device``, "cuda"
    or "cpu", the physics of batches is MuJoCo Warp's there, in single precision: what ends early is
    run again alone, on the CPU. ``on_note`` is called with what the user should know while waiting.

    Raises InputError where something is no run or stands twice, there is no such device, or MuJoCo
    Warp cannot simulate the cells.
    """
    refuse_below_one(batch=batch, threads=threads)
    physics = _on(device, on_note) if device else None
    made: list[Run] = []
    groups = grouped(_let_go(runs, made), batch)
    if len({id(run) for run in made}) < len(made):
        raise InputError("runs: one stands twice; each has a cell of its own, make it again")
    for group in groups:
        worlds = [run for run in (made[i] for i in group) if isinstance(run, BendingRun)]
        left = set(group)
        if len(worlds) > 1:
            for world, record in BatchLoop(worlds, threads, physics).run():
                left.remove(group[world])
                yield group[world], record
        for i in sorted(left):
            yield i, _run(made[i])


def _let_go(runs: Iterable[Run], made: list[Run]) -> Iterator[Run]:
    """Yield runs, note them, and let their cells go before the next is made: they begin again."""
    for run in runs:
        if not isinstance(run, Run):
            raise InputError(f"runs: each must be one that make_run returns, got {brief(run)}")
        made.append(run)
        yield run
        if not alone(run):
            run.cell.let_go()


def _run(run: Run) -> RunRecord | Exception:
    try:
        return run.run()
    except Exception as error:  # it is one of many
        return error


def _on(device: str, on_note: Callable[[str], None]) -> Callable[[Sequence[RobotCell]], Physics]:
    from dualbend.batch.gpu.stepper import DevicePhysics  # noqa: PLC0415 - an extra

    return lambda cells: DevicePhysics(cells, device, on_note)
