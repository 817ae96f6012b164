"""A Monte Carlo study: many trials in parallel processes, each kept as soon as it is done.

The folder holds ``study.json`` (what the study is), ``scenario.toml`` (resolved, before any draw)
and ``runs.jsonl`` (one trial a line, in the order in which they ended).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import TypeAlias

from dualbend.errors import InputError
from dualbend.evaluation.metrics import versions
from dualbend.scenario.scenario import Scenario
from dualbend.study.engine import RUNS, STUDY, StudyFolder, in_processes
from dualbend.study.robustness.trial import Trial, assembly_of, run_one

__all__ = ["RUNS", "SCENARIO", "STUDY", "cases", "run_study"]

SCENARIO = "scenario.toml"

RunTrial: TypeAlias = Callable[[Scenario, int, int, bool], Trial]


def run_study(
    scenario: Scenario,
    folder: Path,
    *,
    runs: int,
    seed: int = 1,
    workers: int = 2,
    run: RunTrial = run_one,
    on_trial: Callable[[int, int], None] | None = None,
) -> list[Trial]:
    """Run what the folder does not have yet; return the trials of the first ``runs`` draws.

    They are ordered by draw, with compliance first, and do not depend on ``workers``. A scenario
    without compliance has only the trials without. ``run`` must be importable in another process;
    ``on_trial`` is told the number of trials that are done and that there will be, at the start
    and after each.

    Raises
    ------
    InputError
        The scenario has no assembly, or the folder is another study's or cannot be used.
    DualbendError
        A worker process died.
    KeyboardInterrupt
        Interrupted; the trials that were done are in the folder, and the same call goes on.
    """
    if runs < 1 or workers < 1:
        raise InputError(f"runs = {runs}, workers = {workers}: both must be at least 1")
    wanted = [(index, case) for index in range(runs) for case in cases(scenario)]
    text = scenario.to_toml()
    study = {"seed": seed, "versions": versions(), "scenario": text}
    folder_of = StudyFolder(folder, Trial, "trial", _key)
    with folder_of.opened(study, {SCENARIO: text}) as (done, keep):
        left = [(scenario, seed, *task) for task in wanted if task not in done]
        count = len(wanted) - len(left)
        if on_trial is not None:
            on_trial(count, len(wanted))
        # Closed also where an interrupt comes between two trials.
        with closing(in_processes(left, run, workers, ProcessPoolExecutor)) as trials:
            for trial in trials:
                keep(trial)
                done[_key(trial)] = trial
                count += 1
                if on_trial is not None:
                    on_trial(count, len(wanted))
        return [done[task] for task in wanted]


def _key(trial: Trial) -> tuple[int, bool]:
    return trial.index, trial.compliance


def cases(scenario: Scenario) -> tuple[bool, ...]:
    """Return the cases of each draw: with compliance, if the scenario has one, and without."""
    return (False,) if assembly_of(scenario).compliance is None else (True, False)
