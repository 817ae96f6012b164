"""Command that runs a scenario many times with different values of its keys."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import PATH, WORKERS, command, exit_interrupted
from dualbend.errors import InputError


@command(
    "dualbend sweep gains.toml --workers 2",
    "dualbend sweep gains.toml --scheduler tcp://127.0.0.1:8786",
)
@click.argument("file", type=PATH)
@click.option("--out", type=PATH, help="Folder of the sweep.  [default: runs/NAME]")
@WORKERS
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler, e.g. tcp://HOST:PORT.")
def sweep(file: Path, out: Path | None, workers: int | None, scheduler: str | None) -> None:
    """Run a scenario over many values of its keys.

    FILE defines the keys and values (docs/sweeps.md), or is the folder of a sweep. The same command
    continues a sweep that was interrupted. For a finished sweep it writes table and pictures again.
    """
    from dualbend.study.processes import in_processes
    from dualbend.study.sweep.design import make_design
    from dualbend.study.sweep.file import load_sweep
    from dualbend.study.sweep.progress import Progress
    from dualbend.study.sweep.report import report_lines, write_report
    from dualbend.study.sweep.run import run_sweep

    if workers is not None and scheduler is not None:
        raise InputError("--workers is for local runs, --scheduler has its own: give one of them")
    loaded = load_sweep(file)
    design = make_design(loaded)
    folder = out or (file if file.is_dir() else Path("runs") / loaded.name)
    place = in_processes(workers)
    if scheduler is not None:
        from dualbend.study.cluster import on_cluster

        place = on_cluster(scheduler, lambda note: click.echo(note, err=True))
    progress = Progress()
    try:
        rows = run_sweep(loaded, design, folder, place, on_run=progress)
    except KeyboardInterrupt:
        progress.end_line()
        exit_interrupted(progress.done, progress.total, folder)
    report = write_report(loaded, design, rows, folder)
    click.echo("\n".join(report_lines(loaded, design, rows, report)))
    click.echo(f"results in {folder}")
