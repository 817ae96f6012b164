"""Commands of the assembly: plan, robustness."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import (
    JSON,
    PATH,
    SCENARIO,
    SETTINGS,
    WORKERS,
    command,
    exit_interrupted,
    load,
    progress_bar,
    shown,
)
from dualbend.errors import writing
from dualbend.files import write_whole


@command("dualbend plan pwb --set task.layout.holes.clearance_m=1e-4")
@SCENARIO
@SETTINGS
@JSON
def plan(scenario: str, settings: tuple[str, ...], as_json: bool) -> None:
    """Plan at which bending angles the holes fit the pins.

    At these angles the middle holes fit over their pins and the outer holes are clear of theirs.

    No run is made. A layout without such an angle is refused; the message says what is missing.
    """
    import json

    from dualbend.planning.plan import plan_summary
    from dualbend.task.assembly.run import assembly_plan

    loaded = load(scenario, settings)
    found = plan_summary(assembly_plan(loaded), loaded.path.end_rad)
    if as_json:
        click.echo(json.dumps({name: value for name, (value, _) in found.items()}, indent=2))
        return
    for name, (value, unit) in found.items():
        click.echo(f"{name:<30}{shown(value):>12}  {unit}")


@command("dualbend robustness pwb --runs 40 --workers 2")
@SCENARIO
@click.option("--runs", type=click.IntRange(min=1), required=True, help="Number of draws.")
@click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    default=1,
    show_default=True,
    help="Seed of the draws.",
)
@WORKERS
@click.option("--out", type=PATH, help="Folder of the study.")
@SETTINGS
def robustness(
    scenario: str,
    runs: int,
    seed: int,
    workers: int | None,
    out: Path | None,
    settings: tuple[str, ...],
) -> None:
    """Assemble many sheets with errors.

    Random errors are drawn with the standard deviations of task.spread. The same command
    continues a study that was interrupted. Each sheet is assembled with compliance and without.
    """
    from dualbend.interrupts import uninterrupted
    from dualbend.run.disk.output import json_text
    from dualbend.study.robustness.figure import plot_success
    from dualbend.study.robustness.run import run_study
    from dualbend.study.robustness.summary import summarise, table

    loaded = load(scenario, settings)
    folder = out if out is not None else Path("runs") / f"{loaded.name}-robustness"
    done = 0
    try:
        with progress_bar(0, loaded.name) as bar:

            def show(count: int, total: int, _: object) -> None:
                nonlocal done
                bar.length = total
                bar.update(count - done)
                done = count

            trials = run_study(loaded, folder, runs=runs, seed=seed, workers=workers, on_run=show)
    except KeyboardInterrupt:
        exit_interrupted(done, bar.length, folder)
    numbers = summarise(loaded, seed, trials, folder)
    with uninterrupted():
        with writing(folder, "--out"):
            write_whole(folder / "summary.json", json_text(numbers))
        plot_success(trials, loaded, folder / "success.png")
    click.echo("\n".join(table(numbers)))
    click.echo(f"results in {folder}")
