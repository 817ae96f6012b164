"""Commands around logs of other programs: what a run exports, and commands that are replayed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.cli.common import FILE, PATH, SEED, SETTINGS, command, load
from dualbend.cli.completion import complete_scenarios
from dualbend.cli.runs import carry_out
from dualbend.errors import InputError

if TYPE_CHECKING:
    from dualbend.run.loop import Run
    from dualbend.run.record import RunRecord


@command("dualbend export runs/fig8 --mcap fig8.mcap")
@click.argument("run", type=PATH)
@click.option("--mcap", type=FILE, help="MCAP file of ROS 2 messages to write.")
@click.option("--csv", type=FILE, help="CSV file of the trace to write.")
def export(run: Path, mcap: Path | None, csv: Path | None) -> None:
    """Write a run as a log that other programs read.

    RUN is a folder written by dualbend run. Poses, joint states and wrenches in MCAP open in
    Foxglove, PlotJuggler, rerun and what reads ROS 2 bags.
    """
    from dualbend.logs.export import write_csv, write_mcap
    from dualbend.run.disk.saved import load_run

    if mcap is None and csv is None:
        raise InputError("export needs --mcap FILE or --csv FILE")
    if mcap is not None and csv is not None and mcap.resolve() == csv.resolve():
        raise InputError(f"--mcap and --csv are both {csv}: give two files")
    for option, file in (("--mcap", mcap), ("--csv", csv)):
        if file is not None and file.exists() and file.resolve().parent == run.resolve():
            raise InputError(f"{option} {file}: is a file of the run; give another one")
    record = load_run(run, unfinished=True)
    if mcap is not None:
        written = write_mcap(record, mcap)
        click.echo(f"{mcap}: {written} messages, {mcap.stat().st_size / 1e6:.2f} MB")
    if csv is not None:
        write_csv(record, csv)
        click.echo(f"{csv}: {record.trace.rows} rows, {csv.stat().st_size / 1e6:.2f} MB")


@command("dualbend replay runs/served", "dualbend replay commands.csv fig8 --out runs/replayed")
@click.argument("log", type=PATH)
@click.argument("scenario", required=False, shell_complete=complete_scenarios)
@click.option("--out", type=PATH, help="Folder for the results.  [default: runs/NAME-replayed]")
@SETTINGS
@SEED
@click.option("--record/--no-record", default=True, help="Write run.rrd for the rerun viewer.")
def replay(
    log: Path,
    scenario: str | None,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    record: bool,
) -> None:
    """Run a scenario by recorded commands.

    LOG is a run's folder, or a file .csv, .parquet or .mcap with the deviation of both arms in each
    command cycle. A folder and an exported .mcap know their SCENARIO.
    """
    from dualbend.logs.commands import read_commands
    from dualbend.logs.replay import refuse_log
    from dualbend.logs.replay import replay as run_by
    from dualbend.scenario.load import resolve_scenario
    from dualbend.scenario.toml_text import parse_toml

    commands = read_commands(log)
    if scenario is not None:
        loaded = load(scenario, settings, seed)
    elif commands.scenario:
        tables = parse_toml(commands.scenario, str(log))
        loaded = resolve_scenario(tables, str(log), settings, seed)
    else:
        raise InputError(
            f"{log} does not say of which scenario it is: dualbend replay {log} SCENARIO"
        )

    def drive(ready: Run, _: Path, on_cycle: Callable[[int], None]) -> RunRecord:
        refuse_log(ready, commands)
        return run_by(ready, commands, on_cycle)

    folder = Path("runs") / f"{loaded.name}-replayed" if out is None else out
    carry_out(loaded, folder, record=record, drive=drive)
