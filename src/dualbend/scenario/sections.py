"""Sections of a scenario: arms, physics step, expected outcome."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from dualbend.arm.catalog import ArmName
from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.types import Side

Outcome = Literal["completed", "aborted", "protective_stop", "failed"]


class ArmsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which arms carry a force/torque sensor and which comply.

    A complying arm without a sensor mirrors the deviation of the arm that has one.
    """

    sensing: Annotated[
        tuple[Side, ...],
        msgspec.Meta(min_length=1, max_length=2, description="arms with a force/torque sensor"),
    ] = ("left",)
    complying: Annotated[
        tuple[Side, ...], msgspec.Meta(max_length=2, description="arms that the compliance moves")
    ] = ("left",)

    def __post_init__(self) -> None:
        """Refuse an arm that is named twice."""
        for name, sides in (("sensing", self.sensing), ("complying", self.complying)):
            if len(set(sides)) != len(sides):
                raise ValueError(f"{name} names an arm twice: {list(sides)}")


class ArmConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which arms: the PUMA 560, or one of those that the package example-robot-data describes."""

    model: Annotated[ArmName, msgspec.Meta(description="kind of both arms")] = "puma560"
    left: (
        Annotated[ArmName, msgspec.Meta(description="kind of the left arm, if another")] | None
    ) = None
    right: (
        Annotated[ArmName, msgspec.Meta(description="kind of the right arm, if another")] | None
    ) = None

    def of(self, side: Side) -> ArmName:
        """Return the name of one side's arm."""
        return (self.left if side == "left" else self.right) or self.model


class PhysicsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The physics step."""

    step_s: Annotated[
        float,
        msgspec.Meta(
            ge=1e-5, le=0.028, description="of the integrator; divides the command period of 28 ms"
        ),
    ] = 0.00175

    def __post_init__(self) -> None:
        """Refuse a step that does not divide the command period."""
        steps_per_cycle(self.step_s, COMMAND_PERIOD_S)


class ExpectConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Outcomes that are no failure of the command: exit code 0."""

    outcome: Annotated[
        tuple[Outcome, ...], msgspec.Meta(min_length=1, description="how the run may end")
    ] = ("completed",)
