"""The kind of run that a scenario asks for."""

from dualbend.run.assembly_run import AssemblyRun
from dualbend.run.runner import BendingRun, Run
from dualbend.run.scenario import Scenario


def make_run(scenario: Scenario) -> Run:
    """Return what runs the scenario: the assembly where it has one, else the bending."""
    return BendingRun(scenario) if scenario.assembly is None else AssemblyRun(scenario)
