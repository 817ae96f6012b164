"""Commands that make pages and pictures that people read: report, figures."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import examples


@click.command(
    epilog=examples(
        "dualbend report runs/fig8", "dualbend report runs/fig6 runs/fig8 --out both.html"
    )
)
@click.argument(
    "runs", nargs=-1, required=True, metavar="DIR [DIR ...]", type=click.Path(path_type=Path)
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="HTML file.  [default: report.html in the folder of one run, else here]",
)
def report(runs: tuple[Path, ...], out: Path | None) -> None:
    """Make one HTML page of runs, to open offline.

    DIR is a folder that dualbend run left. Several are put side by side on one scale.
    """
    from dualbend.analysis.report import write_report

    if out is None:
        out = runs[0] / "report.html" if len(runs) == 1 else Path("report.html")
    write_report(runs, out)
    click.echo(f"{out}: {out.stat().st_size / 1e6:.1f} MB")
