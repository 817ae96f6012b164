"""Sheets one after another, each corrected by what the ones before it taught.

A learned sheet is one of the same kind that ran to its end. What repeats from sheet to sheet is the
cell, drawn from the scenario's seed; noise, walks of the sensors' zeros and lost commands are each
sheet's own (the scenario's ``repeat``). Where the servos learn the joints' friction, the arms go
the path of the first sheet without one before it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from dualbend.batch.many import BATCH, run_many
from dualbend.control.learning import LearningConfig, replayed
from dualbend.errors import InputError, refusing, writing
from dualbend.evaluation.metrics import held_rows, versions
from dualbend.files import write_whole
from dualbend.resources import usable_cores
from dualbend.run.learned import LearnedFile, belongings
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.motion import NominalMotion, nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.stability.learning import LearningPrediction, learning_of, predict_learning
from dualbend.study.ending import record_of, result_of
from dualbend.study.folder import RUNS, StudyFolder
from dualbend.study.learning.sheet import Sheet, sheet_of
from dualbend.task.bending.rehearsal import Rehearsal
from dualbend.types import SIDES, Vector

LEARNED = "learned.json"


class Series:
    """Sheets of a scenario one after another: :meth:`next_sheet` runs one and learns from it.

    ``start``: what was learned before, at whatever speed; ``done``: number of sheets so far;
    ``prediction``: of this scenario with any seed, None: to be made.
    Raises InputError where the corrections would grow, by the loop's model, or what was learned
    before belongs to something else.
    """

    def __init__(
        self,
        scenario: Scenario,
        start: LearnedFile | None = None,
        prediction: LearningPrediction | None = None,
    ) -> None:
        self.scenario = scenario
        self.config: LearningConfig = learning_of(scenario)
        if self.config.speeds_rad_per_s and scenario.motion.return_rad is not None:
            raise InputError(
                "learning.speeds_rad_per_s: what was learned at one speed is taken to another by "
                "the bending angle, which must grow: motion.return_rad must be none"
            )
        self.prediction = prediction or predict_learning(scenario)
        self.prediction.refuse_divergence()
        self._arms = [i for i, s in enumerate(SIDES) if s in scenario.compliance.sensing]
        self._start = start
        self._before, self._forces = 0, list[float]()
        self._motion = self._motion_of(1)
        self._correction = np.zeros((len(self._arms), self._motion.cycles))
        if start is not None:
            self._before, self._forces = start.sheets, [start.force_n] * start.sheets
            self._motion = self._motion_of(1)
            self._correction = start.correction[self._arms]
            self._take(start.motion(scenario), self._motion)
        self.done = 0

    def resume(self, sheets: Sequence[Sheet]) -> None:
        """Go on after sheets that were bent before; InputError where they are no series of it."""
        for sheet in sheets:
            self._motion = self._motion_of(sheet.sheet)
            arms, cycles, number = len(self._arms), self._motion.cycles, self.done + 1
            lengths = [len(values) for values in sheet.correction_rad]
            if sheet.sheet != number or lengths != [cycles] * arms:
                raise InputError(
                    f"sheet {sheet.sheet}: must be sheet {number}, with {cycles} values of "
                    f"correction_rad for each of {arms} arms"
                )
            self._correction = np.array(sheet.correction_rad)
            self._note(sheet)

    def scenario_of(self, number: int) -> Scenario:
        """Return the scenario of a sheet, counted from 1: its speed and its own noise."""
        speeds, motion = self.config.speeds_rad_per_s, self.scenario.motion
        if number <= len(speeds):
            motion = msgspec.structs.replace(motion, speed_rad_per_s=speeds[number - 1])
        return msgspec.structs.replace(self.scenario, motion=motion, repeat=self._before + number)

    @property
    def correction(self) -> Vector:
        """The correction (2, cycles) [rad] of the next sheet; without a sensor as the other arm."""
        return np.array(np.broadcast_to(self._correction, (len(SIDES), self._motion.cycles)))

    @cached_property
    def friction(self) -> Vector | None:
        """True over believed friction of all joints (n,), as this cell's start or a motion tells.

        None where the servos do not learn it. Another cell, of another seed, has another friction.
        InputError where the motion does not go to its end.
        """
        run = self.rehearsal()
        if run is not None:
            return run.told(run.run())
        learns = self.scenario.robot.servo.friction_estimate is not None
        return self._start.friction if learns and self._start is not None else None

    def rehearsal(self) -> Rehearsal | None:
        """Return the motion that tells the friction; None where nothing has to tell it."""
        start = self._start
        known = start is not None and start.seed == self.scenario.seed
        if self.scenario.robot.servo.friction_estimate is None:
            return None
        if known and start is not None and start.friction is not None:
            return None
        return Rehearsal(self.scenario_of(1))

    @property
    def sheets(self) -> int:
        """Sheets that taught something, those of the start included."""
        return len(self._forces)

    def learned(self) -> LearnedFile:
        """Return what was learned, for runs at the last sheet's speed."""
        at = self.scenario_of(max(self.done, 1))
        return LearnedFile(
            scenario=at.name,
            seed=at.seed,
            sheets=self.sheets,
            force_n=float(np.mean(self._forces)),
            period_s=at.period_s,
            belongs_to=belongings(at),
            correction_rad=dict(zip(SIDES, self.correction.tolist(), strict=True)),
            friction_ratio=None if self.friction is None else self.friction.tolist(),
        )

    def next_sheet(
        self, vary: Callable[[Scenario], Scenario] = lambda scenario: scenario
    ) -> tuple[Sheet, RunRecord]:
        """Run the next sheet and learn from it; ``vary`` says what is different about it."""
        result = result_of(self.next_run(vary))
        return self.learn(result), result

    def next_run(self, vary: Callable[[Scenario], Scenario] = lambda scenario: scenario) -> Run:
        """Return the run of the next sheet, made ready."""
        motion = self._motion_of(self.done + 1)
        self._take(self._motion, motion)
        self._motion = motion
        parts: dict[str, Any] = {"correction": self.correction}
        if self.friction is not None:
            parts["friction"] = self.friction
        return make_run(vary(self.scenario_of(self.done + 1)), **parts)

    def learn(self, result: RunRecord) -> Sheet:
        """Learn from what became of the run of the next sheet."""
        force = self._force(result)
        note = self._why_not(result, force)
        if not note:
            moment, turned = (
                np.array([result[f"{SIDES[i]}_{name}"] for i in self._arms])
                for name in ("filtered_moment_y", "deviation_alpha")
            )
            own = turned - self._correction
            self._correction = self.prediction.law.update(
                self._correction, moment, own, sheets=self.sheets + 1
            )
        sheet = sheet_of(self.done + 1, result, note, force, self._correction)
        self._note(sheet)
        return sheet

    def _note(self, sheet: Sheet) -> None:
        self.done = sheet.sheet
        if sheet.learned and sheet.force_n is not None:
            self._forces.append(sheet.force_n)

    def _why_not(self, result: RunRecord, force_n: float | None) -> str:
        """Return why a sheet teaches nothing; "" where it does."""
        if result.outcome != "completed" or force_n is None:
            return f"{result.outcome.replace('_', ' ')}: {result.reason}"
        usual = float(np.mean(self._forces)) if self._forces else force_n
        change = force_n / usual - 1.0 if usual else 0.0
        if abs(change) > self.config.changed:
            return f"another sheet: its force is {100 * change:+.0f} % of the learned ones'"
        return ""

    def _force(self, result: RunRecord) -> float | None:
        """Return the mean force along x in the hold, as the sensors read it [N]."""
        rows = held_rows(result)
        values = [result[f"{SIDES[i]}_filtered_force_x"][rows] for i in self._arms]
        mean = float(np.mean(values)) if rows.any() else np.nan
        return mean if np.isfinite(mean) else None

    def _motion_of(self, number: int) -> NominalMotion:
        scenario = self.scenario_of(number)
        return nominal_motion(
            scenario.path, scenario.motion, scenario.sheet.length_m, scenario.period_s
        )

    def _take(self, learned: NominalMotion, asked: NominalMotion) -> None:
        """Take the correction from one motion to another."""
        if np.array_equal(learned.alpha_rad, asked.alpha_rad):
            return
        lag = self.scenario.robot.longest_delay
        self._correction = replayed(
            self._correction, learned.alpha_rad, asked.alpha_rad, lag_cycles=lag
        )


