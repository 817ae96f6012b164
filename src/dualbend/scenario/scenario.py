"""The scenario: one TOML file, typed and strict, that says everything about a run.

A file may say ``extends = "fig6"`` and give only what differs. Every error is an
:class:`~dualbend.errors.InputError` with the file, the key, the value and what would be right.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

import msgspec
import tomli_w

from dualbend.beam import elastica
from dualbend.beam.sheet import Sheet
from dualbend.control.clock import default_step_s, refuse_beyond_nyquist, steps_per_cycle
from dualbend.control.compliance.admittance import AdmittanceConfig, ComplianceConfig
from dualbend.control.filters import FirConfig, LowPassConfig, refuse_filter
from dualbend.control.force_torque import ForceTorqueConfig
from dualbend.control.guard import GuardConfig
from dualbend.control.learning import LearningConfig
from dualbend.errors import InputError
from dualbend.imperfection.config import ImperfectionsConfig, PresetName, alone
from dualbend.imperfection.sheet import true_sheet
from dualbend.scenario.motion import MotionConfig, make_time_law
from dualbend.scenario.path import PathConfig
from dualbend.scenario.sections import (
    ExpectConfig,
    PhysicsConfig,
    RobotConfig,
    ServeConfig,
    check_arms,
    check_joint_counts,
)
from dualbend.scenario.sheet import SheetConfig
from dualbend.scenario.task import AnyTask, default_task
from dualbend.scene.cell import CellConfig, GraspConfig
from dualbend.types import Config, said

LONGEST_RUN_S = 3600.0
"""A run of an hour holds some 10⁵ cycles in memory."""


class Scenario(Config):
    """Everything about a run."""

    name: Annotated[
        str,
        said(
            "letters, digits and . _ + -; names the folder of the results",
            min_length=1,
            max_length=100,
            pattern=r"^[A-Za-z0-9][\w.+-]*\Z",
        ),
    ]
    description: Annotated[str, said("what the scenario shows, in one line", max_length=1000)] = ""
    seed: Annotated[int, said("of noise and imperfections", ge=0, le=10**12)] = 1
    repeat: Annotated[
        int,
        said("number of the sheet in a series: another noise in the same cell", ge=0, le=10**6),
    ] = 0
    sheet: SheetConfig
    path: PathConfig
    motion: MotionConfig = MotionConfig()
    cell: CellConfig = CellConfig()
    grasp: GraspConfig = GraspConfig()
    robot: RobotConfig = RobotConfig()
    sensor: ForceTorqueConfig = ForceTorqueConfig()
    filter: LowPassConfig = FirConfig()
    compliance: ComplianceConfig = AdmittanceConfig()
    learning: LearningConfig | None = None
    task: AnyTask = msgspec.field(default_factory=default_task)
    guard: GuardConfig = GuardConfig()
    imperfections: ImperfectionsConfig = ImperfectionsConfig()
    physics: PhysicsConfig = PhysicsConfig()
    expect: ExpectConfig = ExpectConfig()
    serve: ServeConfig | None = None

    def __post_init__(self) -> None:
        """Refuse a run too long to be meant, joints that no arm has, yielding that must not be."""
        steps_per_cycle(self.step_s, self.period_s)  # refuses a step that does not divide it
        refuse_filter(self.filter, self.period_s)
        if self.learning is not None:
            refuse_beyond_nyquist("learning.cutoff_hz", self.learning.cutoff_hz, self.period_s)
        check_arms(self.robot)
        check_joint_counts(self.robot, self.cell, self.imperfections.robot)
        self.task.check(self.sheet, self.motion)
        free = self.task.moves_freely or self.learning is not None
        if self.robot.servo.friction_estimate is not None and not free:
            raise InputError(
                "robot.servo.friction_estimate: in this task the arms always bear the sheet's "
                "forces; friction is told by arms that move freely, in an assembly or before the "
                'sheets of a section learning. "none" switches it off'
            )
        if not self.task.learns and (self.learning or self.path.learned):
            key = "learning" if self.learning else "path.learned"
            raise InputError(f"{key}: in this task nothing is learned from sheet to sheet")
        self._refuse_curved_shell()
        if self.imperfections.events.grips and self.grasp.friction is None:
            raise InputError(
                "imperfections.events.power_failure and oil change the friction of a grip, and "
                "grasp.friction = none never slides: give it, 0.5 for example"
            )
        self.path.make(self.sheet.length_m)  # refuses a table that does not suit the sheet
        self._resolve_curvature()
        law = make_time_law(self.path, self.motion)
        total = self.motion.settle_s + law.duration_s + self.motion.hold_s
        if self.motion.return_rad is not None:
            if not self.path.start_rad <= self.motion.return_rad < self.path.end_rad:
                raise ValueError(
                    f"motion.return_rad = {self.motion.return_rad} must lie between "
                    f"path.start_rad = {self.path.start_rad} and path.end_rad = {self.path.end_rad}"
                )
            back = make_time_law(self.path, self.motion, back=True)
            total += back.duration_s + self.motion.hold_s
        if not total <= LONGEST_RUN_S:
            raise ValueError(
                f"motion.speed_rad_per_s = {self.motion.speed_rad_per_s} with "
                f"motion.acceleration_rad_per_s2 = {self.motion.acceleration_rad_per_s2} makes a "
                f"run of {total:.4g} s; the longest is {LONGEST_RUN_S:.0f} s"
            )

    def _refuse_curved_shell(self) -> None:
        errors = self.imperfections.sheet
        # A spread, which a preset may bring, has no effect on a shell.
        if errors.curvature_per_m and self.sheet.model.kind == "shell":
            raise InputError(
                f"imperfections.sheet.curvature_per_m = {errors.curvature_per_m:g}: a shell is "
                'flat at rest; 0, or sheet.model = "strips"'
            )

    def _resolve_curvature(self) -> None:
        """Take the width's rigidity at the path's largest curvature, (4 K/L) sin(α/2)."""
        sheet = self.sheet
        if sheet.rigidity == "width" and sheet.curvature_per_m is None:
            largest = elastica.curvature_max(self.path.end_rad, sheet.length_m)
            msgspec.structs.force_setattr(
                self, "sheet", msgspec.structs.replace(sheet, curvature_per_m=largest)
            )

    @property
    def period_s(self) -> float:
        """The command period [s]."""
        return self.robot.command_period_s

    @property
    def step_s(self) -> float:
        """The physics step [s]: as given, else the longest up to 1.75 ms that divides T."""
        return self.physics.step_s or default_step_s(self.period_s)

    @property
    def after_stop_cycles(self) -> int:
        """Command cycles that a run goes on after a stop."""
        return round(self.guard.after_stop_s / self.period_s)

    @property
    def limit_strain(self) -> float | None:
        """Surface strain at which the sheet yields or breaks; None: not known."""
        return self.task.limit_strain(self.sheet.limit_strain, self.sheet.sheet())

    @property
    def true_sheet(self) -> Sheet:
        """The sheet as it is, which only the physics knows; ``sheet`` is the believed one."""
        believed = self.task.true_sheet(self.sheet.sheet())
        true = true_sheet(believed, self.imperfections.sheet, self.seed)
        if self.sheet.model.kind == "shell" and true.rest_curvature_per_m:
            return dataclasses.replace(true, rest_curvature_per_m=0.0)
        return true

    def to_toml(self) -> str:
        """Return the resolved scenario: loading it again gives an equal object."""
        return tomli_w.dumps(without_none(msgspec.to_builtins(self)))


def variants(scenario: Scenario, preset: PresetName) -> dict[str, Scenario]:
    """Return the scenario without imperfections, with each of a preset alone, and with all."""
    return {
        part: msgspec.structs.replace(scenario, imperfections=imperfections)
        for part, imperfections in alone(preset).items()
    }


def without_none(value: Any) -> Any:  # noqa: ANN401 - a tree of TOML values
    """Return a tree of TOML values without what is not set: TOML has no null."""
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [without_none(item) for item in value]
    return value
