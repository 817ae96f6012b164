"""The command that lists the arms."""

from __future__ import annotations

import click

from dualbend.cli.common import SETTINGS, complete_scenarios, examples


@click.command(epilog=examples("dualbend arms", "dualbend arms --for fig6", "dualbend arms --json"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON with all data of each arm.")
@click.option("--markdown", is_flag=True, help="Print the table of the documentation.")
@click.option(
    "--for",
    "scenario",
    metavar="SCENARIO",
    shell_complete=complete_scenarios,
    help="Show where each arm would stand for this scenario, or why it cannot do the work.",
)
@SETTINGS
def arms(as_json: bool, markdown: bool, scenario: str | None, settings: tuple[str, ...]) -> None:
    """List the arms that a scenario can use.

    With --for, each arm is tried in a scenario: base, manipulability and joint-limit margin.
    """
    from dualbend.errors import InputError
    from dualbend.run import arm_list

    if scenario is None:
        if settings:
            raise InputError("--set changes a scenario: give one with --for")
        rows = arm_list.arm_table()
        text = arm_list.table_markdown(rows) if markdown else arm_list.table_text(rows)
        _print(rows, text, as_json=as_json)
        return
    if as_json:
        _print(list(arm_list.judge_arms(scenario, settings)), "", as_json=True)
        return
    for row in arm_list.judge_arms(scenario, settings):
        click.echo(arm_list.verdict_text(row))


def _print(rows: list[dict[str, object]], text: str, *, as_json: bool) -> None:
    if as_json:
        import msgspec

        click.echo(msgspec.json.format(msgspec.json.encode(rows), indent=2).decode())
    else:
        click.echo(text)
