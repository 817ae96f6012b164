"""A handful of rows of an assembly, made up: two sheets, two attempts, every phase."""

from __future__ import annotations

import numpy as np

from dualbend.run.make import make_run
from dualbend.run.record import RunRecord, Scene
from dualbend.run.trace import TraceRecorder
from dualbend.scenario.load import load_scenario
from dualbend.task.assembly.program.motions import PHASES
from dualbend.task.assembly.run import AssemblyRun, columns

ROWS_A_PHASE = 3
BEND_RAD = 0.15
LAID_M = np.array([3e-4, -2e-4, 0.67225])
LAID_YAW_RAD = 0.004
UP = np.array([0.0, 0.0, 1.0])

Vector = np.ndarray


def stages() -> list[tuple[int, str, int]]:
    """Return sheet, phase and attempt of each row; the first sheet is lowered twice."""
    first = [(0, phase, 0) for phase in PHASES[: PHASES.index("unfold")]]
    first += [(0, "lower", 1), (0, "seat middle", 1)]
    first += [(0, phase, 0) for phase in PHASES[PHASES.index("unfold") :]]
    both = first + [(1, phase, 0) for phase in PHASES]
    return [stage for stage in both for _ in range(ROWS_A_PHASE)]


def make_book(seed: int = 3) -> tuple[AssemblyRun, RunRecord]:
    """Return a run that was not made and what it would have left, its columns drawn at random.

    The last row is unfinished, as that of a run that stopped.
    """
    run = make_run(load_scenario("pwb", ("task.sheets=2",)))
    assert isinstance(run, AssemblyRun)
    simulation, rows = run.cell.simulation, stages()
    hinges = run.scenario.sheet.strips.hinges
    trace = TraceRecorder(
        len(rows), [0, 1], simulation.model.nq, hinges, run.cell.arms.slides, columns(run.scenario)
    )
    generator = np.random.default_rng(seed)
    trace.rows = len(rows)
    trace._table[:] = 0.05 * generator.standard_normal(trace._table.shape)
    trace["time"][:] = 0.028 * np.arange(len(rows))
    for name, values in (
        ("sheet", [sheet for sheet, _, _ in rows]),
        ("phase", [PHASES.index(phase) for _, phase, _ in rows]),
        ("attempt", [attempt for _, _, attempt in rows]),
    ):
        trace[name][:] = values
    for row, (_, phase, _) in enumerate(rows):
        bent = PHASES.index("bend") <= PHASES.index(phase) <= PHASES.index("seat middle")
        slopes = BEND_RAD * np.linspace(1.0, -1.0, hinges + 1) * bent
        trace.qpos[row] = simulation.positions(
            run.cell.home, 0.0, slopes, LAID_M + 0.05 * bent * UP, LAID_YAW_RAD
        )
    trace.bends[:] = trace.qpos[:, simulation.sheet.bend_q]
    for name, _ in trace.columns:
        if "command" in name or "measured" in name or "filtered" in name:
            trace[name][-1] = np.nan
    return run, RunRecord(
        scenario=run.scenario,
        outcome="aborted",
        reason="withdraw: made up, at 2 s",
        trace=trace,
        scene=Scene(compiled=run.cell.with_looks, bend_stiffness=simulation.bend_stiffness),
        simulated_s=0.028 * len(rows),
        wall_time_s=1.0,
    )
