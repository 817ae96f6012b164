"""The scene as it truly is, with what is wrong with arms and sheet."""

from __future__ import annotations

import mujoco

from dualbend.arm.pair import ArmPair
from dualbend.control.servo import JointServo
from dualbend.imperfection.robot import RobotErrors, TrueArms
from dualbend.scenario.scenario import Scenario
from dualbend.scene.cell import compose_cell


def composed(scenario: Scenario, arms: ArmPair, servo: JointServo, *, looks: bool) -> mujoco.MjSpec:
    """Return the whole scene as it truly is."""
    spec = compose_cell(
        scenario.cell,
        arms,
        scenario.grasp,
        scenario.true_sheet,
        scenario.sheet.model,
        servo,
        scenario.step_s,
        scenario.task.workplace,
        scenario.task.laid_sheets,
        looks=looks,
    )
    errors = scenario.imperfections.robot
    if errors != RobotErrors():
        TrueArms(errors, arms, scenario.seed).write(spec)
    return spec


def compiled_with_looks(scenario: Scenario, arms: ArmPair, servo: JointServo) -> mujoco.MjModel:
    """Return its model with its looks, for pictures; the same joints as the simulated one."""
    return composed(scenario, arms, servo, looks=True).compile()
