"""The section of the task ``assembly``: workplace, errors that the robots do not know, limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import msgspec

from dualbend.beam.sheet import Sheet
from dualbend.control.compliance.object import ObjectComplianceConfig
from dualbend.errors import InputError
from dualbend.planning.geometry import circles
from dualbend.scenario.motion import MotionConfig
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import SheetConfig
from dualbend.scenario.task import TaskConfig
from dualbend.scene.bed.config import HolesConfig, LayoutConfig
from dualbend.types import Config, said


class SpeedsConfig(Config):
    """Highest speed of each kind of motion."""

    travel_m_per_s: Annotated[float, said("of sheet or grippers in free motion", gt=0, le=5)] = 0.25
    contact_m_per_s: Annotated[float, said("down past the tips of the pins", gt=0, le=5)] = 0.003
    seat_m_per_s: Annotated[float, said("down from there to the bed", gt=0, le=5)] = 0.010
    unfold_rad_per_s: Annotated[
        float, said("of unfolding and turning in free motion", gt=0, le=10)
    ] = 0.1
    contact_rad_per_s: Annotated[float, said("of unfolding onto the pins", gt=0, le=10)] = 0.03
    jaw_m_per_s: Annotated[float, said("of each jaw", gt=0, le=5)] = 0.02


class SearchConfig(Config):
    """What is done where a hole did not find its pin: up, aside or turned, down again."""

    attempts: Annotated[int, said("before the task stops", ge=0, le=50)] = 20
    step_m: Annotated[float, said("between the places that are tried", gt=0, le=0.05)] = 1.2e-3
    turn_rad: Annotated[float, said("between the turns that are tried", gt=0, le=0.2)] = 0.01

    def places(self) -> list[tuple[float, float]]:
        """Return where to try the middle holes, (x, y) [m], relative to their place.

        In place, then along and across on both sides, then the corners; then further out.
        """
        square = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)]
        rings = [(1 + n // 8, *square[n % 8]) for n in range(self.attempts)]
        return [(0.0, 0.0), *((n * x * self.step_m, n * y * self.step_m) for n, x, y in rings)]

    def turns(self, holes: HolesConfig) -> list[float]:
        """Return how far the sheet is turned for the outer holes [rad].

        The middle is on its pins already: to both sides, in equal steps up to the turn that its
        clearance leaves. A larger one would only press the middle holes on their pins. The steps
        are as large as the play of the outer holes: none lies between two of them. A single middle
        hole leaves any turn: then by ``turn_rad``.
        """
        near, far = (around.radius_m for around in circles(holes))
        room = 0.5 * holes.clearance_m / near if near else self.turn_rad
        steps = math.ceil(far / near) if near else 1
        sides = [side * n / steps for n in range(1, steps + 1) for side in (1, -1)]
        return [0.0, *(room * side for side in sides[: self.attempts])]


DEFAULT_YIELD_PA = 193e6
"""Of a sheet of no named material: 5052-H32, that of the shipped experiments."""


class LimitsConfig(Config):
    """What damages the sheet or a pin: beyond it the run fails."""

    pin_force_n: Annotated[float, said("largest force on a pin", gt=0, le=1e5)] = 40.0
    edge_force_n: Annotated[
        float, said("largest force of one contact at a hole's edge", gt=0, le=1e5)
    ] = 40.0
    penetration_m: Annotated[
        float, said("sheet in pin through a command period, which no metal is", gt=0, le=1e-3)
    ] = 0.05e-3
    yield_pa: (
        Annotated[float, said("0.2 % yield strength; none: the sheet's, or 193 MPa", gt=0, le=1e11)]
        | None
    ) = None


class ErrorsConfig(Config):
    """What is otherwise than the robots believe; they are not told."""

    pickup_x_m: Annotated[float, said("how far the sheet lies off along x", ge=-1, le=1)] = 0.0
    pickup_y_m: Annotated[float, said("how far the sheet lies off along y", ge=-1, le=1)] = 0.0
    pickup_yaw_rad: Annotated[
        float, said("how far the sheet lies turned about the vertical", ge=-3.15, le=3.15)
    ] = 0.0
    scatter_m: Annotated[
        float, said("standard deviation of each sheet's place along x and y besides", ge=0, le=0.1)
    ] = 0.0
    scatter_rad: Annotated[
        float, said("standard deviation of each sheet's turn besides", ge=0, le=1)
    ] = 0.0
    thickness_factor: Annotated[
        float, said("true thickness over the believed one", gt=0, le=10)
    ] = 1.0
    modulus_factor: Annotated[
        float, said("true Young's modulus over the believed one", gt=0, le=100)
    ] = 1.0
    friction_factor: Annotated[float, said("true friction over the believed one", ge=0, le=10)] = (
        1.0
    )


_Share = Annotated[float, msgspec.Meta(ge=0.2, le=5)]


class SpreadConfig(Config):
    """Standard deviations of what differs from sheet to sheet; those without a unit are relative.

    ``hole_m`` is that of each hole along the sheet, and across it. ``fed_forward`` is no standard
    deviation but a range, all of it equally likely.
    """

    pickup_x_m: Annotated[float, said("of where the sheet lies along x", ge=0, le=0.1)] = 0.3e-3
    pickup_y_m: Annotated[float, said("of where the sheet lies along y", ge=0, le=0.1)] = 0.3e-3
    pickup_yaw_rad: Annotated[float, said("of its turn about the vertical", ge=0, le=1)] = (
        math.radians(0.2)
    )
    hole_m: Annotated[float, said("of each hole's place, along and across", ge=0, le=0.01)] = (
        0.01e-3
    )
    thickness: Annotated[float, said("of true over believed thickness", ge=0, le=1)] = 0.02
    modulus: Annotated[float, said("of true over believed Young's modulus", ge=0, le=1)] = 0.02
    friction: Annotated[float, said("of true over believed friction", ge=0, le=1)] = 0.2
    fed_forward: Annotated[
        tuple[_Share, _Share],
        said("joints' friction that is fed forward over the true one, lowest and highest"),
    ] = (0.6, 1.4)

    def __post_init__(self) -> None:
        """Refuse a range whose ends are the other way round."""
        low, high = self.fed_forward
        if low > high:
            raise ValueError(f"fed_forward = [{low:g}, {high:g}]: the lower one comes first")


class AssemblyConfig(TaskConfig, tag="assembly"):
    """Lay sheets with holes over alignment pins: the workplace, and how the robots work there."""

    layout: LayoutConfig = LayoutConfig()
    sheets: Annotated[int, said("of the stack", ge=1, le=10)] = 1
    errors: ErrorsConfig = ErrorsConfig()
    spread: SpreadConfig = SpreadConfig()
    speeds: SpeedsConfig = SpeedsConfig()
    search: SearchConfig = SearchConfig()
    limits: LimitsConfig = LimitsConfig()
    compliance: ObjectComplianceConfig | None = None
    lift_m: Annotated[float, said("above stand and bed", gt=0, le=0.5)] = 0.05
    retreat_m: Annotated[float, said("from the sheet's end", gt=0, le=0.3)] = 0.05
    jaw_opening_m: Annotated[float, said("of each jaw", gt=0, le=0.015)] = 0.012
    press_m: Annotated[float, said("lower than the middle would need", ge=0, le=0.01)] = 0.2e-3
    check_force_n: Annotated[
        float,
        said("by which pins are felt before a sheet is let go; 0: not", ge=0, le=100),
    ] = 5.0
    learn: Annotated[bool, said("begin a sheet with what was found with those before")] = True
    timeout_s: Annotated[float, said("to wait for a phase's end", gt=0, le=600)] = 10.0

    @property
    def moves_freely(self) -> bool:
        """Arms that go for a sheet and carry it meet nothing but their own friction."""
        return True

    @property
    def carried_share(self) -> float:
        """One arm alone must be able to bear the sheet."""
        return 1.0

    @property
    def laid_sheets(self) -> int:
        """All sheets of the stack but the last one."""
        return self.sheets - 1

    @property
    def workplace(self) -> LayoutConfig:
        """The workplace with the friction that it really has."""
        factor = self.errors.friction_factor
        parts = {
            name: msgspec.structs.replace(part, friction=part.friction * factor)
            for name, part in (("pins", self.layout.pins), ("bed", self.layout.bed))
        }
        return msgspec.structs.replace(self.layout, **parts)

    def check(self, sheet: SheetConfig, motion: MotionConfig) -> None:
        """Refuse a sheet that yields or has no holes, and a motion that goes back."""
        if sheet.plastic:
            raise InputError(
                "sheet.plastic = true: an assembly ends where the sheet would yield; not both"
            )
        if sheet.model.kind == "shell":
            raise InputError(
                'sheet.model = "shell" has no holes and no contact: an assembly needs "strips"'
            )
        for key in ("profile", "rest_curvature_per_m"):
            if getattr(sheet, key):
                raise InputError(
                    f"sheet.{key}: an assembly is planned for a sheet of one thickness, flat at "
                    "rest; imperfections.sheet.curvature_per_m curves the sheet that it is not "
                    "planned for"
                )
        if motion.return_rad is not None:
            raise InputError(
                f"motion.return_rad = {motion.return_rad} is for a sheet that is bent between "
                "two grips; an assembly lays it and does not go back"
            )

    def true_sheet(self, sheet: Sheet) -> Sheet:
        """Return the sheet as it is."""
        return replace(
            sheet,
            thickness_m=sheet.thickness_m * self.errors.thickness_factor,
            young_pa=sheet.young_pa * self.errors.modulus_factor,
        )

    def limit_strain(self, known: float | None, sheet: Sheet) -> float:
        """Return the strain at the given yield strength, or the material's, or the default."""
        given = self.limits.yield_pa
        if given is None and known is not None:
            return known
        return (DEFAULT_YIELD_PA if given is None else given) / sheet.young_pa


def assembly_of(scenario: Scenario) -> AssemblyConfig:
    """Return the scenario's assembly; InputError where its task is another one."""
    if not isinstance(scenario.task, AssemblyConfig):
        raise InputError(
            f"scenario {scenario.name!r}: task.kind = {scenario.task.kind!r}: this is of an "
            'assembly, task.kind = "assembly"'
        )
    return scenario.task