OnSheet = Callable[[Series, Sheet | None], None]


@dataclass(frozen=True, kw_only=True)
class _Kept:
    """A series whose ``sheets`` are in a folder; ``keep`` adds one."""

    series: Series
    folder: Path
    sheets: list[Sheet]
    keep: Callable[[Sheet], None]

    def bent(self, record: RunRecord | Exception) -> Sheet:
        """Learn from the run of the next sheet and keep what it came to."""
        sheet = self.series.learn(record_of(record))
        # First: killed between both, the sheet is bent again, to the same bits.
        if self.series.sheets:
            with writing(self.folder / LEARNED, "--out"):
                write_whole(self.folder / LEARNED, self.series.learned().to_json())
        self.keep(sheet)
        self.sheets.append(sheet)
        return sheet


def run_series(
    cells: Mapping[Path, Scenario],
    sheets: int,
    start: LearnedFile | None = None,
    on_sheet: OnSheet = lambda *_: None,
) -> list[list[Sheet]]:
    """Bend sheets of cells, which differ in their seed, up to a number of them; return all.

    Each is kept in the folder of its cell as it ends, what was learned in ``learned.json`` there.
    The same sheet of all cells is a batch, each with the numbers that it has alone. A sheet that
    does not run to its end ends its cell's series; the same call then goes on with the next one.
    ``on_sheet`` is called for each cell before its first sheet, with None, and after each.

    Raises KeyboardInterrupt where it is interrupted: the sheets that ended are kept. InputError
    where a folder is another study's or cannot be used, or as :class:`Series`.
    """
    found, folders = list[list[Sheet]](), list(cells)
    for first in range(0, len(folders), BATCH):
        some = {folder: cells[folder] for folder in folders[first : first + BATCH]}
        found += _run_together(some, sheets, start, on_sheet)
    return found


