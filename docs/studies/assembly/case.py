"""One run of the study, how it ended, and whether anything was broken."""

from __future__ import annotations

import shlex
from typing import Any

import msgspec

from dualbend.evaluation.metrics import peak
from dualbend.run.make import make_run
from dualbend.run.record import STOPPED, RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.study.ending import REFUSED, Ended, outcome_of, result_of
from dualbend.study.robustness.trial import cause_of
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.metrics import peaks, phase_table, seated, wrong_checks
from dualbend.task.assembly.run import AssemblyRun


class Case(msgspec.Struct, frozen=True):
    """What a run is of; cases of one ``name`` are counted together."""

    name: str
    seed: int
    settings: tuple[str, ...] = ()
    scenario: str = "pwb"

    @property
    def command(self) -> str:
        """The command that repeats the run."""
        words = ["dualbend", "run", self.scenario, "--seed", str(self.seed)]
        for setting in self.settings:
            words += ["--set", setting]
        return shlex.join(words)


class Ran(msgspec.Struct, frozen=True, kw_only=True):
    """How the run of a case ended.

    ``phase`` in which it ended; ``phases``: the longest time spent in each [s], from and to.
    Forces and strain over their limits, the time after a stop included; None of a run that was not
    made. ``false_seated``: sheets that were let go and are not seated; ``false_unseated``: the
    check of the seats stopped the task though the sheet is on its pins.
    """

    case: Case
    outcome: Ended
    reason: str = ""
    phase: str = ""
    phases: dict[str, tuple[float, float]] = {}
    holes_seated: int = 0
    false_seated: int = 0
    false_unseated: int = 0
    pin_force_n: float | None = None
    pin_force_over_limit: float | None = None
    edge_force_over_limit: float | None = None
    strain_over_yield: float | None = None
    simulated_s: float | None = None
    retries: int = 0

    @property
    def broken(self) -> bool:
        """Whether a force or the strain was above its limit."""
        over = (self.pin_force_over_limit, self.edge_force_over_limit, self.strain_over_yield)
        return any(value is not None and value > 1.0 for value in over)

    @property
    def safe(self) -> bool:
        """Whether it was laid, or stopped or refused with a reason, and nothing was broken."""
        return not self.broken and (self.outcome == "completed" or self.stopped)

    @property
    def stopped(self) -> bool:
        """Whether it ended otherwise than as wanted, but said why; no error of the program."""
        return self.outcome in (REFUSED, "aborted", "protective_stop", "failed") and bool(
            self.reason
        )

    @property
    def ended(self) -> str:
        """The outcome, with phase and kind of the reason."""
        if self.outcome == "completed":
            return self.outcome
        return f"{self.outcome}{f' in {self.phase}' if self.phase else ''}: {cause_of(self.reason)}"


def run_case(case: Case) -> Ran:
    """Make the run of a case; one that is refused or raises is an answer as well."""
    try:
        run = make_run(load_scenario(case.scenario, case.settings, case.seed))
        assert isinstance(run, AssemblyRun)
        result = result_of(run)
    except Exception as error:  # one bad run must not end the study
        outcome, reason = outcome_of(error)
        return Ran(case=case, outcome=outcome, reason=reason)
    # After a stop the pins are not recorded any more, but still felt.
    after = run.pins.peaks()
    return ran(case, result, (float(after.force_n.max()), float(after.edge_force_n.max())))


def ran(case: Case, result: RunRecord, after: tuple[float, float] = (0.0, 0.0)) -> Ran:
    """Return how a run ended; ``after``: pin and edge force after its last row [N]."""
    limits, table = assembly_of(result.scenario).limits, phase_table(result)
    there = seated(result)
    let_go_wrong = int((~there[: len(result.laid)].all(axis=1)).sum())
    largest = peaks(result)
    pin, edge = (
        max(peak(largest[name]) or 0.0, more)
        for name, more in zip(("peak_pin_force", "peak_edge_force"), after, strict=True)
    )
    return Ran(
        case=case,
        outcome=result.outcome,
        reason=result.reason,
        phase=next((row["phase"] for row in reversed(table) if row["phase"] != STOPPED), ""),
        phases=_longest(table),
        holes_seated=int(there.sum()),
        false_seated=let_go_wrong,
        false_unseated=wrong_checks(result) - let_go_wrong,
        pin_force_n=pin,
        pin_force_over_limit=pin / limits.pin_force_n,
        edge_force_over_limit=edge / limits.edge_force_n,
        strain_over_yield=(peak(largest["peak_surface_strain"]) or 0.0) / _limit_strain(result),
        simulated_s=result.simulated_s,
        retries=sum(row["attempt"] > 0 for row in table if "lower" in row["phase"]),
    )


def _longest(table: list[dict[str, Any]]) -> dict[str, tuple[float, float]]:
    """Return from when to when [s] each phase lasted, of a repeated one the longest time."""
    found: dict[str, tuple[float, float]] = {}
    for row in sorted(table, key=lambda row: float(row["time_s"])):
        found[row["phase"]] = row["start_s"], row["start_s"] + row["time_s"]
    return found


def _limit_strain(result: RunRecord) -> float:
    """Return at what strain the true sheet yields: at the stress of the believed one."""
    scenario = result.scenario
    assert scenario.limit_strain is not None  # an assembly has one
    return scenario.limit_strain * scenario.sheet.sheet().young_pa / scenario.true_sheet.young_pa
