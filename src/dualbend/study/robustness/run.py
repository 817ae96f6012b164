"""A Monte Carlo study: each draw with compliance and without, kept as soon as it is done.

The folder holds what :mod:`dualbend.study.folder` keeps and ``scenario.toml`` (resolved, before any
draw).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeAlias

from dualbend.errors import refuse_below_one
from dualbend.evaluation.metrics import versions
from dualbend.scenario.scenario import Scenario
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.processes import in_processes
from dualbend.study.robustness.trial import Trial, cases, refuse_strangers, run_one

SCENARIO = "scenario.toml"

RunTrial: TypeAlias = Callable[[Scenario, int, int, bool], Trial]


def run_study(
    scenario: Scenario,
    folder: Path,
    *,
    runs: int,
    seed: int = 1,
    workers: int | None = None,
    run: RunTrial = run_one,
    on_run: Callable[[int, int, Trial | None], None] = lambda *_: None,
) -> list[Trial]:
    """Run what the folder does not have yet; return the trials of the first ``runs`` draws.

    They are ordered by draw, with compliance first, and do not depend on ``workers``. A scenario
    without compliance has only the trials without. ``run`` must be importable in another process;
    ``on_run`` as :meth:`dualbend.study.engine.Study.run` has it.

    Raises InputError where the scenario has no assembly, or the folder is another study's or cannot
    be used; DualbendError where a worker process died; KeyboardInterrupt where it is interrupted:
    the trials that were done are in the folder, and the same call goes on.
    """
    refuse_below_one(runs=runs)
    study = Study(
        design=[(index, case) for index in range(runs) for case in cases(scenario)],
        task=lambda key: (scenario, seed, *key),
        run_one=run,
        key=lambda trial: (trial.index, trial.compliance),
    )
    text = scenario.to_toml()
    kept = StudyFolder(
        folder=folder,
        row=Trial,
        study={"seed": seed, "versions": versions(), "scenario": text},
        files={SCENARIO: text},
        check=partial(refuse_strangers, scenario, seed),
    )
    return study.run(in_processes(workers), kept, on_run)