def _run_together(
    cells: Mapping[Path, Scenario], sheets: int, start: LearnedFile | None, on_sheet: OnSheet
) -> list[list[Sheet]]:
    many: list[Series] = []
    for scenario in cells.values():
        many.append(Series(scenario, start, many[0].prediction if many else None))
    with ExitStack() as opened:
        kept = [
            opened.enter_context(_opened(series, folder, start))
            for series, folder in zip(many, cells, strict=True)
        ]
        for each in kept:
            on_sheet(each.series, None)
        left = [each for each in kept if len(each.sheets) < sheets]
        _rehearse([each.series for each in left])
        while left:
            runs = (each.series.next_run() for each in left)
            for i, record in run_many(runs, threads=usable_cores()):
                on_sheet(left[i].series, left[i].bent(record))
            left = [
                each
                for each in left
                if each.sheets[-1].outcome == "completed" and len(each.sheets) < sheets
            ]
    return [each.sheets for each in kept]


@contextmanager
def _opened(series: Series, folder: Path, start: LearnedFile | None) -> Iterator[_Kept]:
    """Make the folder of a series or go on with it."""
    told = "" if start is None else hashlib.sha256(start.to_json().encode()).hexdigest()
    about = {"versions": versions(), "scenario": series.scenario.to_toml(), "from": told}
    with StudyFolder(folder=folder, row=Sheet, study=about).opened(lambda row: row.sheet) as found:
        rows, keep = found
        done = sorted(rows.values(), key=lambda row: row.sheet)
        with refusing(f"--out {folder / RUNS}"):
            series.resume(done)
        yield _Kept(series=series, folder=folder, sheets=done, keep=keep)


def _rehearse(many: Sequence[Series]) -> None:
    """Let cells tell the friction of their joints, all at once."""
    runs = {i: run for i, series in enumerate(many) if (run := series.rehearsal()) is not None}
    cells = list(runs)
    for i, record in run_many(runs.values(), threads=usable_cores()):
        series = many[cells[i]]
        with refusing(f"seed {series.scenario.seed}"):
            series.friction = runs[cells[i]].told(record_of(record))
