"""Run folders for the tests of the report."""

import shutil
from pathlib import Path
from typing import Any

import msgspec

from dualbend.run.disk.folder import NUMBERS, run_folder
from dualbend.run.disk.output import json_text, write_numbers
from dualbend.run.disk.saved import load_run
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


def copied(folder: Path, to: Path, **changed: Any) -> Path:
    """Copy a run, with other fields in its summary, as if they had been written so."""
    to.mkdir(exist_ok=True)
    for name in NUMBERS:
        shutil.copyfile(folder / name, to / name)
    if changed:
        summary = msgspec.structs.replace(load_run(folder).summary, **changed)
        (to / "summary.json").write_text(json_text(summary.to_json()), encoding="utf-8")
    return to
