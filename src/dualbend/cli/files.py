"""Commands around scenario files: list, new, schema, reference."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import complete_scenarios, deliver, examples


@click.command("list", epilog=examples("dualbend list"))
def list_command() -> None:
    """List the shipped scenarios."""
    from dualbend.scenario import shipped

    click.echo(shipped.table())


@click.command(
    epilog=examples("dualbend new mine", "dualbend new mine --from fig8", "dualbend run mine.toml")
)
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


@click.command(epilog=examples("dualbend schema --out scenario.schema.json"))
@click.option("--out", type=click.Path(path_type=Path), help="File to write; default: print.")
def schema(out: Path | None) -> None:
    """Write the JSON schema of a scenario file, for editors."""
    from dualbend.scenario.schema import schema_text

    deliver(schema_text(), out)


@click.command(epilog=examples("dualbend reference --out docs/reference.md"))
@click.option("--out", type=click.Path(path_type=Path), help="File to write; default: print.")
def reference(out: Path | None) -> None:
    """Write every section and key of a scenario as Markdown."""
    from dualbend.scenario.reference import reference_markdown

    deliver(reference_markdown(), out)
