"""One trial of a Monte Carlo study: a drawn assembly's run, and how it ended.

Every draw is run with the compliance that the scenario gives and without any.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np

from dualbend.errors import InputError
from dualbend.evaluation.metrics import surface_strain
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord, task_of
from dualbend.run.trace import Trace
from dualbend.scenario.scenario import Scenario
from dualbend.study.ending import Ended, outcome_of, result_of
from dualbend.task.assembly.config import ErrorsConfig, assembly_of
from dualbend.task.assembly.draws import draw, misalignment, without_compliance
from dualbend.task.assembly.metrics import pin_table, seated
from dualbend.types import Vector

CAUSES = (
    (": not seated:", "holes not seated"),
    ("not all on their pins", "pins do not hold the sheet"),
    ("which no metal does", "sheet in a pin"),
    ("the middle holes did not find", "middle holes not found"),
    ("the outer holes did not find", "outer holes not found"),
    ("hole edge is", "force on a hole's edge"),
    ("pin is", "force on a pin"),
    ("surface strain", "sheet yields"),
    ("nothing is between", "sheet not gripped"),
    ("the jaws have not", "jaws not at rest"),
    ("the arms carry", "weight not as expected"),
    ("is bent by itself", "sheet not flat"),
    ("the grips are not where", "grips not where sent"),
    ("arm stops", "an arm stopped"),
    ("nothing new", "sensor lost"),
    ("the end of its range", "sensor at the end of its range"),
    ("has dropped", "sheet dropped"),
    (" touches ", "contact that is not intended"),
    ("following error", "following error"),
    ("torque limit", "torque limit"),
    ("range's end", "end of a joint's range"),
    ("speed of", "joint speed"),
    ("commanded", "out of reach"),
    ("not done after", "took too long"),
    ("MuJoCo warning", "physics diverged"),
)
"""What the reason of a run that ended early says, and the class that it belongs to; first match."""

OTHER = "other"
BEFORE = "before the run"

_Size = Annotated[float, msgspec.Meta(ge=0)]


class Trial(msgspec.Struct, frozen=True, kw_only=True):
    """One run: what was drawn and what became of it.

    ``seed`` of the sensors' noise, the same with and without compliance. ``success``: all holes of
    all sheets are seated. ``phase`` and ``cause`` of a failure, else empty. ``misalignment_m`` as
    ``misalignment`` of :mod:`dualbend.task.assembly.draws` has it. None where the run was refused
    or raised.
    """

    index: Annotated[int, msgspec.Meta(ge=0)]
    compliance: bool
    seed: int
    success: bool
    outcome: Ended
    reason: str = ""
    phase: str = ""
    cause: str = ""
    holes_seated: Annotated[int, msgspec.Meta(ge=0)] = 0
    peak_pin_force_n: _Size | None = None
    peak_surface_strain: _Size | None = None
    simulated_s: _Size | None = None
    misalignment_m: float
    errors: ErrorsConfig
    hole_errors_m: tuple[tuple[float, float], ...]
    coulomb_ratio: _Size


def cases(scenario: Scenario) -> tuple[bool, ...]:
    """Return the cases of each draw: with compliance, if the scenario has one, and without."""
    return (False,) if assembly_of(scenario).compliance is None else (True, False)


def settings(trial: Trial) -> dict[str, str]:
    """Return the keys that make the scenario that of the trial, with their values as text."""
    found = {
        f"task.errors.{name}": repr(value)
        for name, value in msgspec.to_builtins(trial.errors).items()
    }
    found["task.layout.holes.errors_m"] = json.dumps(trial.hole_errors_m)
    found["imperfections.robot.coulomb_ratio"] = repr(trial.coulomb_ratio)
    return found if trial.compliance else {**found, "task.compliance": "none"}


def run_one(scenario: Scenario, seed: int, index: int, compliance: bool) -> Trial:
    """Run draw ``index`` of the scenario; one that is refused or raises is a trial as well."""
    drawn = draw(scenario, seed, index)
    if not compliance:
        drawn = without_compliance(drawn)
    run: Run | None = None
    try:
        run = make_run(drawn)
        return _evaluated(result_of(run), index)
    except Exception as error:  # one bad run must not end the study
        outcome, reason = outcome_of(error)
    reached = (
        BEFORE if run is None else _phase(task_of(run.scenario).phases, getattr(run, "trace", None))
    )
    return trial(
        drawn, index, success=False, outcome=outcome, reason=reason, phase=reached, cause=outcome
    )


def trial(drawn: Scenario, index: int, **ended: bool | str | float | None) -> Trial:
    """Return the trial of a drawn scenario that ended so."""
    config = assembly_of(drawn)
    fixed = {
        "index": index,
        "compliance": config.compliance is not None,
        "seed": drawn.seed,
        "misalignment_m": misalignment(drawn),
        "errors": config.errors,
        "hole_errors_m": config.layout.holes.errors_m,
        "coulomb_ratio": drawn.imperfections.robot.coulomb_ratio,
    }
    return msgspec.convert({**ended, **fixed}, Trial)


def _evaluated(result: RunRecord, index: int) -> Trial:
    count = int(seated(result).sum())
    success = result.outcome == "completed"
    phase, cause = "", ""
    if not success:
        phase, cause = _phase(result.task.phases, result.trace), cause_of(result.reason)
    forces = [row["peak_force_n"] for row in pin_table(result)] if result.trace.rows else []
    strain = surface_strain(result)
    strain = strain[np.isfinite(strain)]
    return trial(
        result.scenario,
        index,
        success=success,
        outcome=result.outcome,
        reason=result.reason,
        phase=phase,
        cause=cause,
        holes_seated=count,
        peak_pin_force_n=max((f for f in forces if f is not None), default=None),
        peak_surface_strain=float(strain.max()) if strain.size else None,
        simulated_s=result.simulated_s,
    )


def _phase(phases: tuple[str, ...], trace: Trace | None) -> str:
    """Return the phase in which a run ended: of one that stopped, that of the stop."""
    if trace is None or not trace.rows:
        return BEFORE
    told = trace["phase"][trace["phase"] < len(phases)]
    return phases[int(told[-1])]


def cause_of(reason: str) -> str:
    """Return the class of a reason."""
    return next((cause for says, cause in CAUSES if says in reason), OTHER)


def refuse_strangers(scenario: Scenario, seed: int, trials: Sequence[Trial]) -> None:
    """Raise InputError where a trial is of another draw than its index, or says what none does."""
    config, phases = assembly_of(scenario), task_of(scenario).phases
    most = len(config.layout.holes.names) * config.sheets
    for one in trials:
        at = f"draw {one.index}, {'with' if one.compliance else 'without'} compliance"
        if one.compliance not in cases(scenario):
            raise InputError(f"{at}: the scenario has none")
        drawn = draw(scenario, seed, one.index)
        expected = trial(drawn, one.index, success=False, outcome=one.outcome)
        for name in ("seed", "misalignment_m", "errors", "hole_errors_m", "coulomb_ratio"):
            said, value = getattr(one, name), getattr(expected, name)
            a, b = _flat(said), _flat(value)
            # Another machine's logarithm may differ in its last digit.
            if a.shape != b.shape or not np.allclose(a, b, rtol=1e-9, atol=0.0):
                raise InputError(f"{at}: {name} = {said}: seed {seed} draws {value}")
        if one.success and one.outcome != "completed":
            raise InputError(f"{at}: success, and outcome {one.outcome!r}")
        if one.holes_seated > most:
            raise InputError(f"{at}: holes_seated = {one.holes_seated}: it has {most}")
        if one.phase not in ("", BEFORE, *phases):
            raise InputError(f"{at}: phase = {one.phase!r}: the phases are {', '.join(phases)}")


def _flat(drawn: float | ErrorsConfig | tuple[tuple[float, float], ...]) -> Vector:
    return np.ravel(msgspec.structs.astuple(drawn) if isinstance(drawn, ErrorsConfig) else drawn)
