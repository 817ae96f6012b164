"""The kind of run that a scenario asks for."""

from dualbend.run.loop import Run
from dualbend.scenario.scenario import Scenario
from dualbend.task.assembly.run import AssemblyRun
from dualbend.task.bending.run import BendingRun


def make_run(scenario: Scenario) -> Run:
    """Return what runs the scenario: the assembly where it has one, else the bending."""
    return BendingRun(scenario) if scenario.assembly is None else AssemblyRun(scenario)
