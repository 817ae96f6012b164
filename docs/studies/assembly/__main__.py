"""The command of the study: ``python docs/studies/assembly PART`` makes a part's runs."""

from __future__ import annotations

import sys
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from assembly.faults import KINDS
from assembly.parts import PARTS
from assembly.study import NAMES, run_part
from assembly.table import case_table, wrong
from dualbend.errors import DualbendError


@click.command()
@click.argument("part", type=click.Choice(NAMES))
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/assembly"))
@click.option("--seeds", "--draws", "count", type=click.IntRange(1), help="Of each case.")
@click.option("--only", type=click.Choice(KINDS), multiple=True, help="Of faults; repeatable.")
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(part: str, out: Path, count: int | None, only: tuple[str, ...], workers: int) -> None:
    """Make the runs of a part, and go on where it was interrupted; then print what they say."""

    def on_run(done: int, of: int, _: object) -> None:
        click.echo(f"\r{done} of {of} runs", nl=False, err=True)

    try:
        runs = run_part(part, out, count, only=only, workers=workers, on_run=on_run)
    except DualbendError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"\n{case_table(runs).markdown()}\n")
    for item in wrong(runs, lays=part in PARTS and PARTS[part].lays):
        click.echo(item)


if __name__ == "__main__":
    main()
