"""Run folders for the tests of the report."""

from pathlib import Path

from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario


def leave(folder: Path, name: str, *settings: str, until: int | None = None) -> Path:
    """Run a scenario, stopped by the user after ``until`` cycles, and leave its files."""
    run = make_run(load_scenario(name, settings))

    def on_cycle(done: int) -> None:
        if done == until:
            raise KeyboardInterrupt

    result = run.run(on_cycle)
    with run_folder(folder) as kept:
        write_numbers(result, kept)
    return folder
