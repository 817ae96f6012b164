"""Commands around scenario files: what they may say, and files to start from."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import (
    JSON,
    MARKDOWN_TABLE,
    OUT_FILE,
    PATH,
    SETTINGS,
    command,
    deliver,
    load,
    print_json,
)
from dualbend.cli.completion import complete_materials, complete_scenarios
from dualbend.errors import InputError, brief, refusing


@command("dualbend list", name="list")
def list_command() -> None:
    """List the shipped scenarios."""
    from dualbend.scenario import shipped

    click.echo(shipped.table())


@command("dualbend new mine", "dualbend new mine --from fig8", "dualbend run mine.toml")
@click.argument("name")
@click.option(
    "--from",
    "base",
    default="fig6",
    show_default=True,
    metavar="SCENARIO",
    shell_complete=complete_scenarios,
    help="Scenario whose values the file gets.",
)
def new(name: str, base: str) -> None:
    """Write NAME.toml, a scenario with every key explained.

    Keys at their default are comments. An existing file is not overwritten.
    """
    from dualbend.scenario.template import write_scenario

    path = write_scenario(name, base)
    click.echo(f"{path}: edit it, then dualbend run {path}")


@command("dualbend schema --out scenario.schema.json")
@OUT_FILE
def schema(out: Path | None) -> None:
    """Write the JSON schema of a scenario file, for editors."""
    from dualbend.scenario.schema import schema_text

    deliver(schema_text(), out)


@command("dualbend reference --out docs/reference.md")
@OUT_FILE
def reference(out: Path | None) -> None:
    """Write every section and key of a scenario as Markdown."""
    from dualbend.scenario.reference import reference_markdown

    deliver(reference_markdown(), out)


@command(
    "dualbend arms",
    "dualbend arms --for fig6",
    "dualbend arms --check my_arm.urdf --set robot.arm.flange=tool0 --out my_arm.png",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON with all data of each arm.")
@MARKDOWN_TABLE
@click.option(
    "--for",
    "scenario",
    metavar="SCENARIO",
    shell_complete=complete_scenarios,
    help="Show where each arm would stand for this scenario, or why it cannot do the work.",
)
@click.option(
    "--check",
    "checked",
    metavar="FILE",
    help="Show what is found in an arm's file, and its step response; or a shipped arm's.",
)
@click.option("--out", type=PATH, help="With --check: picture of the arm to write, .png.")
@SETTINGS
def arms(
    as_json: bool,
    markdown: bool,
    scenario: str | None,
    checked: str | None,
    out: Path | None,
    settings: tuple[str, ...],
) -> None:
    """List the arms, or check the file of one.

    With --for, each arm is tried in a scenario: base, manipulability and joint-limit margin.
    """
    if checked is not None:
        if markdown:
            raise InputError("--check cannot be combined with --markdown")
        if scenario is None:
            _check_arm(checked, settings, out, as_json=as_json)
            return
    names = None if checked is None else [checked]
    if out is not None:
        raise InputError("--out is of --check, without --for")
    from dualbend.run import arm_list

    if scenario is None and settings:
        raise InputError("--set changes a scenario: give one with --for, or an arm with --check")
    if scenario is not None:
        load(scenario, settings)  # what is wrong with it is no arm's doing
    if scenario is not None and not as_json:
        for row in arm_list.evaluate_arms(scenario, settings, names):
            click.echo(arm_list.verdict_text(row))
        return
    if scenario is not None:
        rows = list(arm_list.evaluate_arms(scenario, settings, names))
    else:
        rows = arm_list.arm_table()
    if as_json:
        print_json(rows)
    else:
        click.echo(arm_list.table_markdown(rows) if markdown else arm_list.table_text(rows))


def _check_arm(name: str, settings: tuple[str, ...], out: Path | None, *, as_json: bool) -> None:
    """Print what is found of an arm, and draw it."""
    if out is not None:
        from dualbend.recording.pictures import offscreen

        offscreen.prepare()  # before anything imports MuJoCo
    from dualbend.validation import own_arm

    arm, down = own_arm.model_of(name, settings)
    found = own_arm.look_at(arm, down)
    if as_json:
        print_json(found)
    else:
        click.echo(own_arm.found_text(found))
    if out is not None:
        from dualbend.recording.pictures.arm import draw_arm

        draw_arm(arm, own_arm.middle_of(arm), out)
        click.echo(f"{out} written", err=as_json)


@command("dualbend materials", "dualbend materials 6061-T6", "dualbend materials --json")
@click.argument("name", required=False, shell_complete=complete_materials)
@MARKDOWN_TABLE
@OUT_FILE
@JSON
def materials(name: str | None, markdown: bool, out: Path | None, as_json: bool) -> None:
    """List the materials that a scenario can use.

    With a NAME, or a file of your own, list each number with its source and grade.
    """
    from dualbend.beam import material_table
    from dualbend.beam.material import find_material, library

    with refusing(f"NAME = {brief(name)}"):
        if name is None:
            shown = library()
        elif name.endswith(".toml"):
            from dualbend.scenario.load import read_materials

            shown = read_materials(Path(name))
        else:
            shown = {name: find_material(name)}
    if as_json:
        text = material_table.as_json(shown)
    elif markdown:
        text = material_table.markdown(shown)
    elif name is None:
        text = material_table.overview(shown)
    else:
        text = "\n".join(map(material_table.sources, shown.values()))
    deliver(text, out)
