"""One kind of arm measured: model against equations, servos, and the paper's experiment on it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from dualbend.arm.catalog import known_arm
from dualbend.arm.file import is_file
from dualbend.arm.joint_limits import joint_limit_margins
from dualbend.arm.model import PUMA, ArmModel
from dualbend.arm.placement import MIN_MARGIN_RAD
from dualbend.task.bending.run import BendingRun
from dualbend.validation.cases import properties
from dualbend.validation.cases.arm import difference_rows, table_rows
from dualbend.validation.cases.cell import response_rows, stiffness_rows
from dualbend.validation.cases.runs import LINEAR, ik_rows, moment_error, paper_gains
from dualbend.validation.perfect import perfect_scenario
from dualbend.validation.row import Row, absolute, at_least
from dualbend.validation.urdf import equations_of

_SEED = 21
_MODEL_LIMIT = 1e-9
_MOMENT_LIMIT = 0.10
_LEAST_MANIPULABILITY = 0.05
"""A twentieth of the arm's largest: nearer to singular than that, joints turn fast for little.

Asked of a place that was found. The PUMA's documented one puts the whole arm into the bending
plane, where its wrist is singular across the plane, which nothing moves along.
"""

EXPERIMENTS = {
    "linear pieces": LINEAR,
    "the paper's gains": (
        *LINEAR,
        "compliance=admittance",
        "compliance.units=paper",
        *paper_gains(),
    ),
}
"""On ``exact``'s light strip, in a perfect cell: every arm bears it."""


def arm_rows(name: str, settings: Sequence[str] = ()) -> Iterator[Row]:
    """Measure one kind of arm, two of them in the paper's cell; takes 30 s.

    ``name``: of a shipped arm, or its file, with ``settings`` such as ``robot.arm.flange=tool0``.
    Raises InputError where there is no such arm, or it cannot do the experiment.
    """
    if not is_file(name):
        known_arm(name, "--arm")
    settings = (f'robot.model="{name}"', *settings)
    # What refuses the arm comes first.
    ready = {
        name: BendingRun(perfect_scenario("exact", (*settings, *changes)))
        for name, changes in EXPERIMENTS.items()
    }
    arm = next(iter(ready.values())).cell.arms.left.model
    yield from table_rows() if arm.name == PUMA else model_rows(arm)
    yield from properties.arm_rows(arm)
    yield from response_rows(settings)
    yield from stiffness_rows(settings)
    for experiment, run in ready.items():
        yield from experiment_rows(experiment, run)


def model_rows(arm: ArmModel, configurations: int = 20) -> Iterator[Row]:
    """Compare flange pose, gravity torques and mass matrix with the equations of the file."""
    assert arm.file is not None
    low, high = np.array(arm.range_rad).T
    angles = np.random.default_rng(_SEED).uniform(low, high, (configurations, arm.count))
    model, theory = arm.spec(looks=False).compile(), equations_of(arm.file)
    kind, limit = "URDF" if arm.file.is_urdf else "MJCF", _MODEL_LIMIT
    text = f"{arm.name} {{}}, rel. difference from the {kind}"
    yield from difference_rows(text, model, theory, arm.armature_kg_m2, angles, limit)


def experiment_rows(name: str, ready: BendingRun) -> Iterator[Row]:
    """Run an experiment of the paper and check end, moment, residuals and the arms' margins."""
    result = ready.run()
    yield absolute(f"{name} completes", result.outcome == "completed", 1.0, "1", 0.0)
    yield from ik_rows(f"{name} IK residual", result)
    text = f"{name} moment error / first peak, at gripper poses"
    yield absolute(text, moment_error(result, "grip"), 0.0, "1", _MOMENT_LIMIT)
    margins = joint_limit_margins(ready.cell.arms, result.trace.setpoints)["left"]
    least, found = math.degrees(MIN_MARGIN_RAD), ready.cell.arms.left.model.placement is None
    text = f"{name} joint-limit margin, {margins.joint}"
    yield at_least(text, _number(margins.margin_deg), least, "deg")
    text = f"{name} manipulability over the arm's largest"
    least = _LEAST_MANIPULABILITY if found else 0.0
    yield at_least(text, _number(margins.manipulability), least, "1")


def _number(value: float | None) -> float:
    return math.nan if value is None else value
