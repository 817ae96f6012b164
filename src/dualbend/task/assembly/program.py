"""The assembly of a stack of printed wiring boards, phase by phase.

Pick the sheet up from the stand, carry it over the bed, bend it, lower its middle holes onto their
pins, unfold it until the outer ones are on theirs, let go, withdraw. What ends a phase is sensed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from dualbend.beam.path import BendingPath
from dualbend.beam.rod.planar import solve_planar
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.errors import InputError
from dualbend.task.assembly.config import AssemblyConfig
from dualbend.task.assembly.execution import Execution
from dualbend.task.assembly.motions import CHECK, Pace, Posture
from dualbend.task.assembly.state import MEAN_CYCLES, State
from dualbend.task.assembly.steps import (
    CheckGrasp,
    CheckHeld,
    CheckWeight,
    HolePair,
    Measure,
    Move,
    MoveDown,
    Phase,
    Shift,
    Step,
    Wait,
)
from dualbend.types import Vector

_TIP_MARGIN_M = 1.5e-3
"""Above and below the tips of the pins, where motions are slow."""


class AssemblyProgram:
    """Table of phases and steps by which two robots lay a stack of sheets.

    It does not change: any number of executions may share it. ``sheet``: as the robots believe it
    to be. ``path``: half distance and rise over the bending angle, up to that at which the sheet is
    laid. ``touch_rad``: bending angle at which the outer holes come to the tips of their pins.
    ``bend_speed_rad_per_s``: highest speed of the bending angle while the sheet bends in the air.
    """

    def __init__(
        self,
        *,
        config: AssemblyConfig,
        sheet: Sheet,
        path: BendingPath,
        touch_rad: float,
        bend_speed_rad_per_s: float,
        period_s: float,
    ) -> None:
        self.config, self.sheet, self.bend_rad = config, sheet, float(path.knots[-1])
        self.touch_rad, self.bend_speed_rad_per_s = touch_rad, bend_speed_rad_per_s
        self.pace = Pace(
            linear_m_per_s=config.speeds.travel_m_per_s,
            angular_rad_per_s=config.speeds.unfold_rad_per_s,
            jaw_m_per_s=config.speeds.jaw_m_per_s,
            period_s=period_s,
        )
        self._wait = partial(Wait, timeout_s=config.timeout_s, period_s=period_s)
        self.start = Posture(
            y=config.layout.stand.y_m,
            z=config.layout.stand.top_m + 0.5 * sheet.thickness_m,
            retreat=config.retreat_m,
            opening=config.jaw_opening_m,
        )
        self.press_force_n = middle_force(sheet, path, config.press_m)
        self.tip_force_n = middle_force(sheet, path, config.layout.pins.height_m)
        self.table = tuple(p for layer in range(config.sheets) for p in self._lay(layer))

    def begin(self, seat_stiffness: Vector) -> Execution:
        """Return an execution from the start; the stiffness (3,) is that of a sheet on its pins."""
        return Execution(self.table, self.start, self.bend_rad, seat_stiffness)

    def waypoints(self) -> list[tuple[str, Posture]]:
        """Return the postures between which the arms move, by the phase that ends there."""
        config, posture, seat = self.config, self.start, self._seat_z(0)
        found = [("approach", posture)]
        for phase, change in (
            ("grasp", {"retreat": 0.0, "opening": 0.0}),
            ("lift", {"z": posture.z + config.lift_m}),
            ("carry", {"y": 0.0, "z": seat + config.lift_m}),
            ("bend", {"alpha": self.bend_rad}),
            ("lower", {"z": seat - config.press_m}),
            ("unfold", {"alpha": 0.0, "z": seat}),
            ("withdraw", {"retreat": config.retreat_m}),
        ):
            posture = replace(posture, **change)
            found.append((phase, posture))
        return found

    def _seat_z(self, layer: int) -> float:
        return self.config.layout.bed.top_m + (0.5 + layer) * self.sheet.thickness_m

    # -- the table --------------------------------------------------------------------------

    def _lay(self, layer: int) -> Sequence[Phase]:
        """Return the phases that lay a sheet on this many others."""
        config, start, move, wait = self.config, self.start, self._move, self._wait
        t, weight = self.sheet.thickness_m, self.sheet.mass_kg * GRAVITY_M_PER_S2
        over = self._seat_z(layer) + config.lift_m
        back = [move(z=over), move(x=0.0, y=start.y, yaw=0.0), move(z=start.z)] if layer else []
        slow = replace(self.pace, angular_rad_per_s=self.bend_speed_rad_per_s)
        # The grips are where they were sent, and the noise has been averaged out.
        settle = partial(
            wait,
            quantity=State.grip_error,
            below=1e-3,
            otherwise="the grips are not where they were sent",
            rest_cycles=MEAN_CYCLES,
        )
        rest, gap = "the jaws have not come to rest", "the jaws have not opened"
        closed = wait(quantity=State.jaw_travel, below=0.1 * t, otherwise=rest)
        opened = wait(quantity=State.jaw_gap, above=1.6 * start.opening, otherwise=gap)
        middle, outer = self._middle_holes(layer), self._outer_holes()
        touch = self._unfold_to_touch(layer)
        return [
            Phase("approach", [*back, move(retreat=0.0), settle(), Measure("empty")]),
            Phase("grasp", [move(opening=0.0), closed, CheckGrasp(t)]),
            Phase("lift", [move(z=start.z + config.lift_m), settle(), CheckWeight(weight)]),
            Phase("carry", [move(y=0.0, z=over), settle()]),
            Phase("bend", [move(pace=slow, alpha=self.bend_rad), settle(), Measure("free")]),
            Phase("lower", self._lower(layer, middle)),
            Phase("seat middle", [settle(alpha_ratio=1.0)], middle),
            Phase("unfold", [touch]),
            Phase("lower outer", self._lower_outer(layer, touch, outer)),
            Phase("seat outer", [settle(alpha_ratio=0.0)], outer),
            Phase(CHECK, self._check_seats(settle())),
            Phase("release", [move(opening=start.opening), opened]),
            Phase("withdraw", [move(retreat=start.retreat), settle()]),
        ]

    def _lower(self, layer: int, holes: HolePair) -> Sequence[Step]:
        """Go above the tips, to a place of the search, down past the tips, and to the bed."""
        config, pins, speeds = self.config, self.config.layout.pins, self.config.speeds
        tips = self._seat_z(layer) + pins.height_m
        past_tips = tips - pins.tip_m - _TIP_MARGIN_M
        x, y = zip(*config.search.places(), strict=True)
        contact, seat = (
            replace(self.pace, linear_m_per_s=speed)
            for speed in (speeds.contact_m_per_s, speeds.seat_m_per_s)
        )
        return [
            self._move(z=tips + _TIP_MARGIN_M),
            self._move(x=x, y=y),
            self._down(holes, contact, z=past_tips),
            self._down(holes, seat, top=past_tips, z=holes.target),
        ]

    def _unfold_to_touch(self, layer: int) -> Move:
        """Go to a little before the touch, as on the middle pins; the press goes with the angle."""
        margin_rad = math.pi * _TIP_MARGIN_M / self.sheet.length_m
        alpha = min(self.touch_rad + margin_rad, self.bend_rad)
        z = self._seat_z(layer) - self.config.press_m * alpha / self.bend_rad
        return self._move(alpha_ratio=1.0, alpha=alpha, z=z)

    def _lower_outer(self, layer: int, touch: Move, holes: HolePair) -> Sequence[Step]:
        """Unfold; where it is not the first time, bend up to the touch and turn before."""
        config = self.config
        turn = self._move(yaw=tuple(config.search.turns(config.layout.holes)), alpha_ratio=1.0)
        slow = replace(self.pace, angular_rad_per_s=config.speeds.contact_rad_per_s)
        return [
            *(replace(move, retry_only=True) for move in (touch, turn)),
            self._down(holes, slow, alpha=holes.target, z=self._seat_z(layer)),
        ]

    def _check_seats(self, settle: Step) -> Sequence[Step]:
        """Move the sheet to and fro on its pins, along, across and turning about the vertical.

        Turned by as much as brings the outer holes to their pins, the middle ones stay in their
        play: only a sheet that all pins hold is held in all three.
        """
        config = self.config
        moved, play = config.check_m, 0.5 * config.layout.holes.clearance_m
        if not moved:
            return []
        slow = replace(self.pace, linear_m_per_s=config.speeds.contact_m_per_s)
        steps: list[Step] = []
        for axis, (name, arm) in enumerate(
            (("x", 1.0), ("y", 1.0), ("yaw", config.layout.holes.outer.along_m))
        ):
            there, back = (Shift(name=name, by=by / arm, pace=slow) for by in (moved, -2 * moved))
            check = CheckHeld(axis=axis, moved=moved / arm, play=play / arm)
            steps += [there, settle, Measure("ahead"), back, settle, check, there]
        return steps

    def _middle_holes(self, layer: int) -> HolePair:
        """Tell a tip from the press on the bent sheet, whose middle either holds up."""
        press_n, tip_n = self.press_force_n, self.tip_force_n
        return HolePair(
            name="middle",
            coordinate="z",
            target=self._seat_z(layer) - self.config.press_m,
            support=State.support,
            touch_n=press_n + 0.1 * (tip_n - press_n),
            missed_n=press_n + 0.3 * (tip_n - press_n),
            softness=self.config.press_m / press_n,
            attempts=1 + self.config.search.attempts,
        )

    def _outer_holes(self) -> HolePair:
        """Tell a tip by the stiffness of the sheet between the outer hole and the grip."""
        layout, sheet = self.config.layout, self.sheet
        overhang = 0.5 * sheet.length_m - layout.holes.outer.along_m
        stiffness = 3.0 * sheet.bending_stiffness_nm2 / overhang**3
        missed = 0.5 * stiffness * layout.pins.height_m
        return HolePair(
            name="outer",
            coordinate="alpha",
            target=0.0,
            support=State.end_support,
            touch_n=0.4 * missed,
            missed_n=missed,
            # A grip rises by L/π for each radian.
            softness=math.pi / (stiffness * sheet.length_m),
            attempts=1 + self.config.search.attempts,
        )

    # -- its steps --------------------------------------------------------------------------

    def _move(
        self,
        *,
        pace: Pace | None = None,
        alpha_ratio: float | None = None,
        **to: float | tuple[float, ...],
    ) -> Move:
        return Move(to=to, pace=pace or self.pace, alpha_ratio=alpha_ratio)

    def _down(self, holes: HolePair, pace: Pace, *, top: float = math.inf, **to: float) -> Move:
        """Return a motion that heeds the tips of pins; arms that do not comply just go."""
        if self.config.compliance is None:
            return self._move(pace=pace, **to)
        return MoveDown(
            to=to,
            pace=pace,
            alpha_ratio=1.0,
            holes=holes,
            bottom=to[holes.coordinate],
            top=top,
            timeout_s=self.config.timeout_s,
        )


def middle_force(sheet: Sheet, path: BendingPath, height_m: float) -> float:
    """Return the force [N] that holds the bent sheet's middle this much above its place.

    Twice the end force of half the sheet, its middle level between two rigid grips. InputError
    where no equilibrium is found.
    """
    bend_rad = float(path.knots[-1])
    half, rise = path.at(bend_rad)
    L, weight = sheet.length_m, sheet.mass_kg * GRAVITY_M_PER_S2
    grip, middle = (-half, rise, bend_rad), (0.0, height_m, 0.0)
    state = solve_planar(sheet.bending_stiffness_nm2, L / 2, grip, middle, weight / L)
    if not state.converged:
        raise InputError(
            f"the force of the bent sheet held {1e3 * height_m:.2f} mm up was not found "
            f"({state.reason}): the contact force could not be evaluated"
        )
    return -2.0 * state.right.force_z_n
