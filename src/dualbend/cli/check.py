"""Commands that compare runs with a baseline or with each other."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from dualbend.cli.common import EXIT_FAILED_CHECK, PATH, command
from dualbend.cli.completion import complete_scenarios


@command("dualbend check fig8 mine.toml --update", "dualbend check")
@click.argument("scenarios", nargs=-1, metavar="[SCENARIO ...]", shell_complete=complete_scenarios)
@click.option("--baseline", type=PATH, help="Baseline file.  [default: ./baseline.json]")
@click.option("--update", is_flag=True, help="Write the measured values into the baseline.")
@click.option("--junit", type=PATH, help="JUnit XML file to write.")
@click.option("--markdown", type=PATH, help="Markdown file to write.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default: one per core.")
@click.option("--out", type=PATH, help="Folder for the runs, a folder each.")
@click.option("--all", "everything", is_flag=True, help="Also print the values that agree.")
def check(
    scenarios: tuple[str, ...],
    baseline: Path | None,
    update: bool,
    junit: Path | None,
    markdown: Path | None,
    workers: int | None,
    out: Path | None,
    everything: bool,
) -> None:
    """Compare the metrics of runs with a baseline.

    The exit code is 1 if a metric differs by more than its tolerance, for the worse or for the
    better. Without a SCENARIO all scenarios of the baseline are run. A scenario with serve.client
    is run by that controller.
    """
    from dualbend.check import report as check_report
    from dualbend.check.check import check as compare_with_baseline
    from dualbend.check.measure import Measured

    def tell(one: Measured) -> None:
        said = f"{one.name}: {one.outcome} {one.end or ''}".rstrip()
        click.echo(f"{said}: {one.reason}" if one.reason else said, err=True)

    verdicts = compare_with_baseline(
        scenarios, baseline, update=update, workers=workers, out=out, on_done=tell
    )
    if junit is not None:
        check_report.write_junit(verdicts, junit)
    if markdown is not None:
        check_report.write_markdown(verdicts, markdown)
    if verdicts.failures or everything:
        click.echo(check_report.table(verdicts, everything=everything))
    for line in check_report.explanations(verdicts):
        click.echo(line)
    click.echo(check_report.conclusion(verdicts, updated=update))
    if verdicts.failures and not update:
        sys.exit(EXIT_FAILED_CHECK)


@command("dualbend compare runs/fig6 runs/fig8 --out runs/compared")
@click.argument("run_a", type=PATH)
@click.argument("run_b", type=PATH)
@click.option("--out", type=PATH, help="Folder for text, plot and recording.")
@click.option("--record/--no-record", default=True, help="Write compare.rrd.")
def compare(run_a: Path, run_b: Path, out: Path | None, record: bool) -> None:
    """Compare two runs.

    RUN_A and RUN_B are folders written by dualbend run. Prints the metrics and the settings that
    differ. With --out, writes compare.txt, compare.png and compare.rrd.
    """
    from dualbend.report.compare import compare_runs, report_text, write_comparison
    from dualbend.run.disk.saved import load_run

    first, second = load_run(run_a), load_run(run_b)
    found = compare_runs(first, second)
    if out is not None:
        write_comparison(first, second, found, out, record=record)
    click.echo(report_text(found))
    if out is not None:
        click.echo(f"results in {out}")
