"""Commands that compute theory, or compare the simulation with it."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dualbend.cli.common import EXIT_FAILED_CHECK, JSON, NUMBER, PATH, Number, command, print_json
from dualbend.cli.completion import complete_settings
from dualbend.errors import InputError, writing
from dualbend.files import write_whole

if TYPE_CHECKING:
    from dualbend.validation.table import Row


_number = partial(click.option, type=NUMBER)


@command(
    "dualbend beam --length 0.6 --width 0.1 --thickness 0.001 --young 69e9 --alpha 0.2",
    "dualbend beam --length 0.6 --width 0.1 --thickness 0.001 --material 6061-T6 --alpha 1",
)
@_number("--length", "length_m", required=True, help="Free length L [m].")
@_number("--width", "width_m", required=True, help="Width w [m].")
@_number("--thickness", "thickness_m", required=True, help="Thickness t [m].")
@_number("--young", "young_pa", help="Young's modulus E [Pa]; default: the material's.")
@click.option("--material", help="From dualbend materials: E, ν, weight and strain limit.")
@click.option(
    "--rigidity",
    type=click.Choice(["beam", "plate", "width"]),
    default="beam",
    show_default=True,
    help="Bending stiffness: EI, EI / (1 - ν²), or between them for the width.",
)
@_number("--poisson", "poisson_ratio", help="Poisson's ratio ν; default: the material's, or 0.3.")
@_number("--alpha", "alpha_rad", required=True, help="End slope α [rad].")
@_number(
    "--half-distance",
    "half_distance_m",
    help="Half distance of the grips [m]; default: no end moment.",
)
@click.option(
    "--weight",
    "weight_n_per_m",
    type=Number(0.0, 1e4),
    help="Weight q [N/m]; default: the material's, or 0.",
)
@JSON
def beam(*, as_json: bool, **given: Any) -> None:  # noqa: ANN401 - as the options say
    """Compute force, moment and shape of a bent sheet.

    Also prints the force with the other kinds of bending stiffness and, with a material, the
    surface strain and its limit.
    """
    from dualbend.beam.calculator import bent_sheet

    _refuse_no_sheet(given)
    state = bent_sheet(**given)
    if as_json:
        import json

        click.echo(json.dumps(state))
        return
    for key, value in state.items():
        shown = f"{value:>14.6g}" if isinstance(value, float) else f"{value!s:>14}"
        click.echo(f"{key:<30}{shown}")


def _refuse_no_sheet(given: dict[str, Any]) -> None:
    """Refuse what the section [sheet] of a scenario refuses."""
    from dualbend.scenario.explain import converted
    from dualbend.scenario.sheet import SheetConfig
    from dualbend.scenario.structs import fields_of

    sheet = {key: given[key] for key in fields_of(SheetConfig) if given.get(key) is not None}
    if "material" not in sheet:
        # What a state does not depend on.
        sheet = {"young_pa": 1e9, "poisson_ratio": 0.3, "density_kg_per_m3": 1e3, **sheet}
    converted(sheet, SheetConfig, "beam")


@command("dualbend validate --markdown validation.md", "dualbend validate --arm ur5")
@JSON
@click.option("--markdown", type=PATH, help="Markdown file to write.")
@click.option("--arm", metavar="NAME", help="Measure one arm instead: its name or its file.")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PATH.TO.KEY=VALUE",
    shell_complete=complete_settings,
    help="With --arm: what its file does not say, robot.arm.flange=tool0 for example.",
)
@click.option("--shell", is_flag=True, help="The shell against plate theory instead; a minute.")
def validate(
    as_json: bool,
    markdown: Path | None,
    arm: str | None,
    settings: tuple[str, ...],
    shell: bool,
) -> None:
    """Measure the difference between simulation and theory.

    Takes one or two minutes. The exit code is 1 if a row fails.
    """
    from dualbend.validation.table import run_arm_validation, run_validation

    if arm is not None and shell:
        raise InputError("--arm and --shell cannot be combined: give one of them")
    if settings and arm is None:
        raise InputError("--set is of an arm: give one with --arm")
    if markdown is not None:
        with writing(markdown, "--markdown"), markdown.open("ab"):
            pass  # before two minutes are spent
    on_row = None if as_json else _show_row
    if arm is not None:
        rows = run_arm_validation(arm, on_row, settings)
    else:
        rows = run_validation(on_row, shell=shell)
    if as_json:
        print_json(rows)
    if markdown is not None:
        from dualbend.evaluation.metrics import versions
        from dualbend.validation.page import validation_page

        with writing(markdown, "--markdown"):
            write_whole(markdown, validation_page(rows, versions()))
    failed = [row for row in rows if not row.passed]
    if not as_json:
        click.echo(f"{len(rows) - len(failed)} of {len(rows)} rows pass")
    if failed:
        sys.exit(EXIT_FAILED_CHECK)


def _show_row(row: Row) -> None:
    verdict = "pass" if row.passed else "FAIL"
    allowed = f"error {row.error:.2g} of {row.tolerance:.2g}" if row.tolerance else ""
    click.echo(
        f"{verdict}  {row.checks:<9}  {row.name:<70}{row.measured:>12.5g}{row.reference:>12.5g} "
        f"{row.unit:<8} {allowed}".rstrip()
    )
