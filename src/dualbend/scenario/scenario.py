"""The scenario: one TOML file, typed and strict, that says everything about a run.

A file may say ``extends = "fig6"`` and give only what differs. Every error is an
:class:`~dualbend.errors.InputError` with the file, the key, the value and what would be right.
"""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
import tomli_w

from dualbend.arm.catalog import JOINT_COUNT
from dualbend.beam import elastica
from dualbend.control.alter import AlterConfig
from dualbend.control.compliance.admittance import AdmittanceConfig
from dualbend.control.filters import LowPassConfig
from dualbend.control.force_torque import ForceTorqueConfig
from dualbend.control.guard import GuardConfig
from dualbend.control.response import CommandResponseConfig
from dualbend.control.servo import JointServoConfig
from dualbend.errors import InputError
from dualbend.scenario.assembly import DEFAULT_YIELD_PA, AssemblyConfig
from dualbend.scenario.misalignment import SHORTEST_SETTLE_S, MisalignmentConfig
from dualbend.scenario.motion import MotionConfig, make_time_law
from dualbend.scenario.path import PathConfig, make_path
from dualbend.scenario.sections import ArmConfig, ArmsConfig, ExpectConfig, PhysicsConfig
from dualbend.scenario.sheet import SheetConfig
from dualbend.scene.cell import CellConfig, GraspConfig
from dualbend.types import SIDES

LONGEST_RUN_S = 3600.0
"""A run of an hour holds some 10⁵ cycles in memory."""


class Scenario(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything about a run."""

    name: Annotated[
        str,
        msgspec.Meta(
            min_length=1,
            max_length=100,
            pattern=r"^[A-Za-z0-9][\w.+-]*\Z",
            description="letters, digits and . _ + -; names the folder of the results",
        ),
    ]
    description: Annotated[
        str, msgspec.Meta(description="what the scenario shows, in one line")
    ] = ""
    seed: Annotated[int, msgspec.Meta(ge=0, description="of the sensor's noise")] = 1
    sheet: SheetConfig
    path: PathConfig
    motion: MotionConfig = MotionConfig()
    cell: CellConfig = CellConfig()
    grasp: GraspConfig = GraspConfig()
    arm: ArmConfig = ArmConfig()
    arms: ArmsConfig = ArmsConfig()
    response: CommandResponseConfig = CommandResponseConfig()
    servo: JointServoConfig = JointServoConfig()
    alter: AlterConfig = AlterConfig()
    sensor: ForceTorqueConfig = ForceTorqueConfig()
    filter: LowPassConfig = LowPassConfig()
    compliance: AdmittanceConfig = AdmittanceConfig()
    assembly: AssemblyConfig | None = None
    misalignment: MisalignmentConfig | None = None
    guard: GuardConfig = GuardConfig()
    physics: PhysicsConfig = PhysicsConfig()
    expect: ExpectConfig = ExpectConfig()

    def __post_init__(self) -> None:
        """Refuse a run too long to be meant, joints that no arm has, yielding that must not be."""
        self._refuse_joint_counts()
        self._refuse_what_no_assembly_has()
        self._refuse_unfit_table()
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
        if self.misalignment is not None and self.motion.settle_s < SHORTEST_SETTLE_S:
            raise ValueError(
                f"motion.settle_s = {self.motion.settle_s}: misalignment comes in while the arms "
                f"settle and needs at least {SHORTEST_SETTLE_S} s"
            )

    def _refuse_what_no_assembly_has(self) -> None:
        if self.assembly is None:
            return
        if self.sheet.plastic:
            raise ValueError(
                "sheet.plastic = true: an assembly ends where the sheet would yield; not both"
            )
        if self.sheet.model == "shell":
            raise ValueError(
                'sheet.model = "shell" has no holes and no contact: an assembly needs "strips"'
            )
        if self.misalignment is not None:
            raise ValueError(
                "misalignment is for a sheet that is bent between two grips; "
                "an assembly has assembly.errors"
            )
        if self.motion.return_rad is not None:
            raise ValueError(
                f"motion.return_rad = {self.motion.return_rad} is for a sheet that is bent between "
                "two grips; an assembly lays it and does not go back"
            )

    def _refuse_unfit_table(self) -> None:
        """Only a table can be at odds with the sheet: the other paths are made of its length."""
        if self.path.kind != "table":
            return
        try:
            make_path(self.path, self.sheet.length_m)
        except InputError as error:
            raise ValueError(str(error)) from error

    def _refuse_joint_counts(self) -> None:
        for side in SIDES:
            name, stand = self.arm.of(side), getattr(self.cell, side) or self.cell
            for key, values in (
                ("servo.stiffness_n_m_per_rad", self.servo.stiffness_n_m_per_rad),
                ("cell.home_rad", self.cell.home_rad),
                (f"cell.{side}.home_rad", stand.home_rad),
            ):
                if values is not None and len(values) != JOINT_COUNT[name]:
                    raise ValueError(
                        f"{key} has {len(values)} values, the {side} arm {name!r} has "
                        f"{JOINT_COUNT[name]} joints"
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
    def limit_strain(self) -> float | None:
        """Surface strain at which the sheet yields or breaks; None: not known."""
        known, sheet = self.sheet.limit_strain, self.sheet.sheet()
        if self.assembly is None:
            return known
        given = self.assembly.limits.yield_pa
        if given is None and known is not None:
            return known
        return (DEFAULT_YIELD_PA if given is None else given) / sheet.young_pa

    def to_toml(self) -> str:
        """Return the resolved scenario: loading it again gives an equal object."""
        return tomli_w.dumps(without_none(msgspec.to_builtins(self)))


def without_none(value: Any) -> Any:  # noqa: ANN401 - a tree of TOML values
    """Return a tree of TOML values without what is not set: TOML has no null."""
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [without_none(item) for item in value]
    return value
