"""One trial of a Monte Carlo study: what a sheet is drawn to be, and what became of its assembly.

The robots believe in the scenario's sheet, holes and stand; only the truth is drawn. Every draw is
run with the compliance that the scenario gives and without any.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from dualbend.errors import DualbendError, InputError
from dualbend.evaluation.metrics import surface_strain
from dualbend.run.loop import Run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord, task_of
from dualbend.run.trace import Trace
from dualbend.scenario.assembly import AssemblyConfig, ErrorsConfig
from dualbend.scenario.scenario import Scenario
from dualbend.scene.bed.config import HOLES, hole_places
from dualbend.task.assembly.metrics import pin_table, seated

CAUSES = (
    ("the middle holes did not find", "middle holes not found"),
    ("the outer holes did not find", "outer holes not found"),
    ("hole edge is", "force on a hole's edge"),
    ("pin is", "force on a pin"),
    ("surface strain", "sheet yields"),
    ("nothing is between", "sheet not gripped"),
    ("the jaws have not", "jaws not at rest"),
    ("the arms carry", "weight not as expected"),
    ("the grips are not where", "grips not where sent"),
    ("following error", "following error"),
    ("torque limit", "torque limit"),
    ("range's end", "end of a joint's range"),
    ("speed of", "joint speed"),
    ("commanded", "out of reach"),
    ("not done after", "took too long"),
    ("MuJoCo warning", "physics diverged"),
)
"""What the reason of a run that ended early says, and the class that it belongs to; first match."""

NOT_SEATED, REFUSED, RAISED, OTHER = "holes not seated", "refused", "error", "other"
BEFORE, AFTER = "before the run", "after the run"


class Trial(msgspec.Struct, frozen=True, kw_only=True):
    """One run: what was drawn and what became of it.

    ``seed`` of the sensors' noise, the same with and without compliance. ``success``: all holes of
    all sheets are seated. ``phase`` and ``cause`` of a failure, else empty. ``misalignment_m`` as
    :func:`misalignment` has it. None where the run was refused or raised.
    """

    index: int
    compliance: bool
    seed: int
    success: bool
    outcome: str
    reason: str = ""
    phase: str = ""
    cause: str = ""
    holes_seated: int = 0
    peak_pin_force_n: float | None = None
    peak_surface_strain: float | None = None
    simulated_s: float | None = None
    misalignment_m: float
    errors: ErrorsConfig
    hole_errors_m: tuple[tuple[float, float], ...]


def draw(scenario: Scenario, seed: int, index: int) -> Scenario:
    """Return the scenario with the errors of draw ``index``, added to those that it has.

    Of SeedSequence(seed)'s child ``index``: it depends on no other draw. Lengths and angles are
    normal with the standard deviations of ``assembly.spread``. Relative ones multiply by
    exp(σ z − σ²/2), σ² = ln(1 + s²): log-normal, of mean 1 and standard deviation s, above zero.
    The seed of the sensors' noise is drawn as well. InputError without an assembly.
    """
    config = assembly_of(scenario)
    spread, errors, holes = config.spread, config.errors, config.layout.holes
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    # All of them, always: a width that is changed leaves the other draws as they are.
    x, y, yaw, thickness, modulus, friction = rng.standard_normal(6).tolist()
    off = spread.hole_m * rng.standard_normal((len(HOLES), 2)) + np.array(holes.errors_m)
    drawn = ErrorsConfig(
        pickup_x_m=errors.pickup_x_m + spread.pickup_x_m * x,
        pickup_y_m=errors.pickup_y_m + spread.pickup_y_m * y,
        pickup_yaw_rad=errors.pickup_yaw_rad + spread.pickup_yaw_rad * yaw,
        thickness_factor=errors.thickness_factor * _factor(spread.thickness, thickness),
        modulus_factor=errors.modulus_factor * _factor(spread.modulus, modulus),
        friction_factor=errors.friction_factor * _factor(spread.friction, friction),
    )
    places = tuple((float(along), float(across)) for along, across in off)
    replace = msgspec.structs.replace
    layout = replace(config.layout, holes=replace(holes, errors_m=places))
    assembly = replace(config, errors=drawn, layout=layout)
    return replace(scenario, assembly=assembly, seed=int(rng.integers(2**31)))


def _factor(relative: float, z: float) -> float:
    variance = math.log1p(relative**2)
    return math.exp(math.sqrt(variance) * z - 0.5 * variance)


def without_compliance(scenario: Scenario) -> Scenario:
    """Return the scenario with arms that go where they are sent."""
    rigid = msgspec.structs.replace(assembly_of(scenario), compliance=None)
    return msgspec.structs.replace(scenario, assembly=rigid)


def assembly_of(scenario: Scenario) -> AssemblyConfig:
    """Return the scenario's assembly; InputError where it has none."""
    if scenario.assembly is None:
        raise InputError(
            f"scenario {scenario.name!r} has no assembly: what is drawn are the errors of one"
        )
    return scenario.assembly


def misalignment(scenario: Scenario) -> float:
    """Return how far the worst hole would be from its pin if nothing gave way [m].

    max over the holes of |R(ψ) (p + e) + d − p|: p the pin's place, e the hole's error, d and ψ
    the pick-up's, of a flat sheet laid where the robots believe to lay it.
    """
    config = assembly_of(scenario)
    errors, pins = config.errors, hole_places(config.layout.holes)
    c, s = math.cos(errors.pickup_yaw_rad), math.sin(errors.pickup_yaw_rad)
    holes = (pins + np.array(config.layout.holes.errors_m)) @ np.array([[c, s], [-s, c]])
    off = holes + np.array([errors.pickup_x_m, errors.pickup_y_m]) - pins
    return float(np.linalg.norm(off, axis=1).max())


def run_one(scenario: Scenario, seed: int, index: int, compliance: bool) -> Trial:
    """Run draw ``index`` of the scenario; one that is refused or raises is a trial as well."""
    drawn = draw(scenario, seed, index)
    if not compliance:
        drawn = without_compliance(drawn)
    run: Run | None = None
    try:
        run = make_run(drawn)
        return _judge(run.run(), index)
    except DualbendError as error:
        outcome, cause, reason = "refused", REFUSED, str(error)
    except Exception as error:  # one bad run must not end the study
        outcome, cause, reason = "error", RAISED, f"{type(error).__name__}: {error}"
    reached = (
        BEFORE if run is None else _phase(task_of(run.scenario).phases, getattr(run, "trace", None))
    )
    return trial(
        drawn, index, success=False, outcome=outcome, reason=reason, phase=reached, cause=cause
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
    }
    return msgspec.convert({**ended, **fixed}, Trial)


def _judge(result: RunRecord, index: int) -> Trial:
    config = assembly_of(result.scenario)
    count = int(seated(result).sum())
    success = result.outcome == "completed" and count == len(HOLES) * config.sheets
    phase, cause = "", ""
    if result.outcome != "completed":
        phase, cause = _phase(result.phases, result.trace), cause_of(result.reason)
    elif not success:
        phase, cause = AFTER, NOT_SEATED
    forces = [row["peak_force_n"] for row in pin_table(result)] if result.trace.rows else []
    strain = surface_strain(result)
    # The trace's bends, with the thickness that the sheet really has.
    strain = strain[np.isfinite(strain)] * config.errors.thickness_factor
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
    return phases[int(trace["phase"][-1])] if trace is not None and trace.rows else BEFORE


def cause_of(reason: str) -> str:
    """Return the class of a reason."""
    return next((cause for says, cause in CAUSES if says in reason), OTHER)
