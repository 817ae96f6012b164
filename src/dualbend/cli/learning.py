"""The command that runs sheets one after another and learns from them."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
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
        of = {folder / f"seed-{one.seed}": one for one in each}
        bent = _series(of, sheets, folder, None, record)
        lines = spread_table(bent)
        with writing(folder, "--out"):
            write_whole(folder / "cells.md", lines.markdown() + "\n")
        click.echo(lines.text())
        click.echo(f"results in {folder}")
        _exit_unless_expected(bent, loaded)
        return
    before = None
    if named is not None:
        said = f"path.learned = {named!r}" if start is None else f"--from {start}"
        before = read_learned(Path(named), said)
        with refusing(said):
            before.motion(loaded)
    (found,) = _series({folder: loaded}, sheets, folder, before, record)
    click.echo(table(found).text())
    if any(sheet.learned for sheet in found):
        click.echo(f"learned: --set path.learned={folder / LEARNED}")
    click.echo(f"results in {folder}")
    _exit_unless_expected([found], loaded)


def _exit_unless_expected(cells: Sequence[Sequence[Sheet]], scenario: Scenario) -> None:
    """Exit with its code where the last sheet of a cell ended otherwise than expected."""
    if any(bent[-1].outcome not in scenario.expect.outcome for bent in cells):
        sys.exit(EXIT_UNEXPECTED)


def _series(
    cells: Mapping[Path, Scenario],
    sheets: int,
    folder: Path,
    before: LearnedFile | None,
    record: bool,
) -> list[list[Sheet]]:
    """Run series into the folders of cells, each with table, picture and recording.

    ``folder`` has them all.
    """
    from dualbend.interrupts import uninterrupted
    from dualbend.study.learning.figure import plot_sheets
    from dualbend.study.learning.series import run_series
    from dualbend.study.learning.sheet import table

    tell = _Telling([one.seed for one in cells.values()])
    try:
        found = run_series(cells, sheets, before, tell)
    except KeyboardInterrupt:
        exit_interrupted(tell.done, sheets * len(cells), folder)
    for (own, scenario), bent in zip(cells.items(), found, strict=True):
        with uninterrupted():
            with writing(own, "--out"):
                write_whole(own / "table.md", table(bent).markdown() + "\n")
            plot_sheets(bent, scenario.name, own / "sheets.png")
            if record:
                from dualbend.study.learning.recording import record_sheets

                record_sheets(scenario, bent, own / "sheets.rrd")
    return found


class _Telling:
    """Tells each sheet as it ends, and before the first one what is known; counts the sheets."""

    def __init__(self, seeds: Sequence[int]) -> None:
        self._seeds, self._known = seeds, set[int]()
        self.done = 0

    def __call__(self, series: Series, sheet: Sheet | None) -> None:
        """Tell a sheet of a series; None: those that are done already."""
        from dualbend.study.learning.sheet import table

        name, seed, (first, *more) = series.scenario.name, series.scenario.seed, self._seeds
        if sheet is None:
            self.done += series.done
            if seed == first:
                seeds = f"seeds {first} to {more[-1]}" if more else f"seed {first}"
                click.echo(f"{name}, {seeds}: {series.prediction}", err=True)
            return
        self.done += 1
        cell = f"seed {seed}: " if more else ""
        if seed not in self._known and series.friction is not None:
            ratios = [f"{ratio:.2f}" for ratio in series.friction]
            told = " over the believed one: " + ", ".join(ratios)
            if {*ratios} == {"1.00"}:
                told = ": as it is believed"
            click.echo(f"{cell}friction of the joints{told}", err=True)
        self._known.add(seed)
        click.echo(f"{cell}{table([sheet]).text().splitlines()[-1]}", err=True)
