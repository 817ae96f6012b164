"""The command of the filter study: ``python docs/studies/filters`` prints its table."""

from __future__ import annotations

import sys
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from dualbend.errors import DualbendError
from dualbend.scenario.load import load_scenario
from filters.filters import filters_compared, table

STRIP = Path(__file__).parents[1] / "icra1995" / "strip-fig9.toml"
"""Has the axis x that the shipped scenarios leave out."""


@click.command()
@click.argument("scenario", default=str(STRIP))
@click.option("--axis", type=click.Choice(["x", "rotation"]), default="x", show_default=True)
@click.option("--angle", default=0.2, show_default=True, help="Bending angle that is held [rad].")
@click.option("--ray", default=80.0, show_default=True, help="k/b [1/s].")
@click.option("--friction/--no-friction", default=True, help="With the joints' dry friction.")
def main(scenario: str, axis: str, angle: float, ray: float, friction: bool) -> None:
    """Find the onset of oscillation with one filter after another; takes minutes."""
    try:
        cases = filters_compared(
            load_scenario(scenario),
            axis="x" if axis == "x" else "rotation",
            alpha_rad=angle,
            ratio_per_s=ray,
            friction=friction,
        )
    except DualbendError as error:
        raise click.UsageError(str(error)) from error
    click.echo(table(cases).markdown())


if __name__ == "__main__":
    main()
