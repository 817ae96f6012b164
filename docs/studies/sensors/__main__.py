"""The command of the study: ``python docs/studies/sensors`` prints its table."""

from __future__ import annotations

import sys
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from dualbend.errors import DualbendError
from sensors.known import table


@click.command()
@click.option("--cells", type=click.IntRange(1), default=10, show_default=True)
def main(cells: int) -> None:
    """Compare what may be known of the sensors of ``learned``, in cells of so many seeds."""
    try:
        click.echo(table(cells).markdown())
    except DualbendError as error:
        raise click.UsageError(str(error)) from error


if __name__ == "__main__":
    main()
