"""The material library."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import deliver, examples


@click.command(
    epilog=examples("dualbend materials", "dualbend materials 6061-T6", "dualbend materials --json")
)
@click.argument("name", required=False)
@click.option("--markdown", is_flag=True, help="Print the table of the documentation.")
@click.option("--out", type=click.Path(path_type=Path), help="File to write; default: print.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def materials(name: str | None, markdown: bool, out: Path | None, as_json: bool) -> None:
    """List the materials that a scenario can use.

    With a NAME, list each number of that material with its source and grade.
    """
    from dualbend.beam import material_table
    from dualbend.beam.material import find_material, library
    from dualbend.errors import InputError

    try:
        shown = library() if name is None else {name: find_material(name)}
    except InputError as error:
        raise InputError(f"NAME = {name!r}: {error}") from error
    if as_json:
        text = material_table.as_json(shown)
    elif markdown:
        text = material_table.markdown(shown)
    elif name is None:
        text = material_table.overview(shown)
    else:
        text = material_table.sources(shown[name])
    deliver(text, out)
