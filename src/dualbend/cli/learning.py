"""The command that runs sheets one after another and learns from them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.cli.common import (
    EXIT_UNEXPECTED,
    FILE,
    PATH,
    SCENARIO,
    SEED,
    SETTINGS,
    command,
    exit_interrupted,
    load,
)
from dualbend.errors import InputError, refusing, writing
from dualbend.files import write_whole

if TYPE_CHECKING:
    from dualbend.run.learned import LearnedFile
    from dualbend.scenario.scenario import Scenario
    from dualbend.study.learning.series import Series
    from dualbend.study.learning.sheet import Sheet


@command(
    "dualbend learn learned --sheets 6",
    "dualbend learn learned-fast --sheets 10 --from runs/learned-sheets/learned.json",
    "dualbend learn learned --sheets 6 --seeds 10",
)
@SCENARIO
@click.option(
    "--sheets", type=click.IntRange(1, 1000), default=5, show_default=True, help="Number of sheets."
)
@click.option(
    "--from",
    "start",
    type=FILE,
    help="File of what was learned before, at whatever speed; default: path.learned.",
)
@click.option("--out", type=PATH, help="Folder of the series.")
@SETTINGS
@SEED
@click.option(
    "--seeds",
    "cells",
    type=click.IntRange(2, 1000),
    help="Cells: a series for each of so many seeds from the scenario's on, and their spread.",
)
@click.option("--record/--no-record", default=True, help="Write sheets.rrd for the rerun viewer.")
def learn(
    scenario: str,
    sheets: int,
    start: Path | None,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    cells: int | None,
    record: bool,
) -> None:
    """Bend sheets one after another and learn from them.

    Refused where the corrections would grow, by the loop's model. The same command continues a
    series that was interrupted; a larger --sheets makes it longer. What was learned is in the
    folder's learned.json: dualbend run SCENARIO --set path.learned=FILE takes it. With --seeds,
    a series for each of several cells, in folders of their own, and the spread over them.
    """
    import msgspec

    from dualbend.run.learned import read_learned
    from dualbend.study.learning.series import LEARNED
    from dualbend.study.learning.sheet import spread_table, table

    loaded = load(scenario, settings, seed)
    folder = out or Path("runs") / f"{loaded.name}-{'sheets' if cells is None else 'cells'}"
    named = start or loaded.path.learned
    if cells is not None:
        if named is not None:
            raise InputError(f"--seeds {cells}: what was learned before, {named}, is of one cell")
        each = [msgspec.structs.replace(loaded, seed=loaded.seed + i) for i in range(cells)]
        found = [_series(one, sheets, folder / f"seed-{one.seed}", None, record) for one in each]
        lines = spread_table(found)
        with writing(folder, "--out"):
            write_whole(folder / "cells.md", lines.markdown() + "\n")
        click.echo(lines.text())
        click.echo(f"results in {folder}")
        return
    before = None
    if named is not None:
        with refusing(f"--from {named}"):
            before = read_learned(Path(named))
            before.motion(loaded)
    found = [_series(loaded, sheets, folder, before, record)]
    click.echo(table(found[0]).text())
    if any(sheet.learned for sheet in found[0]):
        click.echo(f"learned: --set path.learned={folder / LEARNED}")
    click.echo(f"results in {folder}")
    if found[0][-1].outcome not in loaded.expect.outcome:
        sys.exit(EXIT_UNEXPECTED)


def _series(
    loaded: Scenario, sheets: int, folder: Path, before: LearnedFile | None, record: bool
) -> list[Sheet]:
    """Run a series into a folder, with its table, picture and recording; tell each sheet."""
    from dualbend.interrupts import uninterrupted
    from dualbend.study.learning.figure import plot_sheets
    from dualbend.study.learning.series import run_series
    from dualbend.study.learning.sheet import table

    done = 0

    def tell(series: Series, sheet: Sheet | None) -> None:
        nonlocal done
        done = series.done
        if sheet is None:
            click.echo(f"{loaded.name}, seed {loaded.seed}: {series.prediction}", err=True)
            if done < sheets and series.friction is not None:
                ratios = ", ".join(f"{ratio:.2f}" for ratio in series.friction)
                click.echo(f"friction of the joints over the believed one: {ratios}", err=True)
        else:
            click.echo(table([sheet]).text().splitlines()[-1], err=True)

    try:
        found = run_series(loaded, sheets, folder, before, tell)
    except KeyboardInterrupt:
        exit_interrupted(done, sheets, folder)
    with uninterrupted():
        with writing(folder, "--out"):
            write_whole(folder / "table.md", table(found).markdown() + "\n")
        plot_sheets(found, loaded.name, folder / "sheets.png")
        if record:
            from dualbend.study.learning.recording import record_sheets

            record_sheets(loaded, found, folder / "sheets.rrd")
    return found
