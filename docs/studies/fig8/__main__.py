"""The command of the study: ``python docs/studies/fig8`` makes its runs and prints its tables."""

from __future__ import annotations

import sys
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from dualbend.errors import DualbendError
from fig8.changes import CONTROLLED
from fig8.held import held_table, run_held
from fig8.window import control_table, run_window, window_table

_HELD_SEEDS = 20
"""With which fig6 is held at the knots, at most."""


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/fig8-window"))
@click.option("--seeds", type=click.IntRange(1), default=20, show_default=True)
@click.option(
    "--mixtures",
    type=click.IntRange(1),
    default=20,
    show_default=True,
    help="Seeds of fig6 and fig8 for the tails of the distribution; two runs each.",
)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, seeds: int, mixtures: int, workers: int) -> None:
    """Change one thing at a time; takes an hour, and goes on where it was interrupted."""

    def on_run(done: int, of: int, _: object) -> None:
        click.echo(f"\r{done} of {of} runs", nl=False, err=True)

    try:
        runs = run_window(out, seeds=seeds, mixtures=mixtures, workers=workers, on_run=on_run)
        held = run_held(out / "held", seeds=min(seeds, _HELD_SEEDS), workers=workers, on_run=on_run)
    except DualbendError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"\n{window_table(runs, seeds, mixtures=mixtures).markdown()}\n")
    click.echo(f"{control_table(runs, CONTROLLED).markdown()}\n")
    click.echo(held_table(held).markdown())


if __name__ == "__main__":
    main()
