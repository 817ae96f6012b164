"""The command that opens a cell to a controller of the user's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualbend.cli.common import PATH, SCENARIO, SEED, SETTINGS, command, load
from dualbend.cli.runs import carry_out
from dualbend.errors import writing
from dualbend.files import write_whole

if TYPE_CHECKING:
    from dualbend.run.loop import Run
    from dualbend.run.record import RunRecord

_LOOPBACK = "127.0.0.1"


@command(
    "dualbend serve fig8 --out runs/served",
    "dualbend serve fig8 --client 'python my_controller.py'",
    "dualbend serve fig8 --set serve.correction=relative --configs rsi",
    "dualbend serve fig8 --realtime",
)
@SCENARIO
@click.option("--out", type=PATH, help="Folder for the results.")
@SETTINGS
@SEED
@click.option("--record/--no-record", default=True, help="Write run.rrd for the rerun viewer.")
@click.option(
    "--address",
    default=_LOOPBACK,
    show_default=True,
    help="Where the sensors listen; another one opens them to the network.",
)
@click.option(
    "--controller",
    default=_LOOPBACK,
    show_default=True,
    help="Where the robots send to: the address of your controller.",
)
@click.option(
    "--client",
    metavar="COMMAND",
    help="Start your controller, told its ports, and end it with the run; as serve.client.",
)
@click.option(
    "--lockstep/--realtime",
    default=True,
    help="The robot waits for each answer, or goes by the clock: a late answer is late.",
)
@click.option("--configs", type=PATH, help="Folder for the RSI configuration of each arm.")
def serve(
    scenario: str,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    record: bool,
    address: str,
    controller: str,
    client: str | None,
    lockstep: bool,
    configs: Path | None,
) -> None:
    """Run a scenario by your own controller's answers.

    Arms and sensors speak the protocols of real ones; the robot waits for each answer, or with
    --realtime goes by the clock. The results are those of dualbend run.
    """

    def drive(ready: Run, folder: Path, on_cycle: Callable[[int], None]) -> RunRecord:
        from dualbend.serve.cell import ServedCell
        from dualbend.serve.client import FOLDER, OUTPUT, run_by_client

        command = ready.scenario.serve and ready.scenario.serve.client
        cell = ServedCell(ready, address, controller, own_ports=bool(command))
        if configs is not None:
            with writing(configs, "--configs"):
                configs.mkdir(parents=True, exist_ok=True)
                for name, text in cell.configurations().items():
                    write_whole(configs / name, text)
        with cell.open(realtime=not lockstep) as loop:
            for line in cell.told():
                click.echo(line)
            if not lockstep:
                click.echo("real time: the first answers start the clock, late answers are late")
            if command:
                click.echo(f"client: {command}; its output: {folder / FOLDER / OUTPUT}")
                return run_by_client(cell, loop, command, folder / FOLDER, on_cycle)
            click.echo("start your controller now: the cell waits for its first answer")
            return loop.run(on_cycle)

    if client is not None:
        from dualbend.scenario.toml_text import toml

        settings = (*settings, f"serve.client={toml(client)}")
    carry_out(load(scenario, settings, seed), out, record=record, drive=drive)
