"""Commands that make pages and pictures of runs: report, figures."""

from __future__ import annotations

from pathlib import Path

import click

from dualbend.cli.common import FILE, FOLDER, PATH, SETTINGS, command


@command("dualbend report runs/fig8", "dualbend report runs/fig6 runs/fig8 --out both.html")
@click.argument("runs", nargs=-1, required=True, metavar="DIR [DIR ...]", type=PATH)
@click.option(
    "--out",
    type=FILE,
    help="HTML file.  [default: report.html in the folder of one run, else here]",
)
def report(runs: tuple[Path, ...], out: Path | None) -> None:
    """Write one HTML page about one or several runs.

    DIR is a folder written by dualbend run. Several runs are shown side by side, those of like size
    on one scale. The page opens without a network.
    """
    from dualbend.report.page import write_report
    from dualbend.run.disk.folder import later_log

    if out is None:
        out = runs[0] / "report.html" if len(runs) == 1 else Path("report.html")
    write_report(runs, out)
    for folder in runs:
        if (later := later_log(folder)) is not None:
            click.echo(
                f"{folder}: a later run did not end; dualbend report {later} shows it", err=True
            )
    click.echo(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


@command("dualbend figures --out figures")
@click.option(
    "--out",
    type=FOLDER,
    default=Path("figures"),
    show_default=True,
    help="Folder for runs, pictures and page.",
)
@SETTINGS
def figures(out: Path, settings: tuple[str, ...]) -> None:
    """Run the paper's three experiments and draw their figures.

    Runs fig6, fig8 and fig9 and writes Figs. 6, 8 and 9, each alone and all side by side, as PNG
    and SVG, and the report of the three runs.
    """
    from dualbend.report.page import PAPER_FIGURES
    from dualbend.study.paper_figures import make_figures

    runs = make_figures(
        out, settings, lambda run: click.echo(f"{run.scenario.name} done", err=True)
    )
    click.echo("figure   scenario  largest  by piece of the path, true moment [mN m]")
    for run in runs:
        metrics = run.summary.metrics
        peak, pieces = (_millis(metrics[n].value) for n in ("peak_moment", "peak_moment_by_piece"))
        name, outcome = run.scenario.name, run.summary.outcome
        click.echo(f"{PAPER_FIGURES[name]:<8} {name:<8}  {peak} {pieces}  {outcome}")
    click.echo(f"pictures and report.html in {out}")


def _millis(value: float | list[float | None] | None) -> str:
    """Return values in thousandths of their unit."""
    if isinstance(value, list):
        return " ".join(_millis(item) for item in value)
    return f"{'-':>7}" if value is None else f"{1e3 * value:7.1f}"
