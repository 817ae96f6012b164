"""The command of the audit: ``python docs/studies/icra1995`` prints the page, or writes it."""

from __future__ import annotations

import sys
from pathlib import Path

import click
import msgspec

sys.path.insert(0, str(Path(__file__).parents[1]))

from icra1995.audit import audit, page, run_scan
from icra1995.reading import readings


@click.command()
@click.option("--scan", is_flag=True, help="Compute the table of readings first; ten minutes.")
@click.option("--out", type=click.Path(path_type=Path), help="Markdown file to write.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def main(scan: bool, out: Path | None, as_json: bool) -> None:
    """Check the paper's equations and numbers."""
    if scan:
        with click.progressbar(
            length=sum(1 for _ in readings()), label="readings", file=sys.stderr
        ) as bar:
            run_scan(on_row=lambda _: bar.update(1))
    found = audit()
    if out is not None:
        out.write_text(page(found), encoding="utf-8")
        click.echo(f"{len(found.findings())} statements in {out}")
    elif as_json:
        click.echo(msgspec.json.format(msgspec.json.encode(found), indent=2).decode())
    else:
        click.echo(page(found), nl=False)


if __name__ == "__main__":
    main()
