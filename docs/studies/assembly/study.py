"""The engine's study of one part's runs, kept in a folder."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Callable, Sequence
from pathlib import Path

from assembly.case import Case, Ran, run_case
from assembly.faults import FAULT_FREE, KINDS, fault_free, faults
from assembly.parts import PARTS
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.study.ending import RAISED
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.processes import in_processes

FAULTS = "faults"
NAMES = (FAULTS, *PARTS)
FAULT_SEEDS = 10

OnRun = Callable[[int, int, Ran | None], None]


def versions() -> dict[str, str]:
    """Return the versions that the physics depends on; what only draws may be missing here."""
    packages = ("mujoco", "numpy", "scipy", "mink", "daqp")
    found = {name: importlib.metadata.version(name) for name in packages}
    return {"python": platform.python_version(), **found}


def run_cases(
    cases: Sequence[Case],
    folder: Path,
    *,
    workers: int | None = None,
    on_run: OnRun = lambda *_: None,
) -> list[Ran]:
    """Make the runs that the folder does not have yet; return all in order.

    Raises InputError where the folder is another study's or cannot be used.
    """
    study = Study(
        design=cases,
        task=lambda case: (case,),
        run_one=run_case,
        key=lambda row: row.case,
        lost=lambda case, reason: Ran(case=case, outcome=RAISED, reason=reason),
    )
    scenarios = {name: load_scenario(name).to_toml() for name in ("pwb", "pwb-misaligned")}
    kept = StudyFolder(folder=folder, row=Ran, study={"versions": versions(), **scenarios})
    return study.run(in_processes(workers), kept, on_run)


def run_part(
    name: str,
    out: Path,
    count: int | None = None,
    *,
    only: Sequence[str] = (),
    workers: int | None = None,
    on_run: OnRun = lambda *_: None,
) -> list[Ran]:
    """Make the runs of a part, ``count`` draws or seeds of each case.

    ``only``: of ``faults`` these, all where it is empty. Raises InputError for another part's.
    """
    folder = out / name
    if only and name != FAULTS:
        raise InputError(f"--only {only[0]}: is for {FAULTS} alone, {name} has none")
    if name != FAULTS:
        part = PARTS[name]
        cases = list(part.design(count or part.count))
        return run_cases(cases, folder, workers=workers, on_run=on_run)
    seeds, kinds = count or FAULT_SEEDS, only or KINDS
    first = list(fault_free(seeds, kinds))
    free = run_cases(first, folder / FAULT_FREE, workers=workers, on_run=on_run)
    return run_cases(list(faults(seeds, free, kinds)), folder, workers=workers, on_run=on_run)
