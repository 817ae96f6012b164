"""The command of the study: ``python docs/studies/fig8`` makes its runs and prints its tables."""

from __future__ import annotations

import sys
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from dualbend.errors import DualbendError
from fig8.changes import CONTROLLED
from fig8.window import control_table, run_window, window_table


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/fig8-window"))
@click.option("--seeds", type=click.IntRange(1), default=20, show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, seeds: int, workers: int) -> None:
    """Change one thing at a time; takes an hour, and goes on where it was interrupted."""
    try:
        runs = run_window(
            out,
            seeds=seeds,
            workers=workers,
            on_run=lambda done, of, _: click.echo(f"\r{done} of {of} runs", nl=False, err=True),
        )
    except DualbendError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"\n{window_table(runs, seeds).markdown()}\n")
    click.echo(control_table(runs, CONTROLLED).markdown())


if __name__ == "__main__":
    main()
