"""The summary of a run: how it ended, its numbers, and what contradicts physics in it."""

from __future__ import annotations

import msgspec

from dualbend.arm.joint_limits import joint_limit_margins
from dualbend.evaluation.metrics import versions
from dualbend.evaluation.sheet import sheet_report
from dualbend.evaluation.warnings import run_warnings, scenario_warnings
from dualbend.run.arms import arm_pair
from dualbend.run.record import RunRecord, Summary


def summarise(result: RunRecord) -> Summary:
    """Return the numbers of a run, as ``summary.json`` holds them."""
    scenario = result.scenario
    served = {"ports": list(result.ports), "lateness": list(result.lateness)}
    served = {name: rows for name, rows in served.items() if rows}
    return Summary(
        scenario=scenario.name,
        seed=scenario.seed,
        outcome=result.outcome,
        reason=result.reason,
        controller=result.controller,
        learned=result.learned,
        versions=versions(),
        warnings=[*scenario_warnings(scenario), *run_warnings(result)],
        sheet=msgspec.to_builtins(sheet_report(scenario)),
        metrics=result.metrics,
        arms=msgspec.to_builtins(joint_limit_margins(arm_pair(scenario), result.trace.setpoints)),
        tables={**result.task.part("tables")(result), **served},
    )
