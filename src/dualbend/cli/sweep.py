"""Commands that run a scenario many times: with other values of its keys, with imperfections."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.cli.common import (
    PATH,
    SCENARIO,
    SETTINGS,
    WORKERS,
    command,
    exit_interrupted,
    load,
)
from dualbend.errors import InputError, writing
from dualbend.files import write_whole

if TYPE_CHECKING:
    from dualbend.imperfection.config import PresetName


@command(
    "dualbend sweep gains.toml --workers 2",
    "dualbend sweep gains.toml --scheduler tcp://127.0.0.1:8786",
)
@click.argument("file", type=PATH)
@click.option("--out", type=PATH, help="Folder of the sweep.  [default: runs/NAME]")
@WORKERS
@click.option(
    "--batch",
    type=click.IntRange(1, 65536),
    default=32,
    show_default=True,
    help="Runs at once in each worker, at most.",
)
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler, e.g. tcp://HOST:PORT.")
@click.option("--device", help="Physics of the batches by MuJoCo Warp there: cuda, cuda:1, cpu.")
def sweep(
    file: Path,
    out: Path | None,
    workers: int | None,
    batch: int,
    scheduler: str | None,
    device: str | None,
) -> None:
    """Run a scenario over many values of its keys.

    FILE defines the keys and values (docs/sweeps.md), or is the folder of a sweep. The same command
    continues a sweep that was interrupted. For a finished sweep it writes table and pictures again.
    """
    from dualbend.study.runs import in_batches, on_device
    from dualbend.study.sweep.design import make_design
    from dualbend.study.sweep.file import load_sweep
    from dualbend.study.sweep.progress import Progress
    from dualbend.study.sweep.report import report_lines, write_report
    from dualbend.study.sweep.run import run_sweep

    if workers is not None and scheduler is not None:
        raise InputError("--workers is for local runs, --scheduler has its own: give one of them")
    if device is not None and (workers, scheduler) != (None, None):
        raise InputError("--device is for runs in this process: without --workers and --scheduler")
    loaded = load_sweep(file)
    design = make_design(loaded)
    folder = out or (file if file.is_dir() else Path("runs") / loaded.name)
    cluster = None
    if scheduler is not None:
        from dualbend.study.cluster import on_cluster

        cluster = on_cluster(scheduler, lambda note: click.echo(note, err=True))
    place = in_batches(workers, batch, cluster=cluster)
    if device is not None:
        place = on_device(device, batch, lambda note: click.echo(note, err=True))
    progress = Progress()
    try:
        rows = run_sweep(loaded, design, folder, place, device=device, on_run=progress)
    except KeyboardInterrupt:
        progress.end_line()
        exit_interrupted(progress.done, progress.total, folder)
    report = write_report(loaded, design, rows, folder)
    click.echo("\n".join(report_lines(loaded, design, rows, report)))
    click.echo(f"results in {folder}")


@command("dualbend imperfections fig8 --preset worst --seeds 5")
@SCENARIO
@click.option(
    "--preset",
    type=click.Choice(["typical", "worst"]),
    default="typical",
    show_default=True,
    help="Numbers of the imperfections.",
)
@click.option(
    "--seeds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Runs of each."
)
@WORKERS
@click.option("--out", type=PATH, help="Folder of the study.")
@SETTINGS
def imperfections(
    scenario: str,
    preset: PresetName,
    seeds: int,
    workers: int | None,
    out: Path | None,
    settings: tuple[str, ...],
) -> None:
    """Run each imperfection alone, then all together.

    The scenario is run without imperfections, with each one, and with all. The same command
    continues a study that was interrupted.
    """
    from dualbend.study.imperfections import run_study, table
    from dualbend.study.sweep.progress import Progress

    loaded = load(scenario, settings)
    folder = out or Path("runs") / f"{loaded.name}-imperfections"
    progress = Progress()
    try:
        rows = run_study(loaded, preset, folder, seeds=seeds, workers=workers, on_run=progress)
    except KeyboardInterrupt:
        progress.end_line()
        exit_interrupted(progress.done, progress.total, folder)
    found = table(rows)
    with writing(folder, "--out"):
        write_whole(folder / "table.md", found.markdown() + "\n")
    click.echo(found.text())
    for row in {row.part: row for row in rows if row.reason}.values():
        click.echo(f"{row.part}, seed {row.seed}: {row.outcome}: {row.reason}")
    click.echo(f"results in {folder}")
