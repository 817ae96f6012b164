"""Run folders for the tests of the report."""

from pathlib import Path

from dualbend.run import output
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario


def leave(folder: Path, name: str, *settings: str, until: int | None = None) -> Path:
    """Run a scenario, stopped by the user after ``until`` cycles, and leave its files."""
    run = make_run(load_scenario(name, settings))

    def on_cycle(done: int) -> None:
        if done == until:
            raise KeyboardInterrupt

    result = run.run(on_cycle)
    folder.mkdir(parents=True)
    output.write_scenario(result, folder / "scenario.toml")
    output.write_trace(result, folder / "trace.parquet")
    output.write_summary(result, folder / "summary.json")
    return folder
